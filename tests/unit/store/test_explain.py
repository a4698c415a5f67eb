"""Which trials an ingest would redo, and why: exactly those that a change touches."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from handmade import rows

import graspdb
from graspdb.explaining import Action
from graspdb.ingestion import with_kept_hands
from graspdb.store import Store
from graspdb_ingest.calibration_set import calibration_recordings
from graspdb_ingest.input_key import input_key, session_inputs, software_version
from graspdb_ingest.parameters import ContactParameters, IngestParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.manifest import Session
from graspdb_schemas.manifest_reader import parse_manifest

PARAMETERS = IngestParameters()
MANIFEST: dict[str, Any] = {
    "graspdb_session": 1,
    "id": "day",
    "units": "mm",
    "up": [0, 0, 1],
    "marker_set": "forearm4-dorsal20",
    "subjects": {
        "anna": {"hand": "right", "hand_length": 180, "hand_breadth": 80},
        "ben": {"hand": "right", "hand_length": 190, "hand_breadth": 85, "calibration": ["ben_rom.c3d"]},
    },
    "objects": {
        name: {"mesh": f"{name}.stl", "markers": {f"{name}_{i}": [10 * i, 10 * i * i, 1] for i in range(3)}}
        for name in ("mug", "jug")
    },
    "trials": [
        {"file": f"{subject}_{name}.c3d", "subject": subject, "object": name}
        for subject in ("anna", "ben")
        for name in ("mug", "jug")
    ],
}


class Day:
    """A session of files that nobody reads, and a database that says it was ingested from them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "session"
        self.db = folder / "db"
        self.folder.mkdir()
        self.manifest = json.loads(json.dumps(MANIFEST))
        for name in ("ben_rom.c3d", "mug.stl", "jug.stl"):
            self.touch(name)
        self.write()

    def touch(self, name: str, content: str = "") -> None:
        """Write a file."""
        (self.folder / name).write_text(f"{name} {content}")

    def write(self) -> None:
        """Write the manifest, and a recording for each trial that has none yet."""
        for trial in self.manifest["trials"]:
            if not (self.folder / trial["file"]).exists():
                self.touch(trial["file"])
        (self.folder / "session.yaml").write_text(yaml.safe_dump(self.manifest))

    def record(self, subject: str, name: str) -> None:
        """Add a trial to the manifest."""
        self.manifest["trials"].append({"file": f"{name}.c3d", "subject": subject, "object": "mug"})
        self.write()

    def ingest(self, force: bool = False) -> Session:
        """Commit what an ingest would, without following anything; return the session as it saw it."""
        session = parse_manifest(self.folder)
        store = Store.create_or_open(self.db)
        if not force:
            session = with_kept_hands(session, store, PARAMETERS)
        inputs = session_inputs(session, PARAMETERS)
        hands = [
            {
                "session": "day",
                "subject": name,
                "side": "right",
                "calibration_recordings": list(calibration_recordings(session, subject).items()),
            }
            for name, subject in session.subjects.items()
        ]
        store.commit_session(TrialTables({"hands": rows("hands", *hands)}))
        for trial in session.trials:
            row = {
                "session": "day",
                "trial": f"day/{trial.name}",
                "subject": trial.subject,
                "object": trial.object,
                "input_key": input_key(inputs[trial.name]),
                "inputs": list(inputs[trial.name].items()),
                "parameters": PARAMETERS.to_json(),
                "software_version": software_version(),
            }
            store.commit_trial(TrialTables({"trials": rows("trials", row)}), force=force)
        return session

    def plans(self, **options: Any) -> dict[str, tuple[str, ...]]:
        """Return the reasons of each trial that would not be skipped."""
        found = graspdb.explain_ingest(self.folder, self.db, **options)
        return {plan.trial.removeprefix("day/"): plan.reasons for plan in found if plan.action != Action.SKIP}


@pytest.fixture
def day(tmp_path: Path) -> Day:
    return Day(tmp_path)


ALL = ("anna_mug", "anna_jug", "ben_mug", "ben_jug")


def edit(*path: str, value: Any) -> Callable[[Day], None]:
    def change(day: Day) -> None:
        entry = day.manifest
        for key in path[:-1]:
            entry = entry[int(key) if isinstance(entry, list) else key]
        entry[path[-1]] = value
        day.write()

    return change


def touch(name: str) -> Callable[[Day], None]:
    return lambda day: day.touch(name, "changed")


