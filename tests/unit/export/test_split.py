"""Sides of a split: by name and seed alone, and about as many as the share says."""

from hypothesis import given
from hypothesis import strategies as st

from graspdb.export.split import TRAIN, VALID, VALID_SHARE, is_one_sided, seed_with_both, sides

names = st.sets(st.text(min_size=1), min_size=1, max_size=30)


@given(some=names, more=names, seed=st.integers(0, 1000))
def test_nobody_changes_sides_when_data_is_added(some: set[str], more: set[str], seed: int) -> None:
    before, after = sides(some, seed), sides(some | more, seed)
    assert before.items() <= after.items()
    assert set(after.values()) <= {TRAIN, VALID}


def test_sides_have_their_share_and_seeds_differ() -> None:
    groups = [f"subject {i}" for i in range(10_000)]
    first, second = sides(groups, 0), sides(groups, 1)
    share = sum(side == VALID for side in first.values()) / len(groups)
    # Four standard deviations of a share of 10,000.
    assert abs(share - VALID_SHARE) < 4 * (VALID_SHARE * (1 - VALID_SHARE) / len(groups)) ** 0.5
    both = sum(first[name] == second[name] == VALID for name in groups) / len(groups)
    assert abs(both - VALID_SHARE**2) < 0.01


@given(groups=st.sets(st.text(), min_size=2, max_size=6))
def test_a_seed_that_is_proposed_works(groups: set[str]) -> None:
    seed = seed_with_both(groups)
    assert seed is not None
    assert not is_one_sided(groups, seed)
    assert all(is_one_sided(groups, less) for less in range(seed))


def test_one_group_cannot_be_split() -> None:
    assert seed_with_both(["alone"]) is None
