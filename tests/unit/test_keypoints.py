"""Static grasps from key points: the hand's size and pose come back, bad input is named."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandModel
from graspdb_ingest.keypoints import check_key_points, dimensions_of, object_from_hand
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import JOINT_ANGLES, Side


def key_points(hand: HandModel, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return key points of the hand in a posture and pose, and the pose of its palm."""
    rng = np.random.default_rng(seed)
    q = hand.neutral()
    q[:3] = rng.normal(size=3)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = rng.uniform(0, 0.6, len(JOINT_ANGLES))
    pose = hand.forward(q)
    segment = hand.segments.index("hand")
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotations[segment], pose.positions[segment]
    return np.vstack([pose.positions[segment], pose.sites]), matrix


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("seed", range(3))
def test_size_and_pose_come_back(hands: dict[Side, HandModel], side: Side, seed: int) -> None:
    points, expected = key_points(hands[side], seed)
    dimensions = dimensions_of(points[None])
    assert dimensions.hand_length == pytest.approx(0.19, abs=0.01)
    assert dimensions.hand_breadth == pytest.approx(0.084, abs=0.005)
    assert np.allclose(object_from_hand(points, dimensions, side), expected, atol=0.02)


def test_bad_key_points_are_named(hands: dict[Side, HandModel]) -> None:
    points, _ = key_points(hands[Side.RIGHT], 0)
    with pytest.raises(ParameterError, match="21 key points"):
        check_key_points(points[None, 1:], "grasp 7")
    with pytest.raises(ParameterError, match="in metres"):
        check_key_points(1000 * points[None], "grasp 7")
    broken = points.copy()
    broken[6] = np.nan
    with pytest.raises(ParameterError, match=r"grasp 7.index_pip"):
        check_key_points(broken[None], "grasp 7")
