"""A hand followed while it is recorded: one frame in, one estimate out, contacts included."""

import gc
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from graspdb_ingest.contact import signed_gaps
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats, HandModel
from graspdb_ingest.hand.posture import PosturePrior, default_prior
from graspdb_ingest.objects.pose import track_object
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import prepare_hand
from graspdb_ingest.prepared_object import PreparedObject, prepare_object
from graspdb_ingest.rigid import fit_rigid
from graspdb_ingest.tracking.following import make_follower
from graspdb_ingest.tracking.motion import MotionNoise, motion_model
from graspdb_schemas.errors import ParameterError, nearest
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import N_SITES, SITES, Side


@dataclass(frozen=True, eq=False)
class HandEstimate:
    """A hand in one frame, by this frame and those before it.

    Attributes
    ----------
    q : ndarray, shape (n_q,)
        Configuration; NaN while the hand is not known, as all that follows.
    q_sd : ndarray, shape (n_dof,)
        Standard deviation of each degree of freedom.
    sites : ndarray, shape (20, 3)
        Centres of the spheres in the lab frame [m].
    sites_sd : ndarray, shape (20,)
        Their standard deviations in space: the root mean square error to be expected [m].
    used : ndarray of bool, shape (n_markers,)
        Markers that were seen and passed the gate.
    gap : ndarray, shape (20,)
        Signed distance of each sphere to the object [m]; NaN where its pose is not known.
    threshold : float
        h of equation 3 [m].
    """

    q: Floats
    q_sd: Floats
    sites: Floats
    sites_sd: Floats
    used: Bools
    gap: Floats
    threshold: float

    @property
    def tracked(self) -> bool:
        """Whether the hand is known."""
        return bool(np.isfinite(self.q[0]))

    @property
    def contact_sites(self) -> tuple[str, ...]:
        """Names of the sites whose spheres touch the object."""
        return tuple(SITES[i] for i in np.flatnonzero(self.gap < self.threshold))


