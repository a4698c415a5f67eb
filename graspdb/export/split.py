"""Splits: which side a group falls on follows from its name and the seed alone.

So what is on a side stays there when data is added, and two exports with one seed agree.
"""

import hashlib
from collections.abc import Iterable
from typing import Final

TRAIN: Final = "train"
VALID: Final = "valid"

VALID_SHARE: Final = 0.2
"""Chance of a group to be on the side that is held out."""

_SEEDS_TRIED: Final = 1000


def side_of(group: str, seed: int) -> str:
    """Return the side of a group: a hash of seed and name, as a number in [0, 1), against the share."""
    digest = hashlib.sha256(f"{seed}/{group}".encode()).digest()
    return VALID if int.from_bytes(digest[:8], "big") < VALID_SHARE * 2**64 else TRAIN


def sides(groups: Iterable[str], seed: int) -> dict[str, str]:
    """Return the side of each group."""
    return {group: side_of(group, seed) for group in groups}


def is_one_sided(groups: Iterable[str], seed: int) -> bool:
    """Whether all groups fall on one side."""
    return len(set(sides(groups, seed).values())) < 2


def seed_with_both(groups: Iterable[str]) -> int | None:
    """Return the least seed with which both sides have a group, if there is one among the first thousand."""
    names = list(groups)
    return next((seed for seed in range(_SEEDS_TRIED) if not is_one_sided(names, seed)), None)
