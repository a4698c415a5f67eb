"""Vectors of three numbers in compiled loops, where an array for each would cost more than the arithmetic."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.compiled import compiled

Three = tuple[float, float, float]
Vector = NDArray[np.floating[Any]] | Three


@compiled
def minus(a: Vector, b: Vector) -> Three:
    """Return the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Return the dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Three:
    """Return the cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def stepped(a: Vector, b: Vector, share: float) -> Three:
    """Return where a step of a share of one vector leads from another: ``a + share * b``."""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]
