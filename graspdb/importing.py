"""From a public data set on disk to committed rows: clips that are new are read, followed and committed."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final

from graspdb.engines import Engine, EngineName, make_engine
from graspdb.ingestion import IngestReport, Progress, TrialReport, trial_report
from graspdb.store import Outcome, Store
from graspdb_ingest.importers.base import ClipSource, ImportOptions, ObjectSource
from graspdb_ingest.importers.clip import ImportJob, process_clip
from graspdb_ingest.importers.import_key import object_key
from graspdb_ingest.importers.objects import prepare_source
from graspdb_ingest.importers.options import check_options
from graspdb_ingest.importers.registry import importer, with_suggestion
from graspdb_ingest.importers.session import imported_session_rows
from graspdb_ingest.importers.survey import SurveyedSubject, survey
from graspdb_ingest.input_key import input_key
from graspdb_ingest.one_thread import one_thread
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import GraspDBError, ImportSourceError, ParameterError

CLIPS_PER_COMMIT: Final = 16
"""Clips of one object that are processed and committed together."""


def import_data_set(
    form: str,
    path: str | os.PathLike[str],
    db: str | os.PathLike[str] = "grasps",
    *,
    options: ImportOptions | None = None,
    fit: bool = False,
    workers: int | None = None,
    force: bool = False,
    parameters: IngestParameters | None = None,
    progress: Progress | None = None,
) -> IngestReport:
    """Import a data set into a database; clips that are in it unchanged are skipped.

    Parameters
    ----------
    form : str
        Name of the format; ``graspdb import --list`` tells which there are.
    path : path
        The data set's folder, or a file of it.
    db : path
        The database's folder, or its URL in object storage; made where there is none.
    options : ImportOptions, optional
        What the files do not say.
    fit : bool
        Whether to fit the hand model to the key points, so that rows have joint angles.
    workers : int, optional
        Processes that read and follow clips side by side; as many as there are cores unless given. The rows
        do not depend on it.
    force : bool
        Whether to import unchanged clips too, and replace their rows.
    parameters : IngestParameters, optional
        Thresholds and models; the defaults unless given.
    progress : callable, optional
        Told of every clip.

    Returns
    -------
    IngestReport
        What became of each clip.

    Raises
    ------
    ParameterError
        If there is no such format, an option is not allowed, or two clips have one name.
    ImportSourceError
        If the path is not that data set, or files are missing.
    DatabaseError
        If the folder is no database, or cannot be written.
    """
    chosen = importer(form)
    options = options or ImportOptions()
    check_options(options)
    job = ImportJob(chosen, options, parameters or IngestParameters(), fit)
    try:
        sources = list(chosen.find(Path(path), job.options))
        if not sources:
            raise ImportSourceError(Path(path), "it holds no clip", "Check the path.")
    except ImportSourceError as error:
        raise with_suggestion(error, Path(path), chosen) from error
    _refuse_twice(sources)
    store = Store.create_or_open(db)
    todo, reports = _to_do(job, sources, store, force)
    with make_engine(EngineName.LOCAL, workers, at_most=-(-len(todo) // CLIPS_PER_COMMIT)) as engine:
        subjects = _survey(engine, job, sources, todo)
        for batch in _processed(engine, job, todo, subjects):
            store.commit_session(batch.session)
            for rows, done in zip(batch.clips, store.commit_trials(batch.clips, force=force), strict=True):
                reports.append(trial_report(rows, done.outcome))
                if progress is not None:
                    progress(reports[-1], len(todo))
    return IngestReport(job.session, store.path, tuple(reports))


def _refuse_twice(sources: Sequence[ClipSource]) -> None:
    seen: set[str] = set()
    for source in sources:
        if source.name in seen or "/" in source.name:
            raise ParameterError("clip", source.name, "a name of its own for each clip, without a slash")
        seen.add(source.name)


def _to_do(
    job: ImportJob, sources: Sequence[ClipSource], store: Store, force: bool
) -> tuple[list[ClipSource], list[TrialReport]]:
    known = {} if force else store.committed_input_keys(job.session)
    todo, unchanged = [], []
    for source in sources:
        trial = f"{job.session}/{source.name}"
        if trial in known and known[trial] == input_key(job.inputs(source)):
            unchanged.append(TrialReport(trial, Outcome.UNCHANGED, None, (), None))
        else:
            todo.append(source)
    return todo, unchanged


def _survey(
    engine: Engine, job: ImportJob, sources: Sequence[ClipSource], todo: Sequence[ClipSource]
) -> Mapping[str, SurveyedSubject]:
    """Measure the hands of every subject that there is something to do of, on all its clips."""
    clips: dict[str, list[ClipSource]] = {source.subject: [] for source in todo}
    for source in sources:
        if source.subject in clips:
            clips[source.subject].append(source)
    calls = ((name, own, job.importer, job.options, job.parameters, job.fit) for name, own in clips.items())
    return {subject.name: subject for done in engine.run(survey, calls) for subject in done}


@dataclass(frozen=True)
class _Batch:
    """Rows of some clips with one object, and those that they stand on."""

    session: TrialTables
    clips: list[TrialTables]


def _processed(
    engine: Engine, job: ImportJob, todo: Sequence[ClipSource], subjects: Mapping[str, SurveyedSubject]
) -> Iterator[_Batch]:
    """Yield clips, object by object, as they are done."""
    by_object: dict[str, list[ClipSource]] = {}
    for source in todo:
        by_object.setdefault("" if source.object is None else source.object.name, []).append(source)
    calls = (
        (job, batch, {s.subject: subjects[s.subject] for s in batch})
        for clips in by_object.values()
        for start in range(0, len(clips), CLIPS_PER_COMMIT)
        if (batch := clips[start : start + CLIPS_PER_COMMIT])
    )
    for done in engine.run(_process, calls):
        yield from done


def _process(
    job: ImportJob, sources: Sequence[ClipSource], subjects: Mapping[str, SurveyedSubject]
) -> _Batch:
    """Process some clips of one object, in whatever process this is."""
    source, thing = sources[0].object, None
    with one_thread():
        if source is not None:
            thing = _object(_Described(object_key(source, job.parameters), source, job.parameters))
        good = None if source is None or not isinstance(thing, PreparedObject) else (source, thing)
        clips = [process_clip(job, clip, subjects[clip.subject], thing) for clip in sources]
        return _Batch(imported_session_rows(job.session, list(subjects.values()), good), clips)


@dataclass(frozen=True)
class _Described:
    """An object to prepare, told apart by the digest of all that decides what comes out."""

    digest: str
    source: ObjectSource = field(compare=False)
    parameters: IngestParameters = field(compare=False)


@lru_cache(maxsize=2)
def _object(described: _Described) -> PreparedObject | str:
    """Prepare an object, once for batches in a row; or say why it cannot be had."""
    try:
        return prepare_source(described.source, described.parameters)
    except GraspDBError as error:
        return f"object {described.source.name}: {error}"
