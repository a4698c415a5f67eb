"""Length units and their size in metres."""

from typing import Final

METRES_PER: Final[dict[str, float]] = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0}
"""Metres in one of each unit that a manifest may name."""

_STEMS: Final = {"millimet": "mm", "centimet": "cm", "decimet": "dm", "met": "m"}
_SPELLINGS: Final[dict[str, str]] = {
    f"{stem}{ending}": unit for stem, unit in _STEMS.items() for ending in ("er", "ers", "re", "res")
}


def metres_per(name: str) -> float | None:
    """Return the metres in a unit as a recording spells it, ``mm`` or ``Meters``; None if unknown."""
    spelt = name.strip().lower()
    return METRES_PER.get(_SPELLINGS.get(spelt, spelt))
