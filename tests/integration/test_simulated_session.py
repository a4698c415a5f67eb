"""A simulated session from its files to its rows, against the truth that made it."""

import importlib.util
from pathlib import Path

import pytest
import yaml

import graspdb
from graspdb.ingestion import ingest
from graspdb.simulate import NoiseParameters, simulate_session
from graspdb.simulate.accuracy import Accuracy, measure_accuracy
from graspdb.store import Outcome
from graspdb_queries.named import named_queries, named_query

TOOLS = Path(__file__).parents[2] / "tools"
NOISE = NoiseParameters(marker_sd=0.001, skin_sd=0.0, occlusion=0.0, swaps=0.0)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "session"
    simulate_session(folder, subjects=1, trials=1, seed=11, noise=NOISE)
    return folder


@pytest.fixture(scope="module")
def db(session: Path) -> Path:
    folder = session.parent / "grasps"
    report = ingest(session, folder)
    assert not report.rejected
    return folder


@pytest.fixture(scope="module")
def accuracy(session: Path, db: Path) -> Accuracy:
    with graspdb.open(db) as database:
        return measure_accuracy(session, database)


def test_tips_are_within_two_millimetres_at_one_millimetre_of_noise(accuracy: Accuracy) -> None:
    print(f"\nmean tip error {1e3 * accuracy.tip_error:.2f} mm, sites {1e3 * accuracy.site_error:.2f} mm")
    assert accuracy.tip_error < 0.002


def test_true_contacts_are_found(accuracy: Accuracy) -> None:
    print(f"\nprecision {accuracy.contact_precision:.3f}, recall {accuracy.contact_recall:.3f}")
    assert accuracy.contact_recall > 0.9
    assert accuracy.contact_precision > 0.6


def test_every_lift_is_found_at_its_time(accuracy: Accuracy) -> None:
    assert accuracy.n_grasps >= accuracy.n_trials == 15
    assert accuracy.lift_onset_error < 0.05


@pytest.mark.parametrize("name", sorted(named_queries()))
def test_named_queries_answer_about_a_whole_session(db: Path, name: str) -> None:
    query = named_query(name)
    with graspdb.open(db) as database:
        result = database.query(name, **dict(query.example))
    assert list(result.columns) == [column.name for column in query.columns]
    # In this session no pressure was measured, and no trial needs to be recorded again.
    assert bool(result.rows()) == (name not in ("contact_errors", "rerecord"))


def test_ingesting_again_changes_nothing(session: Path, db: Path) -> None:
    with graspdb.open(db) as before:
        versions = before.snapshot.versions
    report = ingest(session, db)
    assert {trial.outcome for trial in report.trials} == {Outcome.UNCHANGED}
    with graspdb.open(db) as after:
        assert after.snapshot.versions == versions


def test_a_bad_trial_is_rejected_with_its_reason_and_the_others_land(session: Path, tmp_path: Path) -> None:
    copy = tmp_path / "session"
    (copy / "trials").mkdir(parents=True)
    (copy / "objects").mkdir()
    for file in (session / "objects").iterdir():
        (copy / "objects" / file.name).write_bytes(file.read_bytes())
    manifest = yaml.safe_load((session / "session.yaml").read_text())
    manifest["trials"] = manifest["trials"][:2]
    first, second = (entry["file"] for entry in manifest["trials"])
    (copy / first).write_bytes((session / first).read_bytes()[:5000])
    (copy / second).write_bytes((session / second).read_bytes())
    for subject in manifest["subjects"].values():
        subject.pop("calibration", None)
    (copy / "session.yaml").write_text(yaml.safe_dump(manifest))
    report = ingest(copy, tmp_path / "grasps")
    by_status = {trial.status: trial for trial in report.trials}
    assert set(by_status) == {"ok", "rejected"}
    assert Path(first).name in by_status["rejected"].reasons[0]
    with graspdb.open(tmp_path / "grasps") as database:
        rows = database.sql("SELECT status, count(*) FROM trials GROUP BY status ORDER BY status").rows()
    assert [tuple(row) for row in rows] == [("ok", 1), ("rejected", 1)]


def test_rows_do_not_depend_on_the_number_of_workers(session: Path, db: Path, tmp_path: Path) -> None:
    ingest(session, tmp_path / "grasps", workers=2)
    query = "SELECT trial, frame, q, gap FROM frames ORDER BY trial, frame"
    with graspdb.open(db) as one, graspdb.open(tmp_path / "grasps") as two:
        assert one.sql(query).arrow().equals(two.sql(query).arrow())


def test_force_replaces_without_doubling(session: Path, db: Path) -> None:
    with graspdb.open(db) as database:
        before = database.info().rows
    report = ingest(session, db, force=True)
    assert {trial.outcome for trial in report.trials} == {Outcome.REPLACED}
    with graspdb.open(db) as database:
        assert database.info().rows == before


def test_the_tutorial_runs_on_it(db: Path, tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("run_tutorial", TOOLS / "run_tutorial.py")
    assert spec is not None
    assert spec.loader is not None
    tutorial = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tutorial)
    notebook = tutorial.run(db, tmp_path)
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    kinds = [kind for output in shown for kind in output.get("data", ())]
    assert kinds.count("text/html") >= 7
    assert "image/png" in kinds
    assert not [output for output in shown if output.get("name") == "stderr"]
    assert (tmp_path / "grasp.html").stat().st_size > 500_000
