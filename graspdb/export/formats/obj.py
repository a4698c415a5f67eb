"""``obj``: clouds, hulls and contacts of grasps, as Wavefront OBJ."""

from collections.abc import Sequence
from typing import Final

from graspdb.export.held import HeldObject, HeldReader
from graspdb.export.items import Grasp
from graspdb.export.names import path_of, with_ending
from graspdb.export.obj import ObjPart, write_obj
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format

_FEATURES: Final = (
    Feature("*_cloud.obj: o object", "text", "(n, 3)", "m", "points and normals, object frame"),
    Feature("*_cloud.obj: o feature", "text", "(k, 3)", "m", "those of the graspable feature, once more"),
    Feature("*_hull.obj: o hull", "text", "(v, 3)", "m", "the enclosing space, as triangles"),
    Feature("*_contacts.obj: o contacts", "text", "(c, 3)", "m", "contact points and outward normals"),
)


@export_format(Format("obj", "OBJ files of each grasp's cloud, hull and contacts", items="grasps"))
class ObjWriter(Writer[Grasp]):
    """Up to three files a grasp; what is empty, such as the hull of a grasp without contacts, has none."""

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part."""
        files = 0
        grasps = list(part.items)
        for held in HeldReader(self.database).read(grasps):
            stem = path_of(self.folder, part.split, held.grasp.id)
            for name, parts in _parts(held).items():
                if filled := [piece for piece in parts if len(piece.vertices)]:
                    comment = f"{held.grasp.id}: {name}, object frame, metres"
                    write_obj(with_ending(stem, f"_{name}.obj"), comment, filled)
                    files += 1
        return Written(part.split, {"grasps": len(grasps), "files": files})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return _FEATURES


def _parts(held: HeldObject) -> dict[str, list[ObjPart]]:
    grasp, cloud = held.grasp, held.cloud
    return {
        "cloud": [
            ObjPart("object", cloud.points, cloud.normals),
            ObjPart("feature", grasp.feature_cloud, grasp.feature_normals),
        ],
        "hull": [ObjPart("hull", grasp.hull_vertices, faces=grasp.hull_faces)],
        "contacts": [ObjPart("contacts", grasp.contact_points, grasp.contact_normals)],
    }
