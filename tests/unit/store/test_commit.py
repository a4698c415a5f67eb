"""What a commit promises: all of a trial or nothing, once, and the same again changes nothing."""

from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pytest
from handmade import N_FRAMES, N_POINTS, rows, session_tables, trial_tables

import graspdb
from graspdb.store import Committed, Outcome, Store, commit
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.tables import TABLES


@pytest.fixture
def store(tmp_path: Path) -> Store:
    opened = Store.create_or_open(tmp_path / "db")
    opened.commit_session(session_tables())
    return opened


def visible(store: Store) -> dict[str, pa.Table]:
    with graspdb.open(store.path) as database:
        return {name: database.table(name) for name in TABLES}


def counts(store: Store) -> dict[str, int]:
    return {name: table.num_rows for name, table in visible(store).items()}


def test_a_committed_trial_is_seen_whole(store: Store) -> None:
    assert store.commit_trial(trial_tables(1)) == Committed("s/anna_mug_1", Outcome.ADDED)
    assert counts(store) == {
        "sessions": 1,
        "subjects": 1,
        "hands": 1,
        "objects": 1,
        "object_points": N_POINTS,
        "trials": 1,
        "markers": N_FRAMES,
        "frames": N_FRAMES,
        "grasps": 1,
        "contacts": 3,
        "features": 1,
        "contact_events": 0,
        "contact_maps": 0,
        "reference_contacts": 2,
        "measured_maps": 0,
    }


def test_rows_come_back_as_they_were_given_with_units_and_documentation(store: Store) -> None:
    trial = trial_tables(1)
    store.commit_trial(trial)
    seen = visible(store)
    for name, given in {**session_tables(subjects=["anna"]).tables, **trial.tables}.items():
        assert seen[name].schema.equals(TABLES[name], check_metadata=True)
        assert seen[name].select(given.column_names).to_pylist() == given.to_pylist(), name


def test_the_same_again_makes_no_new_version(store: Store) -> None:
    store.commit_trials([trial_tables(1), trial_tables(2)])
    before = store.snapshot().versions
    again = Store.create_or_open(store.path)
    again.commit_session(session_tables())
    outcomes = again.commit_trials([trial_tables(1), trial_tables(2)])
    assert [outcome.outcome for outcome in outcomes] == [Outcome.UNCHANGED, Outcome.UNCHANGED]
    assert again.snapshot().versions == before


def test_a_changed_trial_replaces_the_old_one(store: Store) -> None:
    store.commit_trial(trial_tables(1))
    store.commit_trial(trial_tables(2))
    changed = trial_tables(1, input_key="other", sites=["thumb_tip"])
    assert store.commit_trial(changed).outcome == Outcome.REPLACED
    seen = visible(store)
    assert sorted(seen["trials"]["input_key"].to_pylist()) == ["key s/anna_mug_2", "other"]
    assert sorted(
        zip(seen["contacts"]["trial"].to_pylist(), seen["contacts"]["site"].to_pylist(), strict=True)
    ) == [
        ("s/anna_mug_1", "thumb_tip"),
        ("s/anna_mug_2", "index_pip"),
        ("s/anna_mug_2", "index_tip"),
        ("s/anna_mug_2", "thumb_tip"),
    ]


def test_force_replaces_an_unchanged_trial(store: Store) -> None:
    store.commit_trial(trial_tables(1))
    first = visible(store)["trials"]["ingest_id"][0].as_py()
    assert store.commit_trial(trial_tables(1), force=True).outcome == Outcome.REPLACED
    seen = visible(store)
    assert seen["trials"].num_rows == 1
    assert seen["trials"]["ingest_id"][0].as_py() != first
    assert seen["frames"].num_rows == N_FRAMES


def test_replacing_is_one_transaction(store: Store) -> None:
    store.commit_trial(trial_tables(1))
    before = store.snapshot().versions["trials"]
    store.commit_trial(trial_tables(1), force=True)
    assert store.snapshot().versions["trials"] == before + 1