@pytest.mark.parametrize(
    ("change", "redone", "reason"),
    [
        (touch("mug.stl"), ("anna_mug", "ben_mug"), "object's file mug.stl has changed"),
        (
            edit("objects", "jug", "mass", value=0.3),
            ("anna_jug", "ben_jug"),
            "session.yaml: objects.jug.mass is new",
        ),
        (
            edit("subjects", "ben", "hand_length", value=191),
            ALL[2:],
            "session.yaml: subjects.ben.hand_length has changed",
        ),
        (edit("trials", "3", "task", value="pour"), ("ben_jug",), "session.yaml: trial.task is new"),
        (edit("up", value=[0, 1, 0]), ALL, "session.yaml: up has changed"),
        (touch("ben_rom.c3d"), ALL[2:], "calibration of ben's hand: ben_rom.c3d has changed"),
        (touch("ben_jug.c3d"), ("ben_jug",), "recording ben_jug.c3d has changed"),
        (touch("anna_jug.c3d"), ALL[:2], "calibration of anna's hand: anna_jug.c3d has changed"),
    ],
)
def test_a_change_redoes_exactly_the_trials_it_touches(
    day: Day, change: Callable[[Day], None], redone: tuple[str, ...], reason: str
) -> None:
    day.ingest()
    assert day.plans() == {}
    change(day)
    plans = day.plans()
    assert set(plans) == set(redone)
    assert all(reason in reasons for reasons in plans.values())
    day.ingest()
    assert day.plans() == {}


def test_a_new_recording_day_costs_only_itself(day: Day) -> None:
    """Anna's hand keeps the recordings that it was calibrated from, though no calibration is named."""
    day.ingest()
    day.record("anna", "anna_later")
    assert day.plans() == {"anna_later": ("not in the database",)}
    session = day.ingest()
    assert [file.name for file in session.subjects["anna"].calibration] == ["anna_mug.c3d", "anna_jug.c3d"]
    day.record("anna", "anna_even_later")
    day.manifest["trials"].reverse()
    day.write()
    assert day.plans() == {"anna_even_later": ("not in the database",)}


def test_a_hand_that_has_to_be_made_anew_is_made_from_all_there_is(day: Day) -> None:
    day.ingest()
    day.record("anna", "anna_later")
    day.ingest()
    day.manifest["trials"] = [t for t in day.manifest["trials"] if t["file"] != "anna_mug.c3d"]
    day.write()
    plans = day.plans()
    assert set(plans) == {"anna_mug", "anna_jug", "anna_later"}
    assert plans["anna_mug"] == ("not in the manifest",)
    assert "calibration of anna's hand: anna_mug.c3d is gone" in plans["anna_jug"]
    assert "calibration of anna's hand: anna_later.c3d is new" in plans["anna_jug"]
    session = day.ingest()
    assert day.plans() == {"anna_mug": ("not in the manifest",)}
    files = [
        file.name
        for file in with_kept_hands(session, Store.open(day.db), PARAMETERS).subjects["anna"].calibration
    ]
    assert sorted(files) == ["anna_jug.c3d", "anna_later.c3d"]


def test_force_calibrates_from_all_recordings(day: Day) -> None:
    day.ingest()
    day.record("anna", "anna_later")
    day.ingest()
    assert day.plans(force=True)["ben_mug"] == ("forced",)
    day.ingest(force=True)
    assert day.plans() == {}
    day.record("anna", "anna_even_later")
    session = day.ingest()
    assert len(session.subjects["anna"].calibration) == 3


def test_parameters_are_told_with_their_values(day: Day) -> None:
    day.ingest()
    other = IngestParameters(contact=replace(ContactParameters(), threshold=0.005))
    assert day.plans(parameters=other) == dict.fromkeys(
        ALL, ("parameter contact.threshold: 0.004 before, 0.005 now",)
    )


def test_another_version_of_the_software_is_told(day: Day, monkeypatch: pytest.MonkeyPatch) -> None:
    day.ingest()
    now = f"{software_version()}.next"
    monkeypatch.setattr("graspdb_ingest.input_key.version", lambda _: now)
    assert day.plans()["ben_mug"] == (f"software: {now.removesuffix('.next')} before, {now} now",)


def test_explaining_writes_nothing(day: Day) -> None:
    assert day.plans() == dict.fromkeys(ALL, ("not in the database",))
    assert not day.db.exists()
    day.ingest()

    def state() -> dict[str, str]:
        files = [file for file in day.db.rglob("*") if file.is_file()]
        return {str(file): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}

    before = state()
    day.touch("mug.stl", "changed")
    day.plans()
    assert state() == before
