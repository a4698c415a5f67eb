"""A database with a person who is to be removed, and the search for what is left of them."""

import io
import json
from os import PathLike

import numpy as np
import pyarrow.parquet as pq
from handmade import rows, session_tables, trial_tables

from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables

PERSON = "zebediah"
MEASURE = 0.18734509
"""Length of the person's hand, and a number in every table of the trials."""


def manifest(trials: list[tuple[str, str]]) -> str:
    """Return a manifest of two people and some trials."""
    people = {"anna": {"hand_length": 190}, PERSON: {"hand_length": MEASURE}}
    entries = [{"file": f"trials/{name}.c3d", "subject": subject} for name, subject in trials]
    return json.dumps({"subjects": people, "trials": entries})


def fill(path: str | PathLike[str]) -> Store:
    """Make a database of a session of two people, taken in one by one, with one trial redone."""
    opened = Store.create_or_open(path)
    shared = dict(session_tables(subjects=["anna", PERSON]).tables)
    text = manifest([("anna_mug_0", "anna"), (f"{PERSON}_mug_0", PERSON), (f"{PERSON}_mug_1", PERSON)])
    shared["sessions"] = rows("sessions", {"session": "s", "manifest": text})
    opened.commit_session(TrialTables(shared))
    for number in range(2):
        opened.commit_trial(trial_tables(number))
        opened.commit_trial(marked(number))
    opened.commit_trial(marked(1), force=True)
    return opened


def marked(number: int) -> TrialTables:
    """Return a trial of the person, with the measure among its numbers."""
    tables = dict(trial_tables(number, subject=PERSON, residual_rms=MEASURE).tables)
    frames = tables["frames"].to_pylist()
    tables["frames"] = rows("frames", *(frame | {"q": [MEASURE] * 30} for frame in frames))
    return TrialTables(tables)


def is_trace(name: str, content: bytes) -> bool:
    """Whether a file has a trace of the person, in its bytes or in what they decode to."""
    if name.endswith(".parquet"):
        with pq.ParquetFile(io.BytesIO(content)) as parquet:
            content += repr(parquet.read().to_pylist()).encode() + repr(parquet.metadata).encode()
            for group in range(parquet.num_row_groups):
                content += repr(parquet.metadata.row_group(group).to_dict()).encode()
    patterns = [PERSON.encode(), str(MEASURE).encode(), np.float64(MEASURE).tobytes()]
    return any(pattern in content for pattern in patterns)
