"""Orders of the 21 key points in which data sets write them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.model import Floats
from graspdb_schemas.errors import ParameterError, nearest
from graspdb_schemas.vocabulary import DIGITS, KEY_POINTS

_MANO_DIGITS: Final = ("index", "middle", "little", "ring", "thumb")
_MANO_JOINTS: Final = tuple(
    f"{digit}_{joint}"
    for digit in _MANO_DIGITS
    for joint in (("cmc", "mcp", "ip") if digit == "thumb" else ("mcp", "pip", "dip"))
)

ORDERS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "usual": KEY_POINTS,
        "openpose": KEY_POINTS,
        "mano": ("wrist", *_MANO_JOINTS, *(f"{digit}_tip" for digit in DIGITS)),
    }
)
"""Named orders: the usual one, wrist and then thumb to little from the palm outwards, which OpenPose and
MediaPipe have, too; and that of the MANO hand model's 16 joints, with the five tips after, thumb first."""


def key_point_names(order: str) -> tuple[str, ...]:
    """Return the key points in an order given by its name, or as their names with commas between.

    Raises
    ------
    ParameterError
        There is no such order, or the names are not the 21 key points, each once.
    """
    if order in ORDERS:
        return ORDERS[order]
    names = tuple(name.strip() for name in order.split(","))
    if len(names) == 1:
        raise ParameterError(
            "order", order, f"{', '.join(ORDERS)}, or 21 names{nearest(order, list(ORDERS))}"
        )
    unknown = [name for name in names if name not in KEY_POINTS]
    if unknown:
        raise ParameterError("order", unknown[0], ", ".join(KEY_POINTS) + nearest(unknown[0], KEY_POINTS))
    missing = [name for name in KEY_POINTS if names.count(name) != 1]
    if missing:
        raise ParameterError("order", f"{missing[0]} {names.count(missing[0])} times", "each key point once")
    return names


def in_usual_order(points: Floats, order: str) -> Floats:
    """Return key points, shape (..., 21, 3), given in an order, in that of `KEY_POINTS`.

    Raises
    ------
    ParameterError
        If there are not 21 of them, or there is no such order.
    """
    names = key_point_names(order)
    if points.shape[-2:] != (len(KEY_POINTS), 3):
        raise ParameterError("key points", points.shape, "an array of shape (..., 21, 3)")
    places: NDArray[np.int64] = np.array([names.index(name) for name in KEY_POINTS])
    return np.asarray(points[..., places, :])
