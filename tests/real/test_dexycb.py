"""Real grasps of the data set DexYCB: contacts, enclosing space and feature of every one of them."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from dexycb import find_all

from graspdb_ingest.grasp_rows import Grasp

USUAL = {
    "005_tomato_soup_can": "rounded",
    "002_master_chef_can": "rounded",
    "036_wood_block": "flat",
    "004_sugar_box": "flat",
    "061_foam_brick": "edge",
    "040_large_marker": "handle",
    "037_scissors": "handle",
}
"""What most features of objects of a plain shape are: thick cans, boxes, a brick, a pen, scissors."""


@pytest.fixture(scope="module")
def grasps(shared_data: Path) -> list[tuple[str, Grasp]]:
    return [(prepared.name, grasp) for prepared, _, grasp in find_all(shared_data / "dexycb-grasps")]


def test_nearly_all_real_grasps_have_a_feature(grasps: list[tuple[str, Grasp]]) -> None:
    points = np.array([len(grasp.feature.points) for _, grasp in grasps])
    print(f"\n{np.sum(points >= 30)} of {len(points)} grasps have a feature of 30 points")
    assert len(points) == 428
    assert np.mean(points >= 30) >= 0.96


def test_every_grasp_has_an_enclosing_space_of_its_contacts(grasps: list[tuple[str, Grasp]]) -> None:
    for name, grasp in grasps:
        assert (grasp.space.volume > 0) == (len(grasp.contacts.sites) > 0), name
        # 64 vertices lie up to 1.3 mm inside a sphere of 13 mm between them; a sphere that is wholly
        # inside the object does not reach its nearest surface point
        gap, largest = grasp.contacts.gap, 0.013
        deep = grasp.contacts.positions[(gap < -0.0015) & (gap > -largest)]
        assert grasp.space.contains(deep).all(), name
        if grasp.inside is not None:
            assert 0 <= grasp.inside.volume <= grasp.space.volume * (1 + 1e-9), name


def test_the_mesh_inside_the_hull_is_as_large_as_its_points_say(grasps: list[tuple[str, Grasp]]) -> None:
    large = [g for _, g in grasps if g.inside is not None and len(g.feature.points) >= 300]
    ratios = [g.inside.area / g.feature.area for g in large if g.inside is not None]
    assert np.median(ratios) == pytest.approx(1, abs=0.005)
    assert np.quantile(np.abs(np.log(ratios)), 0.95) < 0.1


def test_features_of_plain_objects_are_what_they_look_like(grasps: list[tuple[str, Grasp]]) -> None:
    for name, expected in USUAL.items():
        found = Counter(grasp.shape.curvature_class for object_, grasp in grasps if object_ == name)
        assert found.most_common(1)[0][0] == expected, (name, found)


def test_people_hold_things_so_that_they_cannot_slip(grasps: list[tuple[str, Grasp]]) -> None:
    many = [grasp for _, grasp in grasps if len(grasp.contacts.digits) >= 3]
    assert len(many) > 250
    assert np.mean([grasp.quality.force_closure for grasp in many]) > 0.7
