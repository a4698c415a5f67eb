"""Which rows an export may carry, by the licence notes of the data sets that they come from."""

import re
from collections.abc import Mapping, Sequence

from graspdb.kept_trials import keep_trials
from graspdb_queries.engine import Engine
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import ParameterError


def refused(licence: str, texts: Sequence[str]) -> bool:
    """Whether a licence note has one of some texts in it, as whole words, in either case."""
    return any(re.search(rf"(?<!\w){re.escape(text)}(?!\w)", licence, re.IGNORECASE) for text in texts)


def without_licences(
    engine: Engine, sources: Mapping[str, TableSource], texts: Sequence[str]
) -> dict[str, TableSource]:
    """Return the sources of a database without the rows of trials under some licences.

    Session-level rows stay as far as a trial that stays stands on them. Own recordings have no licence
    note, and stay.

    Parameters
    ----------
    engine : Engine
        Answers from the whole database.
    sources : mapping of str to TableSource
        Files and rows of each table.
    texts : sequence of str
        Texts that no licence note may have in it, such as ``NC``.

    Raises
    ------
    ParameterError
        If a text is empty.
    """
    if not all(text.strip() for text in texts):
        raise ParameterError("refuse_licence", "an empty text", "a part of a licence note, such as 'NC'")
    rows = engine.sql("SELECT ingest_id, context, licence FROM trials", {}).rows()
    return keep_trials(
        sources,
        [
            (ingest_id, context)
            for ingest_id, context, note in rows
            if note is None or not refused(note, texts)
        ],
    )
