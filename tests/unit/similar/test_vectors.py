"""Exact search: brute force against the fast way, filters, ties, batches, threads."""

import numpy as np
import pytest

from graspdb_queries.similar import threads as pool
from graspdb_queries.similar.vectors import VectorIndex, exact_squared


def brute(vectors, query, count, rows=None):
    rows = np.arange(len(vectors)) if rows is None else rows
    squared = exact_squared(vectors[rows], query)
    order = np.lexsort((rows, squared))[:count]
    return rows[order], squared[order]


@pytest.fixture
def vectors():
    return np.random.default_rng(0).normal(size=(70_000, 24)).astype(np.float32)


@pytest.mark.parametrize("count", [1, 10, 500])
@pytest.mark.parametrize("share", [None, 0.001, 0.1, 0.9])
def test_results_are_those_of_brute_force(vectors, count, share):
    rng = np.random.default_rng(1)
    rows = None if share is None else np.flatnonzero(rng.random(len(vectors)) < share)
    query = rng.normal(size=24).astype(np.float32)
    found, squared = VectorIndex(vectors).nearest(query, count, rows)
    expected, exact = brute(vectors, query, count, rows)
    assert np.array_equal(found, expected)
    assert np.array_equal(squared, exact)


def test_vectors_nearer_to_each_other_than_single_precision_tells_are_ordered_exactly():
    rng = np.random.default_rng(2)
    far = 1000 + rng.normal(size=(5000, 8)) * 1e-3
    vectors = far.astype(np.float32)
    query = vectors[7] + np.float32(2e-4)
    found, _ = VectorIndex(vectors).nearest(query, 20)
    assert np.array_equal(found, brute(vectors, query, 20)[0])


def test_equal_vectors_come_in_their_order(vectors):
    vectors[[5, 60_000, 123]] = vectors[40_000]
    found, squared = VectorIndex(vectors).nearest(vectors[40_000], 4)
    assert found.tolist() == [5, 123, 40_000, 60_000]
    assert not squared.any()


def test_number_of_threads_does_not_matter(vectors, monkeypatch):
    query = np.random.default_rng(3).normal(size=24).astype(np.float32)
    answers = []
    for threads in (1, 2, 7):
        monkeypatch.setattr(pool.os, "cpu_count", lambda threads=threads: threads)
        answers.append(VectorIndex(vectors).nearest(query, 50))
    assert all(np.array_equal(rows, answers[0][0]) for rows, _ in answers)
    assert all(np.array_equal(squared, answers[0][1]) for _, squared in answers)


def test_no_vectors_and_no_rows_give_nothing(vectors):
    nothing = np.empty(0, dtype=np.int64)
    assert len(VectorIndex(vectors).nearest(vectors[0], 3, nothing)[0]) == 0
    assert len(VectorIndex(vectors[:0]).nearest(vectors[0], 3)[0]) == 0
