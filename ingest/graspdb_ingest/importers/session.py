"""Rows that imported clips stand on: their session, subjects, hands and objects."""

from collections.abc import Sequence
from typing import Any

import pyarrow as pa

from graspdb_ingest.importers.base import ObjectSource
from graspdb_ingest.importers.survey import SurveyedSubject
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.session_rows import hand_rows, object_point_rows, object_row
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.conform import rows_schema


def imported_session_rows(
    session: str,
    subjects: Sequence[SurveyedSubject],
    thing: tuple[ObjectSource, PreparedObject] | None,
) -> TrialTables:
    """Return the rows that clips with one object, or with none, stand on.

    Parameters
    ----------
    session : str
        Identifier of the session.
    subjects : sequence of SurveyedSubject
        Whose clips they are.
    thing : tuple of ObjectSource and PreparedObject, or None
        Their object.
    """
    tables = {
        "sessions": _table("sessions", [{"session": session}]),
        "subjects": _table("subjects", [_subject(session, subject) for subject in subjects]),
        "hands": pa.concat_tables([_hands(session, subject) for subject in subjects]),
    }
    if thing is not None:
        source, prepared = thing
        tables["objects"] = object_row(session, prepared, source.category, source.mass)
        tables["object_points"] = object_point_rows(session, prepared)
    return TrialTables(tables)


def _subject(session: str, subject: SurveyedSubject) -> dict[str, Any]:
    size = subject.dimensions
    return {
        "session": session,
        "subject": subject.name,
        "hand": "both" if len(subject.sides) == 2 else str(subject.sides[0]) if subject.sides else None,
        "hand_length": None if size is None else size.hand_length,
        "hand_breadth": None if size is None else size.hand_breadth,
        "joint_thickness": [] if size is None else list(size.joint_thickness.items()),
    }


def _hands(session: str, subject: SurveyedSubject) -> pa.Table:
    """Return a row a hand: its radii, and all that calibration found where a model was fitted."""
    if subject.models:
        return hand_rows(session, list(subject.models.values()))
    if subject.dimensions is None:
        return _table("hands", [])
    radii = subject.dimensions.radii.tolist()
    common = {"session": session, "subject": subject.name, "radii": radii}
    return _table("hands", [common | {"side": str(side)} for side in subject.sides])


def _table(name: str, rows: list[dict[str, Any]]) -> pa.Table:
    return pa.Table.from_pylist(rows, rows_schema(name))
