"""Types of the GRASP taxonomy, told of simulated grasps whose kind is known."""

import numpy as np
import pytest
from typed_grasps import RIGHT, Told, told_types

from graspdb_ingest.taxonomy import LEAST_CONFIDENCE, TYPES

PRECISION = {"side_precision", "neck", "cap_top", "cap_side", "rim", "top"}


@pytest.fixture(scope="module")
def told() -> list[Told]:
    return list(told_types((0.178, 0.19), seed=8))


def test_types_are_right_about_as_often_as_their_confidence_says(told: list[Told]) -> None:
    named = [one for one in told if one.typed.name is not None]
    confidence = np.array([one.typed.confidence for one in named])
    right = np.array([one.right for one in named])
    print(f"\n{len(told)} grasps, {len(named)} told, {right.sum()} right, confidence {confidence.mean():.2f}")
    assert len(told) >= 28
    assert len(named) >= 0.6 * len(told)
    assert (confidence >= LEAST_CONFIDENCE).all()
    # no more sure than right, but for two standard errors of a share among so few
    assert right.mean() >= confidence.mean() - 2 * np.sqrt(0.25 / len(named))


def test_precision_is_never_called_power_or_the_other_way_round(told: list[Told]) -> None:
    manners = {kind.name: kind.manner for kind in TYPES}
    for one in told:
        if one.typed.name is not None:
            assert (manners[one.typed.name] == "precision") == (one.kind in PRECISION), one


def test_what_may_be_right_are_names_of_types() -> None:
    assert frozenset.union(*RIGHT.values()) <= {kind.name for kind in TYPES}
