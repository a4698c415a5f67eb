"""A database of a million grasps, written as the store writes: Delta tables with committed trials."""

from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from deltalake import WriterProperties, write_deltalake
from numpy.typing import NDArray

from graspdb.store import Store
from graspdb_schemas.tables import TABLES
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, SITES

N_TRIALS: Final = 100_000
GRASPS_PER_TRIAL: Final = 10
CONTACTS_PER_GRASP: Final = 8
N_FILES: Final = 20
"""Files of each table, as compaction leaves them."""

N_SUBJECTS: Final = 10
N_OBJECTS: Final = 20
PATTERNS: Final = 500
"""Different sets of touching sites, postures and positions; every grasp has one of each."""

Indices = NDArray[np.int64]


def build(folder: Path) -> None:
    """Write the database into ``folder/db``, and one Parquet file a table beside it.

    The Parquet files have the same rows, columns and compression.
    """
    store = Store.create_or_open(folder / "db")
    zstd = WriterProperties(compression="ZSTD", compression_level=3)
    parts: dict[str, list[pa.Table]] = {"grasps": [], "contacts": []}
    rng = np.random.default_rng(0)
    for trials in np.array_split(np.arange(N_TRIALS), N_FILES):
        for name, rows in _rows(trials, rng).items():
            write_deltalake(str(store.path / name), rows, mode="append", writer_properties=zstd)
            if name in parts:
                parts[name].append(rows)
    for name, tables in parts.items():
        whole = pa.concat_tables(tables)
        pq.write_table(whole, folder / f"{name}.parquet", compression="zstd", compression_level=3)


def _rows(trials: Indices, rng: np.random.Generator) -> dict[str, pa.Table]:
    """Return the rows of some trials in the tables that have any."""
    subject, object_ = trials % N_SUBJECTS, trials // N_SUBJECTS % N_OBJECTS
    named = {
        "session": pa.array([f"study-{trial // 2000:02}" for trial in trials]),
        "trial": pa.array(
            [f"study-{t // 2000:02}/s{s}_object_{o:02}_{t:06}" for t, s, o in zip(trials, subject, object_)]  # noqa: B905
        ),
        "subject": pa.array([f"s{s}" for s in subject]),
        "object": pa.array([f"object_{o:02}" for o in object_]),
        "ingest_id": pa.array(
            [f"{2**60 + 4096 * t:016x}-{2654435761 * t % 2**48:012x}" for t in trials.tolist()]
        ),
    }
    grasps = _grasps(named, rng)
    contacts = _contacts(grasps, rng)
    return {"trials": _trials(named), "grasps": grasps.drop_columns("pattern"), "contacts": contacts}


def _trials(named: dict[str, pa.Array]) -> pa.Table:
    n = len(named["trial"])
    counts = [("grasps", GRASPS_PER_TRIAL), ("contacts", GRASPS_PER_TRIAL * CONTACTS_PER_GRASP)]
    context = [[f"{2**60 + part:016x}-{part:012x}-{part:032x}" for part in range(4)]] * n
    return _declared(
        "trials",
        {
            **named,
            "status": pa.repeat("ok", n),
            "n_grasps": pa.repeat(GRASPS_PER_TRIAL, n),
            "context": pa.array(context),
            "table_rows": pa.array([counts] * n, TABLES["trials"].field("table_rows").type),
        },
    )


def _grasps(named: dict[str, pa.Array], rng: np.random.Generator) -> pa.Table:
    """Return the grasps of trials, with the number of the pattern of each in a column of its own."""
    n_trials = len(named["trial"])
    place = pa.array(np.repeat(np.arange(n_trials), GRASPS_PER_TRIAL))
    n = len(place)
    pattern = rng.integers(PATTERNS, size=n)
    number = pa.array(np.tile(np.arange(GRASPS_PER_TRIAL), n_trials)).cast(pa.string())
    columns = {name: column.take(place) for name, column in named.items()}
    sites = [[SITES[i] for i in touching] for touching in _touching()]
    digits = [list(dict.fromkeys(DIGIT_OF_SITE[i] for i in touching)) for touching in _touching()]
    rows = _declared(
        "grasps",
        {
            **columns,
            "grasp": pc.binary_join_element_wise(columns["trial"], "right", number, "/"),
            "side": pa.repeat("right", n),
            "digits": pa.array(digits).take(pa.array(pattern)),
            "contact_sites": pa.array(sites).take(pa.array(pattern)),
            "n_contacts": pa.repeat(CONTACTS_PER_GRASP, n),
            "q": _arrays(30).take(pa.array(pattern)),
            "gap": _arrays(20).take(pa.array(pattern)),
            "grip_aperture": pa.array(rng.normal(0.06, 0.02, n)),
            "hull_volume": pa.array(rng.gamma(2, 1e-4, n)),
            "feature_area": pa.array(rng.gamma(2, 1e-3, n)),
        },
    )
    return rows.append_column("pattern", pa.array(pattern))


def _contacts(grasps: pa.Table, rng: np.random.Generator) -> pa.Table:
    place = pa.array(np.repeat(np.arange(len(grasps)), CONTACTS_PER_GRASP))
    n = len(place)
    site = pa.array(_touching()[grasps["pattern"].to_numpy()].ravel())
    return _declared(
        "contacts",
        {
            **{name: grasps[name].combine_chunks().take(place) for name in ("grasp", "trial", "ingest_id")},
            "site": pa.array(SITES).take(site),
            "digit": pa.array(DIGIT_OF_SITE).take(site),
            "point": pa.array(rng.integers(20_000, size=n)),
            "position": _arrays(3).take(pa.array(rng.integers(PATTERNS, size=n))),
            "normal": _arrays(3).take(pa.array(rng.integers(PATTERNS, size=n))),
            "gap": pa.array(rng.normal(0, 0.002, n)),
        },
    )


def _touching() -> Indices:
    """Return the sites that touch in each pattern, shape (PATTERNS, CONTACTS_PER_GRASP)."""
    rng = np.random.default_rng(1)
    chosen = [np.sort(rng.choice(len(SITES), CONTACTS_PER_GRASP, replace=False)) for _ in range(PATTERNS)]
    return np.array(chosen)


def _arrays(length: int) -> pa.Array:
    """Return lists of random numbers, one a pattern."""
    return pa.array(np.random.default_rng(length).normal(size=(PATTERNS, length)).tolist())


def _declared(name: str, given: dict[str, pa.Array]) -> pa.Table:
    """Return rows of a table; columns that are not given are null."""
    n = len(given["ingest_id"])
    columns = [
        given[field.name] if field.name in given else pa.nulls(n, field.type) for field in TABLES[name]
    ]
    return pa.Table.from_arrays(columns, TABLES[name].names).cast(TABLES[name])
