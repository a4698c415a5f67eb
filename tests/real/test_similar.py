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
    found = gallery(database)
    shared = np.flatnonzero(found.partners.any(axis=1))
    asked = np.union1d(np.arange(len(found.keys))[::8], shared)
    answers = {i: database.similar(found.keys[i], len(found.keys)).hits for i in asked}
    places = {key: i for i, key in enumerate(found.keys)}
    for i, hits in answers.items():
        costs = [hit.cost for hit in hits]
        assert found.keys[i] not in [hit.grasp for hit in hits]
        assert costs == sorted(costs)
    first = np.mean([hits[0].object == found.objects[i] for i, hits in answers.items()])
    ranks = []
    for i in shared:
        partners = [found.partners[i, places[hit.grasp]] for hit in answers[i] if hit.grasp in places]
        ranks.append(1 / (1 + partners.index(True)))
    print(f"\nbest hit of {len(asked)} on the same object: {first:.2f}")
    print(f"reciprocal rank of a feature that shares half of the points, {len(ranks)}: {np.mean(ranks):.2f}")
    # A quarter of the grasps is left, chance is 0.06; of all grasps nine of ten best hits are on the object.
    assert first > 0.6
    assert np.mean(ranks) > 0.8