class HandTracker:
    """Follows one hand frame by frame, with the filter that first follows a recording forward.

    As a context manager it keeps a loop in time: linear algebra stays on one thread, which is faster
    for matrices of this size, and what is loaded by then is left out of garbage collection.

    Parameters
    ----------
    hand : HandModel
        The calibrated hand.
    rate : float
        Frames per second [Hz]; a frame that was lost on the way is passed as one without markers.
    thing : PreparedObject, optional
        The object whose contacts are wanted.
    prior : PosturePrior, optional
        Where joints usually are; that of any such hand unless given.
    noise : MotionNoise, optional
        Scales of movement and marker noise; those that the parameters assume unless given.
    parameters : IngestParameters, optional
        Gate and thresholds.
    marker_sd : ndarray, shape (n_markers,), optional
        Standard deviation that each marker has at the least, as calibration found it [m].

    Raises
    ------
    ParameterError
        If the rate is no rate.
    """

    def __init__(
        self,
        hand: HandModel,
        rate: float,
        thing: PreparedObject | None = None,
        prior: PosturePrior | None = None,
        noise: MotionNoise | None = None,
        parameters: IngestParameters | None = None,
        marker_sd: Floats | None = None,
    ) -> None:
        if not 1 <= rate <= 20_000:
            raise ParameterError("rate", rate, "1 to 20,000 Hz")
        self.hand = hand
        self.rate = rate
        self.thing = thing
        self._parameters = parameters or IngestParameters()
        self._prior = prior or default_prior(hand)
        self._noise = noise or MotionNoise.assumed(self._parameters.tracking)
        self._marker_sd = marker_sd
        self._radii = hand.radii
        self._limits: threadpool_limits | None = None
        self._kinematics = Kinematics(hand)
        self.restart()

    @classmethod
    def from_session(
        cls,
        session: str | Path,
        subject: str,
        rate: float,
        side: str | None = None,
        thing: str | None = None,
        parameters: IngestParameters | None = None,
    ) -> Self:
        """Return the tracker of a subject whose recordings are there already; this calibrates the hand.

        Parameters
        ----------
        session : path
            The session's folder or manifest.
        subject : str
            Name of the subject.
        rate : float
            Frames per second of the live markers [Hz].
        side : {'right', 'left'}, optional
            Which hand; needed where the subject has recorded both.
        thing : str, optional
            Name of the object.
        parameters : IngestParameters, optional
            Gate and thresholds.

        Raises
        ------
        ManifestError
            If the manifest does not describe a session.
        ParameterError
            If it has no such subject, hand or object.
        TrackingError, ObjectError
            If the hand cannot be calibrated, or the object has no usable surface.
        """
        described = parse_manifest(Path(session))
        parameters = parameters or IngestParameters()
        person = described.subjects[_one_of("subject", subject, tuple(described.subjects))]
        if side is None and len(person.sides) == 1:
            side = person.sides[0]
        which = Side(_one_of("side", side or "both", tuple(str(s) for s in person.sides)))
        prepared = None
        if thing is not None:
            name = _one_of("thing", thing, tuple(described.objects))
            prepared = prepare_object(described.objects[name], parameters)
        hand = prepare_hand(described, person, which, parameters.tracking)
        return cls(hand.hand, rate, prepared, hand.prior, hand.noise, parameters, hand.marker_sd)

    @property
    def marker_labels(self) -> tuple[str, ...]:
        """Labels of the hand's markers, in the order that `step` takes them."""
        return self.hand.markers

    def restart(self) -> None:
        """Forget the hand; the next frame that shows enough of it finds it anew."""
        tracking = self._parameters.tracking
        motion = motion_model(self.hand, self._prior, self._noise, 1 / self.rate)
        self._follower = make_follower(
            self._kinematics, motion, self._prior, tracking, self.rate, self._noise, self._marker_sd
        )

    def step(self, markers: Floats, object_markers: Floats | None = None) -> HandEstimate:
        """Take the next frame.

        Parameters
        ----------
        markers : ndarray, shape (n_markers, 3)
            Positions [m] in the order of `marker_labels`, NaN where not seen.
        object_markers : ndarray, shape (m, 3), optional
            Positions of the object's markers [m], in the order of ``thing.marker_labels``.

        Returns
        -------
        HandEstimate
            The hand in this frame; a finished value that later frames leave alone.

        Raises
        ------
        ParameterError
            If the shapes are not those.
        """
        observed = np.array(markers, dtype=float)
        if observed.shape != (len(self.hand.markers), 3):
            raise ParameterError(
                "markers", observed.shape, f"({len(self.hand.markers)}, 3), NaN where not seen"
            )
        observed[~np.isfinite(observed).all(axis=1)] = np.nan
        followed = self._follower.step(observed)
        if followed is None:
            return self._unknown(len(observed))
        state = followed.state
        self._kinematics.move(state.q)
        sites = self._kinematics.sites
        covariance = state.position_covariance
        jacobian = self._kinematics.site_jacobian().reshape(-1, len(covariance))
        variance = np.einsum("ij,ij->i", jacobian @ covariance, jacobian)
        return HandEstimate(
            q=state.q,
            q_sd=np.sqrt(np.diagonal(covariance)),
            sites=sites,
            sites_sd=np.sqrt(variance.reshape(N_SITES, 3).sum(axis=1)),
            used=followed.used,
            gap=self._gaps(sites, object_markers),
            threshold=self._parameters.contact.threshold,
        )

    def __enter__(self) -> Self:
        """Keep linear algebra on one thread, and what is loaded out of garbage collection."""
        self._limits = threadpool_limits(1)
        gc.collect()
        gc.freeze()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give both back."""
        gc.unfreeze()
        if self._limits is not None:
            self._limits.restore_original_limits()

    def _gaps(self, sites: Floats, object_markers: Floats | None) -> Floats:
        if self.thing is None or object_markers is None:
            return np.full(N_SITES, np.nan)
        rotation, position = self._pose(self.thing, np.array(object_markers, dtype=float))
        if not np.isfinite(position[0]):
            return np.full(N_SITES, np.nan)
        return signed_gaps((sites - position) @ rotation, self._radii, self.thing.cloud).gap

    def _pose(self, thing: PreparedObject, observed: NDArray[np.float64]) -> tuple[Floats, Floats]:
        """Return world_from_object of this frame; NaN where its markers do not fix it."""
        if observed.shape != (len(thing.marker_labels), 3):
            allowed = f"({len(thing.marker_labels)}, 3), NaN where not seen"
            raise ParameterError("object_markers", observed.shape, allowed)
        frame, model = observed[None], np.asarray(thing.marker_positions, dtype=np.float64)
        limits = self._parameters.pose
        seen = np.isfinite(frame).all(axis=2)
        fit = fit_rigid(model, frame, seen.astype(float), limits.minimum_spread)
        if np.all(fit.distances[seen] <= min(limits.outlier_distance, limits.maximum_residual)):
            return fit.rotations[0], fit.positions[0]
        track = track_object(frame, model, limits)  # which leaves out a marker that jumped
        return track.rotations[0], track.positions[0]

    def _unknown(self, n_markers: int) -> HandEstimate:
        return HandEstimate(
            q=np.full(self.hand.n_q, np.nan),
            q_sd=np.full(self.hand.n_dof, np.nan),
            sites=np.full((N_SITES, 3), np.nan),
            sites_sd=np.full(N_SITES, np.nan),
            used=np.zeros(n_markers, dtype=bool),
            gap=np.full(N_SITES, np.nan),
            threshold=self._parameters.contact.threshold,
        )


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        raise ParameterError(name, value, f"one of {', '.join(allowed) or 'none'}{nearest(value, allowed)}")
    return value
