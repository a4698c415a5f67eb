"""The hand model fitted to key points: each joint centre is a marker on the segment beyond it.

The tracker that follows markers on the skin follows these, too. Wrist and first joints are fixed to the
palm, the other joints lie in the origin of the segment beyond them, whatever its length, and the tips at
the end of the last segment. No data set has anything on the forearm, so wrist angles are those of the
posture prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from graspdb_ingest.columns import list_column, number_column, sparse_column
from graspdb_ingest.hand import HandDimensions, build_hand
from graspdb_ingest.hand.foreign import HandFile
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.one_thread import one_thread
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand, hand_from_sample
from graspdb_ingest.tracking.calibration import Calibration
from graspdb_ingest.tracking.fit import fit_frame
from graspdb_ingest.tracking.frame_choice import MINIMUM_FRAMES, sample_frames
from graspdb_ingest.tracking.motion import MotionNoise
from graspdb_ingest.tracking.posture_learning import LearnedPrior
from graspdb_ingest.tracking.tracker import track_hand
from graspdb_ingest.verdict import check_track
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import DIGITS, JOINTS_OF_DIGIT, KEY_POINTS, SEGMENTS_OF_DIGIT, SITES, Side

STATIC_DURATION: Final = 10.0
"""Static postures count as this far apart in time, so that each is one of its own [s]."""


@dataclass(frozen=True, eq=False)
class FittedHand:
    """A hand model fitted to key points in n frames.

    Attributes
    ----------
    q : ndarray, shape (n, 30)
        Configurations; NaN where there is none.
    key_points : ndarray, shape (n, 21, 3)
        Wrist and sites of the fitted hand [m].
    residuals : ndarray, shape (n, 21)
        Distance of each key point to its place on the hand [m].
    q_sd, sites_sd : ndarray, shapes (n, 29) and (n, 20), or None
        Standard deviations, in moving clips [m, rad].
    used : ndarray of bool, shape (n, 21)
        Key points that the fit used.
    """

    q: Floats
    key_points: Floats
    residuals: Floats
    used: Bools
    q_sd: Floats | None = None
    sites_sd: Floats | None = None

    @property
    def rms(self) -> float | None:
        """Root mean square distance of the used key points to the hand [m]."""
        squared = self.residuals[self.used] ** 2
        return float(np.sqrt(squared.mean())) if len(squared) else None

    def columns(self) -> Mapping[str, Any]:
        """Return the columns of `frames` that a fit fills."""
        squared = np.where(self.used, self.residuals**2, 0.0)
        counts = self.used.sum(axis=1)
        none = np.full(len(counts), np.nan)
        mean: Floats = np.divide(squared.sum(axis=1), counts, out=none, where=counts > 0)
        found: dict[str, Any] = {
            "q": list_column(self.q),
            "residual": number_column(np.sqrt(mean)),
            "marker_residuals": sparse_column(self.residuals),
            "n_markers": counts,
        }
        if self.q_sd is not None and self.sites_sd is not None:
            found |= {"q_sd": list_column(self.q_sd), "sites_sd": list_column(self.sites_sd)}
        return found


def measured_proportions(key_points: Floats, dimensions: HandDimensions) -> HandDimensions:
    """Return a hand's dimensions with the lengths of its own bones, as key points show them.

    Parameters
    ----------
    key_points : ndarray, shape (n, 21, 3)
        Key points of that hand [m].
    dimensions : HandDimensions
        Its size.
    """
    wrist, chains = key_points[:, 0], key_points[:, 1:].reshape(-1, 5, 4, 3)
    factors = {}
    for number, digit in enumerate(DIGITS):
        first = np.linalg.norm(chains[:, number, 0] - wrist, axis=1)
        bones = np.linalg.norm(np.diff(chains[:, number], axis=1), axis=2)
        seen = [float(np.median(first)), *np.median(bones, axis=0).tolist()]
        usual = [
            float(np.linalg.norm(dimensions.base_joint(digit, Side.RIGHT))),
            *dimensions.joint_distances(digit).tolist(),
        ]
        radius = float(dimensions.radii[SITES.index(f"{digit}_tip")])
        seen[3], usual[3] = seen[3] + radius, usual[3] + radius
        for joint, own, common in zip(JOINTS_OF_DIGIT[digit], seen, usual, strict=True):
            factors[f"{digit}_{joint}"] = float(np.clip(own / common, 0.5, 2.0))
    return HandDimensions(
        dimensions.hand_length, dimensions.hand_breadth, dimensions.joint_thickness, factors
    )


def key_point_markers(dimensions: HandDimensions, side: Side) -> dict[str, MarkerPlacement]:
    """Return where key points lie on the hand model, in the order of `KEY_POINTS`."""
    places = {"wrist": MarkerPlacement("hand", offset=(0.0, 0.0, 0.0))}
    for digit in DIGITS:
        base = dimensions.base_joint(digit, side)
        tip = (float(dimensions.joint_distances(digit)[2]), 0.0, 0.0)
        segments = SEGMENTS_OF_DIGIT[digit]
        joints = JOINTS_OF_DIGIT[digit]
        places[f"{digit}_{joints[0]}"] = MarkerPlacement(
            "hand", offset=(float(base[0]), float(base[1]), float(base[2]))
        )
        for joint, segment in zip(joints[1:3], segments[1:], strict=True):
            places[f"{digit}_{joint}"] = MarkerPlacement(segment, offset=(0.0, 0.0, 0.0))
        places[f"{digit}_{joints[3]}"] = MarkerPlacement(segments[2], offset=tip)
    return {name: places[name] for name in KEY_POINTS}


def hand_from_key_points(
    subject: str,
    side: Side,
    recordings: Sequence[tuple[Floats, float | None]],
    dimensions: HandDimensions,
    parameters: IngestParameters,
) -> PreparedHand:
    """Calibrate a hand model on key points.

    Parameters
    ----------
    subject, side
        Whose hand.
    recordings : sequence of tuple (ndarray of shape (n, 21, 3), float or None)
        Key points of that hand [m] with their rates [Hz], None for static postures.
    dimensions : HandDimensions
        Its size.
    parameters : IngestParameters
        Thresholds.

    Raises
    ------
    TrackingError
        If the frames do not show enough of the hand.
    """
    sample = sample_frames(points for points, _ in recordings)
    whole = sample[np.isfinite(sample).all(axis=(1, 2))]
    own = measured_proportions(whole, dimensions)
    places = key_point_markers(own, side)
    file = HandFile(build_hand(own, side, places), places)
    if len(whole) < MINIMUM_FRAMES:
        return _uncalibrated(subject, file, len(whole), parameters)
    duration = sum(
        len(points) * (STATIC_DURATION if rate is None else 1 / rate) for points, rate in recordings
    )
    moving = [(points, rate) for points, rate in recordings if rate is not None]
    return hand_from_sample(subject, file, sample, duration, moving, parameters.tracking)


def _uncalibrated(subject: str, file: HandFile, n_frames: int, parameters: IngestParameters) -> PreparedHand:
    """Return a hand with its own bones and the usual palm, from too few frames to calibrate it on."""
    default, n = default_prior(file.hand), len(file.hand.markers)
    unknown, sd = np.full(n, np.nan), np.full(n, parameters.tracking.marker_sd)
    note = f"{n_frames} frames are too few to calibrate on: bones as they show them, the palm as usual"
    return PreparedHand(
        subject=subject,
        hand=file.hand,
        prior=default,
        calibrated_markers=(),
        calibration=Calibration(file.hand, unknown, unknown, sd, {}, 0, (note,)),
        learned=LearnedPrior(default, 0, 0.0),
        noise=MotionNoise.assumed(parameters.tracking),
        marker_sd=np.hypot(sd, sd),
        notes=(note,),
    )


def fit_hand(
    hand: PreparedHand, key_points: Floats, rate: float | None, parameters: IngestParameters
) -> FittedHand:
    """Fit a hand to key points: by the tracker where they move, frame by frame where they do not.

    Parameters
    ----------
    hand : PreparedHand
        The hand.
    key_points : ndarray, shape (n, 21, 3)
        Key points [m], NaN where not known.
    rate : float or None
        Frames per second [Hz]; None for static postures.
    parameters : IngestParameters
        Thresholds.

    Raises
    ------
    TrackingError
        If the hand does not fit its key points.
    """
    with one_thread():
        if rate is None or len(key_points) < 2:
            return _fit_frames(hand, key_points)
        track = track_hand(
            hand.hand,
            key_points,
            rate,
            hand.prior,
            parameters.tracking,
            noise=hand.noise,
            marker_sd=hand.marker_sd,
        )
        check_track(track, hand.hand, key_points, hand.prior, hand.hand.side, parameters.tracking)
    wrists = _wrists(hand, track.q)
    points = np.concatenate([wrists[:, None], track.sites], axis=1)
    residuals = np.asarray(np.linalg.norm(track.residuals, axis=2))
    return FittedHand(track.q, points, residuals, track.used, track.q_sd, track.sites_sd)


def _fit_frames(hand: PreparedHand, key_points: Floats) -> FittedHand:
    """Fit each frame for itself, from where the one before was or from nowhere."""
    kinematics, n = Kinematics(hand.hand), len(key_points)
    q = np.full((n, kinematics.model.nq), np.nan)
    points = np.full(key_points.shape, np.nan)
    residuals = np.full(key_points.shape[:2], np.nan)
    for frame in np.flatnonzero(np.isfinite(key_points).all(axis=(1, 2))):
        observed = key_points[frame]
        found = fit_frame(kinematics, observed, hand.prior, hand.marker_sd)
        q[frame] = found.q
        kinematics.move(found.q)
        points[frame, 1:] = kinematics.sites
        residuals[frame] = np.linalg.norm(found.residuals, axis=1)
    points[:, 0] = _wrists(hand, q)
    return FittedHand(q, points, residuals, np.isfinite(residuals))


def _wrists(hand: PreparedHand, q: Floats) -> Floats:
    """Return the palm's origin, the wrist, in every frame [m], shape (n, 3)."""
    wrists = np.full((len(q), 3), np.nan)
    known = np.isfinite(q[:, 0])
    wrists[known] = hand.hand.palms(q[known])[0]
    return wrists