def test_an_interrupted_ingest_is_not_seen_and_the_next_one_is(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.commit_trial(trial_tables(1))

    def die(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(commit, "_publish", die)
        with pytest.raises(KeyboardInterrupt):
            store.commit_trial(trial_tables(2))
    assert counts(store)["frames"] == N_FRAMES
    assert visible(store)["trials"]["trial"].to_pylist() == ["s/anna_mug_1"]
    again = Store.open(store.path)
    again.commit_session(session_tables())
    assert again.commit_trial(trial_tables(2)).outcome == Outcome.ADDED
    assert counts(again)["frames"] == 2 * N_FRAMES


def test_an_interrupted_replacement_leaves_the_old_trial(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.commit_trial(trial_tables(1))
    before = visible(store)
    with monkeypatch.context() as patched:
        patched.setattr(commit, "_publish", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            store.commit_trial(trial_tables(1, input_key="other"), force=True)
    assert visible(store) == before


def test_a_batch_becomes_visible_in_one_step(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    batch = [trial_tables(i) for i in range(20)]
    with monkeypatch.context() as patched:
        patched.setattr(commit, "_publish", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            store.commit_trials(batch)
    assert counts(store)["trials"] == 0
    store.commit_trials(batch)
    assert counts(store)["trials"] == 20
    assert store.snapshot().versions["trials"] == 1
    assert len(set(visible(store)["frames"]["ingest_id"].to_pylist())) == 20


def test_session_rows_are_seen_only_if_a_trial_stands_on_them(store: Store) -> None:
    assert counts(store)["objects"] == 0
    store.commit_trial(trial_tables(1, subject="anna", object_=None))
    seen = visible(store)
    assert seen["objects"].num_rows == 0
    assert seen["subjects"]["subject"].to_pylist() == ["anna"]
    store.commit_trial(trial_tables(1, subject="ben"))
    seen = visible(store)
    assert seen["objects"].num_rows == 1
    assert sorted(seen["subjects"]["subject"].to_pylist()) == ["anna", "ben"]


def test_what_has_not_changed_is_written_once(store: Store) -> None:
    store.commit_trial(trial_tables(1))
    again = Store.open(store.path)
    again.commit_session(session_tables())
    again.commit_trial(trial_tables(2))
    versions = again.snapshot().versions
    assert {
        name: versions[name] for name in ("sessions", "subjects", "hands", "objects", "object_points")
    } == (dict.fromkeys(("sessions", "subjects", "hands", "objects", "object_points"), 1))


def test_a_changed_mesh_gives_new_rows_and_old_trials_keep_theirs(store: Store) -> None:
    store.commit_trial(trial_tables(1))
    store.commit_session(session_tables(size=2.0))
    store.commit_trial(trial_tables(2))
    with graspdb.open(store.path) as database:
        assert database.info().several_versions == ("object s/mug",)
        old, new = database.grasp("s/anna_mug_1/right/0"), database.grasp("s/anna_mug_2/right/0")
        assert old.feature_cloud[:, 0].tolist() == [1.0, 3.0]
        assert new.feature_cloud[:, 0].tolist() == [2.0, 6.0]
        exact = database.sql(
            """
            SELECT grasp, mesh_sha256 FROM grasps g
            JOIN trials t USING (trial)
            JOIN objects o ON o.object = g.object AND list_contains(t.context, o.ingest_id)
            ORDER BY grasp
            """
        )
        assert exact.rows() == [("s/anna_mug_1/right/0", "mug1.0"), ("s/anna_mug_2/right/0", "mug2.0")]
    store.commit_trial(trial_tables(1, input_key="with the new mesh"))
    with graspdb.open(store.path) as database:
        assert database.info().several_versions == ()
        assert database.grasp("s/anna_mug_1/right/0").feature_cloud[:, 0].tolist() == [2.0, 6.0]


def test_a_grown_manifest_leaves_one_row_for_the_session(store: Store) -> None:
    store.commit_trial(trial_tables(1))
    grown = session_tables()
    manifest = rows("sessions", {"session": "s", "up": [0, 0, 1], "manifest": '{"trials": 2}'})
    store.commit_session(TrialTables({**grown.tables, "sessions": manifest}))
    store.commit_trial(trial_tables(2))
    assert visible(store)["sessions"]["manifest"].to_pylist() == ['{"trials": 2}']


def test_every_row_of_a_context_is_there(store: Store) -> None:
    store.commit_trials([trial_tables(i, subject=name) for i in range(3) for name in ("anna", "ben")])
    seen = visible(store)
    for context in seen["trials"]["context"].to_pylist():
        assert len(context) == 4
        for name in ("sessions", "subjects", "hands", "objects"):
            assert pc.sum(pc.is_in(seen[name]["ingest_id"], pa.array(context))).as_py() == 1


@pytest.mark.parametrize(
    "session",
    ["it's", 'say "x"', "back\\slash", "new\nline", "ü/é", "%_", "--", "a;b", "s" * 80, "${x}"],
)
def test_any_text_may_be_a_key(tmp_path: Path, session: str) -> None:
    store = Store.create_or_open(tmp_path / "db")
    twin = session + "2"
    for name in (session, twin):
        store.commit_session(session_tables(name))
        store.commit_trial(trial_tables(1, session=name))
    assert store.commit_trial(trial_tables(1, session=session)).outcome == Outcome.UNCHANGED
    assert store.commit_trial(trial_tables(1, session=session), force=True).outcome == Outcome.REPLACED
    with graspdb.open(store.path) as database:
        assert sorted(database.table("trials")["session"].to_pylist()) == sorted([session, twin])
        assert database.grasp(f"{session}/anna_mug_1/right/0").session == session


def test_committed_input_keys(store: Store) -> None:
    assert store.committed_input_keys("s") == {}
    store.commit_trials([trial_tables(1), trial_tables(2, input_key="k")])
    assert store.committed_input_keys("s") == {"s/anna_mug_1": "key s/anna_mug_1", "s/anna_mug_2": "k"}


def test_wrong_bundles_are_refused(store: Store) -> None:
    trial = trial_tables(1)
    with pytest.raises(ParameterError, match="each trial once"):
        store.commit_trials([trial, trial])
    with pytest.raises(ParameterError, match="exactly one row"):
        store.commit_trial(TrialTables({"frames": trial.tables["frames"]}))
    with pytest.raises(ParameterError, match="input_key"):
        store.commit_trial(TrialTables({"trials": rows("trials", {"session": "s", "trial": "s/1"})}))
    with pytest.raises(ParameterError, match=r"frames\.trial"):
        store.commit_trial(TrialTables({**trial.tables, "frames": trial_tables(2).tables["frames"]}))
    with pytest.raises(ParameterError, match="did you mean 'frames'"):
        TrialTables({"frame": trial.tables["frames"]})
    with pytest.raises(ParameterError, match="columns missing: time"):
        TrialTables({"frames": trial.tables["frames"].drop_columns(["time"])})
    assert store.snapshot().versions == dict.fromkeys(TABLES, 0)
