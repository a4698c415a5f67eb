"""Linear algebra runs on one thread within the context, and as before after it."""

import scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits

from graspdb_ingest.one_thread import one_thread


def threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_one_thread_within_and_as_many_as_before_afterwards() -> None:
    scipy.linalg.inv([[1.0]])
    with threadpool_limits(2):
        before = threads()
        with one_thread():
            assert set(threads()) == {1}
            with one_thread():
                assert set(threads()) == {1}
            assert set(threads()) == {1}
        assert threads() == before
