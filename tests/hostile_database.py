"""A database whose names are what someone would write to run a script in a page, in every text there is."""

from pathlib import Path

from handmade import rows, session_tables, trial_tables

from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables

SCRIPT = "<script>alert(1)</script>"
IMAGE = '"><img src=x onerror=alert(2)>'
AMPERSAND = "a&amp;b </style> {{ 7 * 7 }}"


def build(path: Path) -> Path:
    """Create the database in a folder that is not there, and return it."""
    store = Store.create_or_open(path)
    store.commit_session(session_tables(subjects=[SCRIPT], objects=[IMAGE], size=0.01))
    hostile = trial_tables(1, subject=SCRIPT, object_=IMAGE, reasons=[SCRIPT], task=AMPERSAND)
    tables = dict(hostile.tables)
    described = {**tables["grasps"].to_pylist()[0], "task": AMPERSAND, "grasp_type": IMAGE}
    tables["grasps"] = rows("grasps", {key: v for key, v in described.items() if key != "ingest_id"})
    rejected = trial_tables(
        2, subject=SCRIPT, object_=IMAGE, status="rejected", reasons=[IMAGE], n_grasps=0, residual_rms=None
    )
    without = {
        name: table for name, table in rejected.tables.items() if name in ("trials", "markers", "frames")
    }
    store.commit_trials([TrialTables(tables), TrialTables(without)])
    return path
