"""Why a hit costs what it does: its parts, and how they are told in words, in tables and in JSON."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np


@dataclass(frozen=True)
class ScorePart:
    """One reason of a score.

    Attributes
    ----------
    name : str
        descriptor, surface, posture, sites or contacts.
    distance : float
        How far hit and query are apart in this respect.
    unit : str
        Unit of the distance; empty for a number without one.
    scale : float
        Distance that costs one.
    weight : float
        Weight of this part in the cost.
    """

    name: str
    distance: float
    unit: str
    scale: float
    weight: float

    @property
    def cost(self) -> float:
        """What this part adds to the cost of the hit."""
        return self.weight * self.distance / self.scale

    def explain(self) -> str:
        """Return distance, weight, scale and cost in words."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name} {self.distance:.3g}{unit} x {self.weight:g}/{self.scale:g} = {self.cost:.3f}"


class Scored(Protocol):
    """A hit with the parts of its cost."""

    @property
    def parts(self) -> tuple[ScorePart, ...]:
        """What the cost consists of."""


def explained(parts: Sequence[ScorePart]) -> str:
    """Return the parts of a cost as one line."""
    return "; ".join(part.explain() for part in parts)


def part_columns(hits: Sequence[Scored]) -> dict[str, list[Any]]:
    """Return a column of distances for each part of the cost, named by part and unit."""
    return {
        f"{part.name}_{part.unit}" if part.unit else part.name: [hit.parts[i].distance for hit in hits]
        for i, part in enumerate(hits[0].parts if hits else ())
    }


def plain(hit: Scored) -> dict[str, Any]:
    """Return a hit as plain values, for JSON."""
    values: dict[str, Any] = {
        name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(hit).items()
    }
    values["parts"] = [{**vars(part), "cost": part.cost} for part in hit.parts]
    return values
