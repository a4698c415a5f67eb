"""The hand of a grasp as an articulated model: the tracked one, or one fitted to its sites."""

from dataclasses import dataclass, replace

import numpy as np

from graspdb.export.held import HeldObject
from graspdb.export.items import Floats
from graspdb_ingest.hand import HandModel
from graspdb_ingest.hand.model import MARKER_PREFIX, HandShape
from graspdb_ingest.importers.fit import fit_hand, hand_from_key_points
from graspdb_ingest.keypoints import check_key_points, dimensions_of
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.rigid import quaternions_from_rotations
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.vocabulary import DIGITS, SEGMENTS_OF_DIGIT, SITES, Side


@dataclass(frozen=True, eq=False)
class PosedHand:
    """A hand model in the posture of a grasp.

    Attributes
    ----------
    model : HandModel
        The hand.
    q : ndarray, shape (n_q,)
        Its configuration, with the forearm in the object frame [m, 1, rad].
    residual : float or None
        Root mean square distance of the fitted hand to the grasp's sites and wrist [m]; None for the hand
        that was tracked, which has its sites where the database has them.
    """

    model: HandModel
    q: Floats
    residual: float | None


def posed_hand(held: HeldObject) -> PosedHand | None:
    """Return the hand of a grasp, or None where neither joint angles nor all sites are known.

    Imported grasps have sites and no angles, unless they were fitted at import. A hand with the bones and
    the palm of those very sites is fitted to them here; its forearm is as the posture prior has it, since
    nothing was seen of it.
    """
    grasp = held.grasp
    if held.hand_mjcf is not None and len(grasp.q) and np.isfinite(grasp.q).all():
        model = HandModel(Side(grasp.side), held.hand_mjcf, ())
        return PosedHand(model, _in_object_frame(held, model), None)
    key_points = np.vstack([held.wrist[None], grasp.sites])
    try:
        check_key_points(key_points[None], grasp.id)
    except GraspDBError:
        return None
    return _fitted(held, key_points)


def moved(q: Floats, target_from_source: Floats) -> Floats:
    """Return a configuration in another frame.

    Parameters
    ----------
    q : ndarray, shape (n_q,)
        Configuration in the source frame.
    target_from_source : ndarray, shape (4, 4)
        The rigid transform.
    """
    turned = np.array(q, dtype=float)
    turned[:3] = target_from_source[:3, :3] @ q[:3] + target_from_source[:3, 3]
    turned[3:7] = _product(quaternions_from_rotations(target_from_source[None, :3, :3])[0], q[3:7])
    return turned


def _in_object_frame(held: HeldObject, model: HandModel) -> Floats:
    """Return the stored configuration, which is one of the lab frame, in the object frame."""
    position, rotation = model.palm(held.grasp.q)
    object_from_world = np.eye(4)
    object_from_world[:3, :3] = held.grasp.object_from_hand[:3, :3] @ rotation.T
    object_from_world[:3, 3] = held.wrist - object_from_world[:3, :3] @ position
    return moved(held.grasp.q, object_from_world)


def _fitted(held: HeldObject, key_points: Floats) -> PosedHand:
    grasp, parameters = held.grasp, IngestParameters()
    dimensions = dimensions_of(key_points[None])
    prepared = hand_from_key_points(
        grasp.subject, Side(grasp.side), [(key_points[None], None)], dimensions, parameters
    )
    prepared = replace(prepared, hand=_with_palm(prepared.hand, held))
    fit = fit_hand(prepared, key_points[None], None, parameters)
    return PosedHand(prepared.hand, fit.q[0], fit.rms)


def _with_palm(hand: HandModel, held: HeldObject) -> HandModel:
    """Return a hand whose digits begin where the grasp's sites say, in the frame of its hand segment."""
    rotation = held.grasp.object_from_hand[:3, :3]
    in_hand = (held.grasp.sites - held.wrist) @ rotation
    bodies, sites = {}, {}
    for i, digit in enumerate(DIGITS):
        bodies[SEGMENTS_OF_DIGIT[digit][0]] = in_hand[4 * i]
        for name in (SITES[4 * i], MARKER_PREFIX + SITES[4 * i]):
            sites[name] = in_hand[4 * i]
    return hand.reshaped(HandShape(bodies, {}, sites))


def _product(a: Floats, b: Floats) -> Floats:
    """Return the product of two quaternions, w x y z."""
    w = a[0] * b[0] - a[1:] @ b[1:]
    xyz = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([w, *xyz])
