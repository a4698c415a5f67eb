"""What a report on a session says, as data."""

from dataclasses import dataclass
from typing import Any

from graspdb.database import Database
from graspdb.report.density import ObjectDensity, contact_densities
from graspdb.report.quality import Quality, read_quality
from graspdb.report.timelines import Timeline, read_timelines
from graspdb.validation.contacts import ContactError, contact_errors


@dataclass(frozen=True)
class Subject:
    """A subject of the session, and what came of the recordings.

    Attributes
    ----------
    subject : str
        Name.
    hand : str or None
        right, left or both.
    hand_length, hand_breadth : float or None
        Of the hand [m].
    calibration : float or None
        Rms distance of markers to the calibrated hand, the worse of two hands [m].
    n_trials, n_rejected, n_grasps : int
        Trials, those of them that were rejected, and grasps found.
    """

    subject: str | None
    hand: str | None
    hand_length: float | None
    hand_breadth: float | None
    calibration: float | None
    n_trials: int
    n_rejected: int
    n_grasps: int


@dataclass(frozen=True)
class Object:
    """An object of the session, and what came of the recordings.

    Attributes
    ----------
    object : str
        Name.
    category : str or None
        As the manifest says.
    mass : float or None
        [kg]
    extents : tuple of float
        Along the mesh's axes [m].
    watertight : bool or None
        Whether its mesh is closed.
    warnings : tuple of str
        What was wrong with its mesh.
    n_trials, n_rejected, n_grasps : int
        Trials, those of them that were rejected, and grasps found.
    """

    object: str | None
    category: str | None
    mass: float | None
    extents: tuple[float, ...]
    watertight: bool | None
    warnings: tuple[str, ...]
    n_trials: int
    n_rejected: int
    n_grasps: int


@dataclass(frozen=True)
class GraspEntry:
    """A grasp as the grid of snapshots has it.

    Attributes
    ----------
    grasp, trial : str
        Keys.
    subject, object, task : str or None
        Who, what, for what.
    repetition : int or None
        Which time.
    side : str
        right or left.
    digits : tuple of str
        Digits in contact.
    grasp_type : str or None
        Type of the GRASP taxonomy.
    hull_volume : float or None
        Volume of the enclosing space [m3].
    """

    grasp: str
    trial: str
    subject: str | None
    object: str | None
    task: str | None
    repetition: int | None
    side: str
    digits: tuple[str, ...]
    grasp_type: str | None
    hull_volume: float | None


@dataclass(frozen=True)
class Synergies:
    """Principal components of the joint angles of the session's grasps.

    Attributes
    ----------
    explained : tuple of float
        Share of the variance, by component.
    places : tuple of (str, str, float, float)
        Of each grasp: key, object, score on the first component and on the second [rad].
    """

    explained: tuple[float, ...]
    places: tuple[tuple[str, str, float, float], ...]


@dataclass(frozen=True)
class SessionReport:
    """All that a report on a session says.

    Attributes
    ----------
    session : str
        The session.
    duration : float
        Length of all trials together [s].
    versions : tuple of str
        Versions of graspdb that wrote it.
    sources : tuple of str
        Data set, its version and licence, of imported trials.
    tasks : tuple of str
        Tasks, in the order of their names.
    subjects, objects, grasps, timelines, densities, table_1 : tuple
        What the session consists of and what came of it; `table_1` is empty without measured contacts.
    quality : Quality
        How good the recordings are.
    synergies : Synergies or None
        None for fewer than three grasps.
    """

    session: str
    duration: float
    versions: tuple[str, ...]
    sources: tuple[str, ...]
    tasks: tuple[str, ...]
    subjects: tuple[Subject, ...]
    objects: tuple[Object, ...]
    grasps: tuple[GraspEntry, ...]
    timelines: tuple[Timeline, ...]
    densities: tuple[ObjectDensity, ...]
    table_1: tuple[ContactError, ...]
    quality: Quality
    synergies: Synergies | None


def read_report(database: Database, session: str) -> SessionReport:
    """Return the report on a session.

    Raises
    ------
    QueryError
        There is no such session.
    """
    with database.session(session) as part:
        about = part.sql(_ABOUT).table.to_pylist()[0]
        grasps = tuple(GraspEntry(**_tuples(row)) for row in part.sql(_GRASPS).table.to_pylist())
        measured = len(part.query("contact_errors"))
        return SessionReport(
            session=session,
            **_tuples(about),
            subjects=tuple(Subject(**row) for row in part.sql(_SUBJECTS).table.to_pylist()),
            objects=tuple(Object(**_tuples(row)) for row in part.sql(_OBJECTS).table.to_pylist()),
            grasps=grasps,
            timelines=read_timelines(part),
            densities=contact_densities(part),
            table_1=contact_errors(part) if measured else (),
            quality=read_quality(part),
            synergies=_synergies(part, len(grasps)),
        )


def _tuples(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with tuples for lists."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}


_FEWEST_GRASPS = 3


def _synergies(part: Database, n_grasps: int) -> Synergies | None:
    """Return the synergies of the session's grasps; None where there are too few to have any."""
    if n_grasps < _FEWEST_GRASPS:
        return None
    explained = part.query("synergies").table["explained"].to_pylist()
    places = part.query("synergy_space", components=2).table
    rows = places.select(["grasp", "object", "score_1", "score_2"]).to_pylist()
    known = [tuple(row.values()) for row in rows if row["score_2"] is not None]
    return Synergies(tuple(explained), tuple(known)) if len(known) >= _FEWEST_GRASPS else None


_ABOUT = """
    SELECT
        coalesce(sum(duration), 0) AS duration,
        list_sort(list_distinct(list(software_version))) AS versions,
        list_sort(coalesce(list_distinct(list(
            concat_ws(', ', data_set || coalesce(' ' || data_set_version, ''), licence)
        ) FILTER (data_set IS NOT NULL)), [])) AS sources,
        list_sort(coalesce(list_distinct(list(task)), [])) AS tasks
    FROM trials
"""

_COUNTS = """
    count(*) AS n_trials,
    count(*) FILTER (status = 'rejected') AS n_rejected,
    coalesce(sum(n_grasps), 0)::BIGINT AS n_grasps
"""

_SUBJECTS = f"""
    WITH counts AS (SELECT subject, {_COUNTS} FROM trials GROUP BY subject),
    described AS (
        SELECT DISTINCT ON (subject) subject, hand, hand_length, hand_breadth
        FROM subjects ORDER BY subject, ingest_id DESC
    ),
    calibrated AS (SELECT subject, max(residual) AS calibration FROM hands GROUP BY subject)
    SELECT subject, hand, hand_length, hand_breadth, calibration, n_trials, n_rejected, n_grasps
    FROM counts LEFT JOIN described USING (subject) LEFT JOIN calibrated USING (subject)
    ORDER BY subject
"""

_OBJECTS = f"""
    WITH counts AS (SELECT object, {_COUNTS} FROM trials GROUP BY object),
    described AS (
        SELECT DISTINCT ON (object) object, category, mass, extents, watertight, warnings
        FROM objects ORDER BY object, ingest_id DESC
    )
    SELECT object, category, mass, coalesce(extents, []) AS extents, watertight,
           coalesce(warnings, []) AS warnings, n_trials, n_rejected, n_grasps
    FROM counts LEFT JOIN described USING (object)
    ORDER BY object
"""

_GRASPS = """
    SELECT grasp, trial, subject, object, task, repetition, side, coalesce(digits, []) AS digits,
           grasp_type, hull_volume
    FROM grasps
    ORDER BY object, subject, repetition, onset_time, grasp
"""
