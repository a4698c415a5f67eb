"""A trial as the store commits it: its own rows, and the shared rows that it stands on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pyarrow as pa

from graspdb.store.content import Unit, content_key, units
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.tables import TRIAL_TABLES


@dataclass(frozen=True)
class Trial:
    """One trial, checked.

    Attributes
    ----------
    key, session, input_key : str
        Columns ``trial``, ``session`` and ``input_key`` of its row.
    row : pyarrow.Table
        Its row in `trials`.
    tables : mapping of str to pyarrow.Table
        Its rows in the other tables; tables without rows are left out.
    units : tuple of Unit
        The session-level rows it stands on.
    hashes : mapping of str to str
        Content keys of its row in `trials` and of its rows in the other tables.
    """

    key: str
    session: str
    input_key: str
    row: pa.Table
    tables: Mapping[str, pa.Table]
    units: tuple[Unit, ...]
    hashes: Mapping[str, str]


def as_trial(rows: TrialTables, shared: Mapping[str, Sequence[Unit]]) -> Trial:
    """Check the rows of a trial and find what it stands on.

    Parameters
    ----------
    rows : TrialTables
        Its rows, with the session-level rows it stands on or without.
    shared : mapping of str to sequence of Unit
        Session-level rows by session, for what the trial brings none of.

    Raises
    ------
    ParameterError
        There is not one row in `trials`, it has no input_key, or a row belongs to another trial.
    """
    row = rows.tables.get("trials")
    if row is None or row.num_rows != 1:
        raise ParameterError("trials", "none" if row is None else f"{row.num_rows} rows", "exactly one row")
    values = row.to_pylist()[0]
    if values["input_key"] is None:
        raise ParameterError("trials.input_key", None, "a text that stands for everything that was read")
    own = {name: rows.tables[name] for name in TRIAL_TABLES if name in rows.tables}
    tables = {name: table for name, table in own.items() if table.num_rows}
    for name, table in tables.items():
        strangers = [key for key in table["trial"].unique().to_pylist() if key != values["trial"]]
        if strangers:
            raise ParameterError(f"{name}.trial", strangers[0], repr(values["trial"]))
    own_units = list(units(rows.tables))
    described = [unit.describes for unit in own_units]
    candidates = own_units + [u for u in shared.get(values["session"], ()) if u.describes not in described]
    return Trial(
        key=values["trial"],
        session=values["session"],
        input_key=values["input_key"],
        row=row,
        tables=tables,
        units=tuple(unit for unit in candidates if unit.belongs_to(values)),
        hashes={name: content_key({name: table}) for name, table in {"trials": row, **tables}.items()},
    )
