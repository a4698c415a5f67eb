"""A writer that keeps its tables open sees what others write, and reads nothing that it wrote itself."""

from itertools import pairwise
from pathlib import Path

import pytest
from handmade import session_tables, trial_tables

from graspdb.store import Outcome, Store, open_tables


@pytest.fixture
def store(tmp_path: Path) -> Store:
    opened = Store.create_or_open(tmp_path / "db")
    opened.commit_session(session_tables())
    return opened


def test_commits_in_a_row_read_the_trials_once(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    store.commit_trial(trial_tables(0))
    monkeypatch.delattr(open_tables, "_read")
    assert store.commit_trial(trial_tables(1)).outcome == Outcome.ADDED
    assert store.commit_trial(trial_tables(0)).outcome == Outcome.UNCHANGED
    assert store.commit_trial(trial_tables(0, input_key="other")).outcome == Outcome.REPLACED


def test_what_a_commit_leaves_is_what_would_be_read(store: Store) -> None:
    for number, size in enumerate([1.0, 2.0, 1.0]):
        store.commit_session(session_tables(size=size))
        store.commit_trials([trial_tables(number + 1), trial_tables(0, input_key=f"{number}")])
        trial = open_tables.Trial("", "s", "", trial_tables().tables["trials"], {}, (), {})
        followed, read = store._tables.state([trial]), open_tables.OpenTables(store.path).state([trial])
        assert followed == read
        assert followed.contexts == read.contexts


def test_what_others_committed_or_removed_is_seen(store: Store) -> None:
    store.commit_trial(trial_tables(0))
    other = Store.open(store.path)
    other.commit_session(session_tables())
    other.commit_trial(trial_tables(1))
    assert store.commit_trial(trial_tables(1)).outcome == Outcome.UNCHANGED
    other.remove("trial", ["s/anna_mug_0"])
    other.sweep()
    assert store.commit_trial(trial_tables(0)).outcome == Outcome.ADDED


def test_tables_are_opened_anew_when_their_log_has_a_checkpoint(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(open_tables, "_CHECKPOINTS", 3)
    opened = [store._tables["frames"]]
    for number in range(6):
        assert store.commit_trial(trial_tables(number)).outcome == Outcome.ADDED
        opened.append(store._tables["frames"])
    changes = [before is not after for before, after in pairwise(opened)]
    assert changes == [False, False, False, True, False, False]
