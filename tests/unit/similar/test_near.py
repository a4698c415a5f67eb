"""Candidates: the nearest over batches are those of all at once, and orders are taken in turn."""

import numpy as np
import pytest

from graspdb_queries.similar.near import Order, in_turn


def test_orders_are_taken_in_turn_and_every_key_once() -> None:
    assert in_turn([["a", "b", "c"], ["b", "d", "a"]], 10) == ["a", "b", "d", "c"]
    assert in_turn([["a", "b", "c"], ["d"]], 3) == ["a", "d", "b"]
    assert in_turn([[], ["x"]], 5) == ["x"]
    assert in_turn([], 5) == []


@pytest.mark.parametrize("count", [1, 7, 200])
def test_the_nearest_over_batches_are_those_of_all_at_once(count: int) -> None:
    rng = np.random.default_rng(0)
    keys = [f"k{i:03d}" for i in rng.permutation(100)]
    distances = rng.integers(0, 20, 100).astype(float)  # many are equal
    order = Order(count)
    for some in np.array_split(np.arange(100), 6):
        order.add([keys[i] for i in some], np.arange(len(some)), distances[some])
    ranked = sorted(zip(distances, keys, strict=True))[:count]
    assert list(order.distances) == [key for _, key in ranked]


def test_of_several_descriptions_the_nearer_counts() -> None:
    order = Order(2)
    order.add(["a", "b"], np.array([0, 1]), np.array([3.0, 2.0]))
    order.add(["a", "c"], np.array([0, 1]), np.array([1.0, 5.0]))
    assert order.distances == {"a": 1.0, "b": 2.0}
