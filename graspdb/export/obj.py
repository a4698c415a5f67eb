"""Wavefront OBJ: named sets of points and triangles."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class ObjPart:
    """One named object of an OBJ file.

    Attributes
    ----------
    name : str
        Its name.
    vertices : ndarray, shape (n, 3)
        Its vertices.
    normals : ndarray, shape (n, 3), or None
        A normal for each of them.
    faces : ndarray of int, shape (m, 3), or None
        Triangles; None where the vertices are points of a cloud.
    """

    name: str
    vertices: Array
    normals: Array | None = None
    faces: Array | None = None


def write_obj(path: Path, comment: str, parts: Sequence[ObjPart]) -> None:
    """Write named sets of points and triangles as one OBJ file, with nine significant digits.

    Points that are part of no triangle are written as point elements (``p``).

    Parameters
    ----------
    path : Path
        The file.
    comment : str
        What it shows, for its first line.
    parts : sequence of ObjPart
        What stands in it.
    """
    lines = [f"# {' '.join(comment.split())}"]
    vertices = normals = 0
    for part in parts:
        lines.append(f"o {part.name}")
        lines += ["v " + _numbers(row) for row in part.vertices]
        corner = np.arange(len(part.vertices)) + vertices + 1
        texts = [str(number) for number in corner]
        if part.normals is not None:
            lines += ["vn " + _numbers(row) for row in part.normals]
            offset = normals - vertices
            texts = [f"{number}//{number + offset}" for number in corner]
            normals += len(part.normals)
        if part.faces is None:
            lines += [f"p {number}" for number in corner]
        else:
            lines += ["f " + " ".join(texts[i] for i in face) for face in part.faces]
        vertices += len(part.vertices)
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _numbers(row: Array) -> str:
    return " ".join(format(x, ".9g") for x in row)
