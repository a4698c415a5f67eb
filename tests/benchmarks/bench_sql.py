"""Aggregates over a large database, against the same SQL on Parquet files written by hand."""

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import duckdb
import large_database
import numpy as np
import pyarrow as pa
from harness import Result, benchmark

import graspdb
from graspdb_queries.named import named_query

RUNS: Final = 15

AGGREGATES: Final = {
    "contact frequency": named_query("contact_frequency").sql,
    "digits by object": named_query("digits_used").sql,
    "hull volume by object": "SELECT object, count(*), avg(hull_volume), stddev_samp(hull_volume), "
    "quantile_cont(hull_volume, [0.05, 0.5, 0.95]) FROM grasps "
    "WHERE ($object IS NULL OR object = $object) AND ($subject IS NULL OR subject = $subject) "
    "GROUP BY object ORDER BY object",
    "gap by subject and digit, a join": "SELECT subject, digit, count(*), avg(c.gap), max(c.gap) "
    "FROM contacts c JOIN grasps g USING (grasp) "
    "WHERE ($object IS NULL OR object = $object) AND ($subject IS NULL OR subject = $subject) "
    "GROUP BY subject, digit ORDER BY subject, digit",
}
ALL: Final = {"object": None, "subject": None}


@dataclass(frozen=True)
class Spent:
    """What a run took: on the clock, and of the processor [s]."""

    clock: float
    processor: float


@benchmark("sql")
def sql() -> Sequence[Result]:
    """Time aggregates over 1,000,000 grasps and 8,000,000 contacts of 100,000 trials."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        large_database.build(folder)
        opened = _least([_spent(partial(_open, folder / "db")) for _ in range(3)])
        note = f"1,000,000 grasps, 8,000,000 contacts; of the processor {opened.processor:.3f} s"
        results = [Result("SQL: open a database of 100,000 trials", opened.clock, None, "s", note=note)]
        with graspdb.open(folder / "db") as database, duckdb.connect() as peer:
            for table in ("grasps", "contacts"):
                peer.execute(f"CREATE VIEW {table} AS FROM read_parquet('{folder / table}.parquet')")
            for title, statement in AGGREGATES.items():
                ours = partial(_ours, database, statement)
                results.append(_compare(title, ours, partial(_peer, peer, statement)))
    return results


def _compare(title: str, ours: Callable[[], pa.Table], peer: Callable[[], pa.Table]) -> Result:
    """Time the same SQL both ways, by turns, having checked that both give the same rows."""
    for mine, other in zip(ours().to_pylist(), peer().to_pylist(), strict=True):
        if not all(_same(mine[key], other[key]) for key in mine):
            raise AssertionError(f"{title}: {mine} is not {other}")
    runs = [(_spent(ours), _spent(peer)) for _ in range(RUNS)]
    mine, other = (_least(side) for side in zip(*runs, strict=True))
    return Result(
        f"SQL: {title}",
        mine.clock,
        other.clock,
        "s",
        note="at most 1 s, and 1.2 times the peer, one Parquet file a table; of the processor "
        f"{mine.processor:.3f} and {other.processor:.3f} s, {mine.processor / other.processor:.2f} times",
    )


def _open(path: Path) -> None:
    with graspdb.open(path) as database:
        database.sql("SELECT count(*) FROM grasps")


def _ours(database: graspdb.Database, statement: str) -> pa.Table:
    return database.sql(statement, **ALL).arrow()


def _peer(peer: duckdb.DuckDBPyConnection, statement: str) -> pa.Table:
    return peer.sql(statement, params=ALL).to_arrow_table()


def _same(a: Any, b: Any) -> bool:
    """Whether two values are equal; sums in another order differ in their last digits."""
    return bool(a == b or np.allclose(a, b, rtol=1e-9, atol=0))


def _spent(work: Callable[[], object]) -> Spent:
    """Do some work once."""
    clock, processor = time.perf_counter(), time.process_time()
    work()
    return Spent(time.perf_counter() - clock, time.process_time() - processor)


def _least(runs: Sequence[Spent]) -> Spent:
    """Return the least of each."""
    return Spent(min(run.clock for run in runs), min(run.processor for run in runs))
