"""Measured centres of pressure: read, refused with a reason, and compared with contact points."""

from pathlib import Path

import handmade
import numpy as np
import pytest
from typer.testing import CliRunner

import graspdb
from graspdb.cli import app
from graspdb.store import Store
from graspdb.validation.contacts import contact_errors, mean_error
from graspdb_ingest.reference_contacts import read_reference_contacts
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import QueryError, RecordingError

GOOD = "time,digit,x,y,z\n0.01,thumb,1,2,3\n0.01,index,4,5,6\n0.02,thumb,,,\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "pressure.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_in_millimetres_is_read_in_metres(tmp_path: Path) -> None:
    reference = read_reference_contacts(written(tmp_path, GOOD), 0.001)
    assert reference.digits == ("thumb", "index")
    assert reference.times.tolist() == [0.01, 0.01]
    assert np.allclose(reference.positions, [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])


def test_columns_may_stand_in_any_order(tmp_path: Path) -> None:
    text = "Z,Digit,extra,Time,Y,X\n3,Thumb,a,0.5,2,1\n"
    reference = read_reference_contacts(written(tmp_path, text), 1.0)
    assert np.allclose(reference.positions, [[1, 2, 3]])


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "no column time, digit, x, y, z"),
        ("time,digit,x,y\n0,thumb,1,2\n", "no column z"),
        ("time,digit,x,y,z\n", "no row with a time"),
        ("time,digit,x,y,z\n0,thumb,nan,nan,nan\n", "no row with a time"),
        ("time,digit,x,y,z\n0,indx,1,2,3\n", "line 2: the digit 'indx'"),
        ("time,digit,x,y,z\n0,,1,2,3\n", "line 2: the digit ''"),
        ("time,digit,x,y,z\n0,thumb,one,2,3\n", "'one' is not a number"),
        ("time,digit,x,y,z\n0,thumb,1,2,30\n", "30 m from the object's origin"),
        ("time,digit,x,y,z\n0,thumb,inf,2,3\n", "no row with a time"),
    ],
)
def test_a_bad_file_says_what_is_wrong(tmp_path: Path, text: str, found: str) -> None:
    with pytest.raises(RecordingError, match=found) as caught:
        read_reference_contacts(written(tmp_path, text), 1.0)
    assert "pressure.csv" in str(caught.value)


def test_mean_and_confidence_interval_are_students() -> None:
    error = mean_error(np.array([1.0, 2.0, 3.0, np.nan]))
    assert (error.n, error.mean) == (3, 2.0)
    # t(0.975, 2) = 4.303, standard error 1 / sqrt(3)
    assert error.high - error.mean == pytest.approx(4.303 / np.sqrt(3), abs=1e-3)
    assert error.low == 0.0  # a distance is never negative
    assert mean_error(np.array([0.5])).mean == 0.5
    assert np.isnan(mean_error(np.array([0.5])).low)
    assert np.isnan(mean_error(np.array([])).mean)


def pressed_database(folder: Path) -> Path:
    """Return a database in which the thumb is off by known distances and the little finger is missed."""
    tables = handmade.trial_tables(sites=("thumb_ip", "thumb_tip", "index_tip"))
    trial = tables.tables["grasps"]["trial"][0].as_py()
    pressed = [
        # contact points are (0, 0, 0), (1, 0, 0) and (2, 0, 0), in the order of the sites
        {"trial": trial, "time": 0.021, "digit": "thumb", "position": [0.5, 3.0, 4.0]},
        {"trial": trial, "time": 0.030, "digit": "thumb", "position": [9.0, 9.0, 9.0]},
        {"trial": trial, "time": 0.019, "digit": "index", "position": [2.0, 0.0, 0.25]},
        {"trial": trial, "time": 0.020, "digit": "little", "position": [0.0, 0.0, 0.0]},
        {"trial": trial, "time": 0.500, "digit": "ring", "position": [0.0, 0.0, 0.0]},
    ]
    changed = dict(tables.tables) | {"reference_contacts": handmade.rows("reference_contacts", *pressed)}
    return commit(folder, TrialTables(changed))


def commit(folder: Path, trial: TrialTables) -> Path:
    store = Store.create_or_open(folder)
    store.commit_session(handmade.session_tables())
    store.commit_trials([trial])
    return folder


def test_errors_are_the_distances_that_were_made(tmp_path: Path) -> None:
    with graspdb.open(pressed_database(tmp_path / "db")) as database:
        errors = {error.digit: error for error in contact_errors(database)}
    assert list(errors) == ["thumb", "index", "little"]
    assert {error.pair for error in errors.values()} == {"thumb+index+little"}
    assert errors["thumb"].all_points.mean == pytest.approx(5.0)
    assert errors["thumb"].most_distal.mean == pytest.approx(np.sqrt(0.25 + 9 + 16))
    # both gaps of the thumb are alike, so its weighted mean is the plain one
    assert errors["thumb"].weighted.mean == pytest.approx(5.0)
    assert errors["index"].all_points.mean == pytest.approx(0.25)
    assert (errors["little"].all_points.n, errors["little"].n_missed) == (0, 1)


def test_the_command_prints_the_table_and_json(tmp_path: Path) -> None:
    db = pressed_database(tmp_path / "db")
    table = CliRunner().invoke(app, ["validate", "contacts", "--db", str(db)])
    assert table.exit_code == 0
    assert "5000.0/250.0/-" in table.output
    told = CliRunner().invoke(app, ["validate", "contacts", "--db", str(db), "--json"])
    assert '"mean_mm": 5000.0' in told.output


def test_without_measurements_the_message_says_what_to_do(tmp_path: Path) -> None:
    tables = {k: v for k, v in handmade.trial_tables().tables.items() if k != "reference_contacts"}
    db = commit(tmp_path / "db", TrialTables(tables))
    with graspdb.open(db) as database, pytest.raises(QueryError, match="reference_contacts"):
        contact_errors(database)
