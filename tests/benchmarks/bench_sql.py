"""Aggregates over a large database, against the same SQL on Parquet files written by hand."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from deltalake import WriterProperties, write_deltalake

from graspdb.store import Store
from graspdb_queries.named import named_query
from graspdb_schemas.tables import TABLES
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, SITES

N_TRIALS: Final = 100_000
GRASPS_PER_TRIAL: Final = 10
CONTACTS_PER_GRASP: Final = 8
TRIALS_PER_COMMIT: Final = 2000
SUBJECTS: Final = tuple(f"s{i}" for i in range(10))
OBJECTS: Final = tuple(f"object_{i:02}" for i in range(20))
PATTERNS: Final = 500
"""Different sets of touching sites; postures and other arrays come from as many that are drawn at random."""

AGGREGATES: Final = {
    "contact frequency": named_query("contact_frequency")
    .sql.replace("$object", "NULL")
    .replace("$subject", "NULL"),
    "digits by object": named_query("digits_used").sql.replace("$object", "NULL").replace("$subject", "NULL"),
    "hull volume by object": "SELECT object, count(*), avg(hull_volume), stddev_samp(hull_volume), "
    "quantile_cont(hull_volume, [0.05, 0.5, 0.95]) FROM grasps GROUP BY object ORDER BY object",
    "gap by digit and subject (join)": "SELECT subject, digit, count(*), avg(c.gap), max(c.gap) "
    "FROM contacts c JOIN grasps g USING (grasp) GROUP BY subject, digit ORDER BY subject, digit",
}


class Maker:
    """Makes the rows of commits, the same ones each time."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.rng = rng
        touching = [
            np.sort(rng.choice(len(SITES), CONTACTS_PER_GRASP, replace=False)) for _ in range(PATTERNS)
        ]
        self.touching = np.array(touching)
        self.sites = pa.array([[SITES[i] for i in sites] for sites in touching])
        self.digits = pa.array([list(dict.fromkeys(DIGIT_OF_SITE[i] for i in sites)) for sites in touching])
        self.q = pa.array(rng.normal(size=(PATTERNS, 30)).tolist())
        self.gaps = pa.array(rng.normal(size=(PATTERNS, 20)).tolist())
        self.points = pa.array(rng.normal(size=(PATTERNS, 3)).tolist())
        self.subjects = pa.array(SUBJECTS)
        self.objects = pa.array(OBJECTS)

    def commit(self, number: int) -> dict[str, pa.Table]:
        """Return the rows of the trials of one commit."""
        trials = np.arange(number * TRIALS_PER_COMMIT, (number + 1) * TRIALS_PER_COMMIT)
        subject, object_ = trials % len(SUBJECTS), trials // len(SUBJECTS) % len(OBJECTS)
        session = np.full(len(trials), number)
        keys = pa.array(
            [
                f"study-{s:02}/s{a}_{OBJECTS[o]}_{t:06}"
                for s, a, o, t in zip(session, subject, object_, trials, strict=True)
            ]
        )
        ids = pa.array(
            [f"{0x18EB294C22C49000 + 4096 * int(t):016x}-{int(t) * 2654435761 % 2**48:012x}" for t in trials]
        )
        grasp_trial = np.repeat(np.arange(len(trials)), GRASPS_PER_TRIAL)
        grasps = pa.array(
            [f"{keys[t]}/right/{i}" for t in range(len(trials)) for i in range(GRASPS_PER_TRIAL)]
        )
        n, pattern = len(grasps), self.rng.integers(PATTERNS, size=len(grasps))
        contact_grasp = np.repeat(np.arange(n), CONTACTS_PER_GRASP)
        touching = self.touching[pattern].ravel()
        sessions = pa.array([f"study-{s:02}" for s in session])
        context = pa.array(
            [
                [f"{0x18EB294C22C40000 + part:016x}-{s:012x}-{s * 97 + part:032x}" for part in range(4)]
                for s in session
            ]
        )
        columns: dict[str, dict[str, Any]] = {
            "trials": {
                "session": sessions,
                "trial": keys,
                "subject": self.subjects.take(pa.array(subject)),
                "object": self.objects.take(pa.array(object_)),
                "status": pa.repeat("ok", len(trials)),
                "n_grasps": pa.repeat(GRASPS_PER_TRIAL, len(trials)),
                "context": context,
                "table_rows": pa.array(
                    [[("grasps", GRASPS_PER_TRIAL), ("contacts", GRASPS_PER_TRIAL * CONTACTS_PER_GRASP)]]
                    * len(trials),
                    TABLES["trials"].field("table_rows").type,
                ),
                "ingest_id": ids,
            },
            "grasps": {
                "session": sessions.take(pa.array(grasp_trial)),
                "trial": keys.take(pa.array(grasp_trial)),
                "grasp": grasps,
                "side": pa.repeat("right", n),
                "subject": self.subjects.take(pa.array(subject[grasp_trial])),
                "object": self.objects.take(pa.array(object_[grasp_trial])),
                "digits": self.digits.take(pa.array(pattern)),
                "contact_sites": self.sites.take(pa.array(pattern)),
                "n_contacts": pa.repeat(CONTACTS_PER_GRASP, n),
                "q": self.q.take(pa.array(pattern)),
                "gap": self.gaps.take(pa.array(pattern)),
                "grip_aperture": self.rng.normal(0.06, 0.02, n),
                "hull_volume": self.rng.gamma(2, 1e-4, n),
                "feature_area": self.rng.gamma(2, 1e-3, n),
                "ingest_id": ids.take(pa.array(grasp_trial)),
            },
            "contacts": {
                "grasp": grasps.take(pa.array(contact_grasp)),
                "trial": keys.take(pa.array(grasp_trial[contact_grasp])),
                "site": pa.array(SITES).take(pa.array(touching)),
                "digit": pa.array(DIGIT_OF_SITE).take(pa.array(touching)),
                "point": self.rng.integers(20_000, size=len(touching)),
                "position": self.points.take(pa.array(self.rng.integers(PATTERNS, size=len(touching)))),
                "normal": self.points.take(pa.array(self.rng.integers(PATTERNS, size=len(touching)))),
                "gap": self.rng.normal(0, 0.002, len(touching)),
                "ingest_id": ids.take(pa.array(grasp_trial[contact_grasp])),
            },
        }
        return {name: _declared(name, given) for name, given in columns.items()}


def _declared(name: str, given: dict[str, Any]) -> pa.Table:
    """Return a table with all declared columns; those not given are null."""
    n = len(given["ingest_id"])
    schema = pa.schema([field.with_nullable(True) for field in TABLES[name]])
    columns = [pa.nulls(n, field.type) if field.name not in given else given[field.name] for field in schema]
    return pa.Table.from_arrays(
        [pa.array(c) if isinstance(c, np.ndarray) else c for c in columns], schema.names
    ).cast(schema)


def build(folder: Path) -> None:
    """Write the database, commit by commit, and the Parquet files beside it."""
    store = Store.create_or_open(folder / "db")
    maker = Maker()
    writers: dict[str, pq.ParquetWriter] = {}
    for number in range(N_TRIALS // TRIALS_PER_COMMIT):
        for name, rows in maker.commit(number).items():
            write_deltalake(
                str(store.path / name),
                rows.cast(TABLES[name]),
                mode="append",
                writer_properties=WriterProperties(compression="ZSTD", compression_level=3),
            )
            if name != "trials":
                if name not in writers:
                    writers[name] = pq.ParquetWriter(folder / f"{name}.parquet", rows.schema)
                writers[name].write_table(rows)
    for writer in writers.values():
        writer.close()
