"""Hidden markers against their prediction: the figure to trust without ground truth."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from graspdb_ingest.held_out import GapError, Pass, plan_passes
from graspdb_ingest.parameters import IngestParameters
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class MarkerError:
    """How well one marker is predicted while it is hidden.

    Attributes
    ----------
    subject : str
        The subject.
    side : Side
        The hand.
    marker : str
        The marker.
    n_gaps, n_lost : int
        Gaps in which it was hidden, and those in which the hand was lost.
    mean, median, worst : float
        Over the gaps' mean distances from the recorded to the predicted marker [m]; NaN without gaps.
    """

    subject: str
    side: Side
    marker: str
    n_gaps: int
    n_lost: int
    mean: float
    median: float
    worst: float


def held_out_errors(
    session: str | os.PathLike[str],
    *,
    seconds: float = 0.5,
    gaps: int = 30,
    seed: int = 0,
    workers: int = 1,
    data_root: str | os.PathLike[str] | None = None,
    parameters: IngestParameters | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[MarkerError, ...]:
    """Hide each marker of a session in random gaps and predict it from the rest.

    Parameters
    ----------
    session : path
        The session's folder, or its manifest.
    seconds : float
        Length of a gap [s].
    gaps : int
        Gaps for each marker of a hand.
    seed : int
        The same seed hides the same gaps.
    workers : int
        Processes that work side by side; the errors do not depend on it.
    data_root : path, optional
        Folder that the manifest's files are in; the session's own folder unless given.
    parameters : IngestParameters, optional
        Thresholds and models of ingest; the defaults unless given.
    progress : callable, optional
        Called after each pass with the number of passes.

    Returns
    -------
    tuple of MarkerError
        Subjects, hands and markers in the manifest's order.

    Raises
    ------
    ManifestError
        If the manifest does not describe a session.
    ParameterError
        If a gap is not longer than zero, or no recording has room for one.
    TrackingError
        If a hand cannot be calibrated or followed.
    """
    if not 0 < seconds <= 60:
        raise ParameterError("hold-out", seconds, "above zero, 60 s at the most")
    described = parse_manifest(Path(session), None if data_root is None else Path(data_root))
    passes = plan_passes(described, seconds, gaps, seed, parameters or IngestParameters())
    if not passes:
        raise ParameterError(
            "hold-out", seconds, "shorter: no marker of the session is seen for so long without a break"
        )
    found: list[GapError] = []
    running = Parallel(n_jobs=workers, return_as="generator")(delayed(Pass.run)(part) for part in passes)
    for errors in running:
        found.extend(errors)
        if progress is not None:
            progress(len(passes))
    hands = [(subject.name, side) for subject in described.subjects.values() for side in subject.sides]
    named = {(e.subject, e.side) for e in found}
    return tuple(
        _summary(name, side, marker, found)
        for name, side in hands
        if (name, side) in named
        for marker in described.markers
    )


def _summary(subject: str, side: Side, marker: str, found: list[GapError]) -> MarkerError:
    own = [e.error for e in found if (e.subject, e.side, e.marker) == (subject, side, marker)]
    errors = np.array([error for error in own if np.isfinite(error)])
    figures = (errors.mean(), np.median(errors), errors.max()) if len(errors) else (np.nan,) * 3
    return MarkerError(subject, side, marker, len(own), len(own) - len(errors), *map(float, figures))
