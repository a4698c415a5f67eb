"""What a database says of a session's trials, for whoever is about to ingest them again."""

from collections.abc import Mapping
from dataclasses import dataclass

from deltalake import DeltaTable

from graspdb.store.layout import read_rows
from graspdb.store.open_tables import quoted
from graspdb_ingest.calibration_set import CalibratedHand


@dataclass(frozen=True)
class CommittedTrial:
    """What a committed trial was made from.

    Attributes
    ----------
    input_key : str
        One key for all its inputs.
    inputs : mapping of str to str, or None
        Its inputs by name; None where the database's format did not keep them.
    parameters : str
        Parameters of its ingest, as JSON.
    software_version : str
        Version of graspdb.
    recordings : mapping of str to str, or None
        What its hand was calibrated from; None where it has no such hand, or the format did not keep it.
    """

    input_key: str
    inputs: Mapping[str, str] | None
    parameters: str
    software_version: str
    recordings: Mapping[str, str] | None


def committed_input_keys(trials: DeltaTable, session: str) -> dict[str, str]:
    """Return what each committed trial of a session was made from: trial -> input_key."""
    rows = read_rows("trials", trials, ["trial", "input_key"], _of(session))
    return dict(zip(rows["trial"].to_pylist(), rows["input_key"].to_pylist(), strict=True))


def committed_trials(trials: DeltaTable, hands: DeltaTable, session: str) -> dict[str, CommittedTrial]:
    """Return what each committed trial of a session was made from, part by part."""
    columns = ["trial", "input_key", "inputs", "parameters", "software_version", "context"]
    recordings = _recordings(hands, session)
    found = {}
    for row in read_rows("trials", trials, columns, _of(session)).to_pylist(maps_as_pydicts="strict"):
        hand = next((recordings[key] for key in row["context"] if recordings.get(key)), None)
        found[row["trial"]] = CommittedTrial(
            row["input_key"], row["inputs"], row["parameters"], row["software_version"], hand
        )
    return found


def calibrated_hands(trials: DeltaTable, hands: DeltaTable, session: str) -> list[CalibratedHand]:
    """Return the hands that committed trials of a session stand on, the one committed last first."""
    recordings = _recordings(hands, session)
    rows = read_rows("trials", trials, ["subject", "inputs", "context", "ingest_id"], _of(session))
    rows = rows.sort_by([("ingest_id", "descending")])
    found = []
    for i, context in enumerate(rows["context"].to_pylist()):
        for used in [recordings.pop(key) for key in context if key in recordings]:
            inputs = rows["inputs"][i].as_py(maps_as_pydicts="strict")
            if used and inputs:
                found.append(CalibratedHand(rows["subject"][i].as_py(), inputs, used))
    return found


def _recordings(hands: DeltaTable, session: str) -> dict[str, Mapping[str, str] | None]:
    """Return what the hands of a session were calibrated from, by ingest_id."""
    rows = read_rows("hands", hands, ["ingest_id", "calibration_recordings"], _of(session))
    found = rows["calibration_recordings"].to_pylist(maps_as_pydicts="strict")
    return dict(zip(rows["ingest_id"].to_pylist(), found, strict=True))


def _of(session: str) -> str:
    return f"session = {quoted([session])}"
