"""What the meshes and clouds of a session's objects hold."""

from collections.abc import Iterator
from dataclasses import dataclass

from graspdb_ingest.objects.mesh import load_surface
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.manifest import Session


@dataclass(frozen=True)
class ObjectReport:
    """What the file of one object holds.

    Attributes
    ----------
    name, file : str
        The object, and its file as the manifest names it.
    problem : str or None
        Why it cannot be used; then nothing of what follows is known.
    n_vertices, n_faces : int
        Vertices or points, and triangles; a cloud has none.
    extents : tuple of float, shape (3,)
        Size along the axes of the object frame [m].
    watertight : bool
        Whether the mesh is closed, so that there is an inside.
    warnings : tuple of str
        What was found wrong and put up with.
    """

    name: str
    file: str
    problem: str | None = None
    n_vertices: int = 0
    n_faces: int = 0
    extents: tuple[float, ...] = ()
    watertight: bool = False
    warnings: tuple[str, ...] = ()


def check_objects(session: Session) -> Iterator[ObjectReport]:
    """Yield a report for each object that has a mesh or cloud."""
    for name, described in session.objects.items():
        if described.mesh is None:
            continue
        file = str(session.raw["objects"][name]["mesh"])
        try:
            surface = load_surface(described.mesh, described.mesh_scale)
        except GraspDBError as error:
            yield ObjectReport(name, file, problem=str(error))
            continue
        yield ObjectReport(
            name=name,
            file=file,
            n_vertices=len(surface.vertices),
            n_faces=0 if surface.faces is None else len(surface.faces),
            extents=tuple(float(extent) for extent in surface.extents),
            watertight=surface.watertight,
            warnings=surface.warnings,
        )
