"""The views join a grasp to the row that it was made on, whatever else has its name."""

from pathlib import Path

from handmade import N_POINTS, session_tables, trial_tables

import graspdb
from graspdb.store import Store


def test_grasps_keep_their_version_of_an_object(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables(size=1.0))
    store.commit_trials([trial_tables(1), trial_tables(3, object_=None, n_grasps=0)])
    store.commit_session(session_tables(size=2.0))
    store.commit_trial(trial_tables(2))
    store.commit_session(session_tables(session="later", size=1.0))
    store.commit_trial(trial_tables(1, session="later"))
    with graspdb.open(store.path) as database:
        assert database.sql("SELECT count(*) FROM objects WHERE session = 's'").rows() == [(2,)]
        rows = database.sql("SELECT trial, mesh_sha256, cloud FROM grasp_objects ORDER BY trial").rows()
        assert [row[:2] for row in rows] == [
            ("later/anna_mug_1", "mug1.0"),
            ("s/anna_mug_1", "mug1.0"),
            ("s/anna_mug_2", "mug2.0"),
        ]
        later, first, second = (row[2] for row in rows)
        assert later == first != second
        points = database.sql(
            "SELECT o.trial, count(*), max(p.position[1]) FROM grasp_objects o JOIN object_points p "
            "ON p.object = o.object AND p.ingest_id = o.object_ingest_id GROUP BY o.trial ORDER BY o.trial"
        ).rows()
        assert [row[1:] for row in points] == [(N_POINTS, 4.0), (N_POINTS, 4.0), (N_POINTS, 8.0)]
        hands = database.sql("SELECT trial, side, subject FROM grasp_hands ORDER BY trial").rows()
        assert hands == [(row[0], "right", "anna") for row in rows]
