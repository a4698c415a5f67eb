"""``glb``: grasps as scenes for browsers, Blender and game engines."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from graspdb.export.held import HeldReader
from graspdb.export.items import Grasp
from graspdb.export.names import path_of, with_ending
from graspdb.export.objects import Surfaces
from graspdb.export.options import ExportOptions
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format

if TYPE_CHECKING:
    from graspdb.database import Database

_FEATURES: Final = (
    Feature("object", "mesh", "(v, 3)", "m", "closed surface through the object's cloud"),
    Feature("hand", "mesh", "(v, 3)", "m", "segments as capsules"),
    Feature("sites_touching, sites_free", "mesh", "(v, 3)", "m", "spheres that touch, and the others"),
    Feature("hull", "mesh", "(v, 3)", "m", "the enclosing space, translucent"),
    Feature("feature", "points", "(k, 3)", "m", "the graspable feature"),
    Feature("contacts", "mesh", "(v, 3)", "m", "contact points and outward normals (20 mm)"),
)


@export_format(Format("glb", "Scenes of grasps as binary glTF", items="grasps"))
class GlbWriter(Writer[Grasp]):
    """One scene a grasp."""

    def __init__(self, folder: Path, options: ExportOptions, database: "Database") -> None:
        super().__init__(folder, options, database)
        self._surfaces = Surfaces()

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part."""
        from graspdb.export.glb import write_glb

        grasps = list(part.items)
        for held in HeldReader(self.database).read(grasps):
            path = with_ending(path_of(self.folder, part.split, held.grasp.id), ".glb")
            write_glb(path, held, self._surfaces.of(held.cloud))
        return Written(part.split, {"grasps": len(grasps)})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return _FEATURES
