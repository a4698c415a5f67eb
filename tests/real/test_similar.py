"""Features of real grasps find the object that they are of: a third of the data set, through the store."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from retrieval import build, distances, distances_by_others, gallery, perturbed, same_object

import graspdb


@pytest.fixture(scope="module")
def database(shared_data: Path, tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("dexycb") / "grasps"
    build(shared_data / "dexycb-grasps", folder, every=4)
    with graspdb.open(folder) as opened:
        yield opened


def test_features_find_their_object(database: graspdb.Database, shared_data: Path) -> None:
    found = gallery(database)
    moved = perturbed(database, found, shared_data / "dexycb-grasps")
    chance = np.mean([np.mean(found.objects == name) for name in found.objects])
    shares = {
        label: (
            same_object(found, distances(found, q), 1),
            same_object(found, distances_by_others(found, q), 1),
        )
        for label, q in (("as they are", found.descriptors), ("moved, 0.5 mm of noise", moved))
    }
    for label, (own, others) in shares.items():
        print(f"\n{label}: {own:.3f}, by a metric of other objects {others:.3f}, by chance {chance:.3f}")
    # A quarter of the grasps leaves a quarter of the features to find; with all of them the share is 0.96.
    assert min(shares["as they are"]) > 0.8
    assert min(shares["moved, 0.5 mm of noise"]) > 0.75


def test_a_search_through_the_database_finds_like_features_first(database: graspdb.Database) -> None:
    objects = dict(database.sql("SELECT grasp, object FROM grasps WHERE feature_points > 100").rows())
    asked = sorted(objects)[::12]
    answers = [database.similar(key, 5).hits for key in asked]
    own = [objects[key] for key in asked]
    for key, hits in zip(asked, answers, strict=True):
        costs = [hit.cost for hit in hits]
        assert key not in [hit.grasp for hit in hits]
        assert costs == sorted(costs)
    first = np.mean([hits[0].object == name for hits, name in zip(answers, own, strict=True)])
    # A quarter of the grasps is left, and a part of a box is as like that of another box; chance is 0.06.
    print(f"\nbest hit of {len(asked)} on the same object: {first:.2f}")
    assert first > 0.2
