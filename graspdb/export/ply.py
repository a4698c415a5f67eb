"""PLY: points with properties, and triangles between them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

_KINDS: Final = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int", "i2": "short", "u2": "ushort"}


def write_ply(path: Path, vertices: Mapping[str, Array], faces: Array | None = None) -> None:
    """Write a binary PLY file.

    Parameters
    ----------
    path : Path
        The file.
    vertices : mapping of str to ndarray, shape (n,)
        Properties of the vertices, x, y and z among them, in order; their types are the file's.
    faces : ndarray of int, shape (m, 3), optional
        Triangles.
    """
    columns = {name: np.asarray(values) for name, values in vertices.items()}
    kinds = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    packed = np.empty(len(next(iter(columns.values()))), dtype=kinds)
    for name, values in columns.items():
        packed[name] = values
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(packed)}"]
    head += [f"property {_KINDS[kind.str[1:]]} {name}" for name, kind in kinds]
    triangles = np.empty(0, dtype=[("count", "u1"), ("corners", "<i4", 3)])
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        triangles = np.empty(len(faces), dtype=triangles.dtype)
        triangles["count"], triangles["corners"] = 3, faces
    with path.open("wb") as file:
        file.write("\n".join([*head, "end_header", ""]).encode("ascii"))
        file.write(packed.tobytes() + triangles.tobytes())


def point_properties(positions: Array, normals: Array | None = None) -> dict[str, Array]:
    """Return positions, and normals, of shape (n, 3) each, as properties of 32-bit floats."""
    named = zip(("x", "y", "z"), positions.T, strict=True)
    properties = {name: values.astype(np.float32) for name, values in named}
    if normals is not None:
        named = zip(("nx", "ny", "nz"), normals.T, strict=True)
        properties |= {name: values.astype(np.float32) for name, values in named}
    return properties
