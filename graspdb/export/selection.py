"""Which grasps, or which hands of which trials, an export is made of."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc

from graspdb.export.options import ExportOptions
from graspdb.export.split import TRAIN, VALID, is_one_sided, seed_with_both, sides
from graspdb_queries.engine import Engine
from graspdb_queries.similar.where import check_filter
from graspdb_schemas.errors import ParameterError, QueryError

_GROUP: Final = {"subject": "subject", "object": "object", "session": "session", "random": "trial"}
"""Column whose values no two sides of a split share."""

_GRASPS: Final = """
    SELECT g.grasp, g.trial, g.side, g.session, g.subject, g.object, g.task, g.grasp_type, g.snapshot_frame,
           g.ingest_id, t.rate, t.n_frames, t.data_set, t.data_set_version, t.licence
    FROM grasps AS g JOIN trials AS t ON t.trial = g.trial
"""

_EPISODES: Final = """
    SELECT trial, side, any_value(session) AS session, any_value(subject) AS subject,
           any_value(object) AS object, any_value(task) AS task,
           list(grasp ORDER BY snapshot_frame, grasp) AS grasps,
           list(grasp_type ORDER BY snapshot_frame, grasp) AS grasp_types,
           any_value(ingest_id) AS ingest_id, any_value(rate) AS rate, any_value(n_frames) AS n_frames,
           any_value(data_set) AS data_set, any_value(data_set_version) AS data_set_version,
           any_value(licence) AS licence
    FROM selected GROUP BY trial, side ORDER BY trial, side
"""

_FRAMES: Final = 100_000
"""Frames of a slice, if it has more than one row; a frame takes about a kilobyte while it is read."""


@dataclass(frozen=True)
class Slice:
    """Rows of a selection that are read and written together, all on one side of the split."""

    first: int
    split: str
    rows: pa.Table


@dataclass(frozen=True)
class Selection:
    """What an export is made of.

    Attributes
    ----------
    rows : pyarrow.Table
        One row a grasp, or a hand of a trial: keys, what is known of the trial, and ``split``; those to train
        with first, then by key.
    """

    rows: pa.Table

    def slices(self, size: int) -> Iterator[Slice]:
        """Yield slices of at most so many rows; of episodes, of so many frames that they fit into memory."""
        splits = self.rows["split"].to_pylist()
        frames = self.rows["n_frames"].to_pylist() if "grasps" in self.rows.column_names else []
        first = held = 0
        for row, split in enumerate(splits):
            held += frames[row] or 0 if frames else 0
            last = row + 1 == len(splits)
            full = row + 1 - first == size or (
                not last and frames and held + (frames[row + 1] or 0) > _FRAMES
            )
            if last or full or splits[row + 1] != split:
                yield Slice(first, split, self.rows.slice(first, row + 1 - first))
                first, held = row + 1, 0


def select(engine: Engine, options: ExportOptions, items: str) -> Selection:
    """Return what a query selects, with the side of the split of each row.

    Parameters
    ----------
    engine : Engine
        Answers from the database.
    options : ExportOptions
        `where`, `split` and `seed` count.
    items : {'episodes', 'grasps'}
        Whether a row is a hand of a trial, or a grasp.

    Raises
    ------
    QueryError
        The filter is not a boolean expression over the columns of `grasps`, or nothing is selected.
    ParameterError
        One side of the split would be empty.
    """
    if options.where is not None:
        check_filter(engine, options.where)
    chosen = (
        ""
        if options.where is None
        else f"WHERE g.grasp IN (SELECT grasp FROM grasps WHERE (\n{options.where}\n))"
    )
    grasps = f"{_GRASPS} {chosen}"
    if items == "episodes":
        rows = engine.sql(f"WITH selected AS ({grasps}) {_EPISODES}").table
    else:
        rows = engine.sql(f"{grasps} ORDER BY g.grasp").table
    if not rows.num_rows:
        asked = "the database has no grasps" if options.where is None else f"no grasp has {options.where}"
        raise QueryError(f"there is nothing to export: {asked}", "graspdb sql shows what there is.")
    return Selection(_split(rows, options))


def _split(rows: pa.Table, options: ExportOptions) -> pa.Table:
    """Return rows with their side of the split, in the order of the sides."""
    if options.split is None:
        return rows.append_column("split", pa.repeat("", rows.num_rows))
    groups = rows[_GROUP[options.split]].combine_chunks().dictionary_encode()
    names = groups.dictionary.to_pylist()
    if is_one_sided(names, options.seed):
        raise _one_sided(options, names)
    side = sides(names, options.seed)
    column = pa.array([side[name] for name in names]).take(groups.indices)
    whole = rows.append_column("split", column)
    return pa.concat_tables([whole.filter(pc.equal(column, name)) for name in (TRAIN, VALID)])


def _one_sided(options: ExportOptions, names: list[str]) -> ParameterError:
    found = f"{options.split} with seed {options.seed}, which leaves one side empty"
    if len(names) < 2:
        return ParameterError(
            "split", found, f"what has two values or more; here there is {names[0]!r} alone"
        )
    seed = seed_with_both(names)
    return ParameterError("split", found, f"such as seed {seed}" if seed is not None else "another split")
