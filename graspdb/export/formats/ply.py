"""``ply``: clouds, hulls and contacts of grasps, for any viewer of meshes."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from graspdb.export.held import HeldObject, HeldReader
from graspdb.export.items import Grasp
from graspdb.export.names import path_of, with_ending
from graspdb.export.ply import point_properties, write_ply
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format

_FEATURES: Final = (
    Feature("*_cloud.ply: x y z", "float32", "(n, 3)", "m", "points of the object, object frame"),
    Feature("*_cloud.ply: nx ny nz", "float32", "(n, 3)", "", "outward unit normals"),
    Feature("*_cloud.ply: area", "float32", "(n,)", "m2", "surface that each point stands for"),
    Feature("*_cloud.ply: feature", "uint8", "(n,)", "", "1 for points of the graspable feature"),
    Feature("*_cloud.ply: gap", "float32", "(n,)", "m", "signed distance to the hand; NaN far from it"),
    Feature("*_hull.ply: x y z, faces", "float32", "(v, 3)", "m", "the enclosing space, closed"),
    Feature("*_contacts.ply: x y z", "float32", "(c, 3)", "m", "contact points"),
    Feature("*_contacts.ply: nx ny nz", "float32", "(c, 3)", "", "outward surface normals there"),
    Feature("*_contacts.ply: site", "uint8", "(c,)", "", "number of the touching site, from 0"),
    Feature("*_sites.ply: x y z", "float32", "(20, 3)", "m", "centres of the spheres"),
    Feature("*_sites.ply: radius", "float32", "(20,)", "m", "their radii"),
    Feature("*_sites.ply: gap", "float32", "(20,)", "m", "signed distances of the sites to the object"),
    Feature("*_sites.ply: touching", "uint8", "(20,)", "", "1 for sites that touch"),
)


@export_format(Format("ply", "PLY files of each grasp's cloud, hull, contacts and sites", items="grasps"))
class PlyWriter(Writer[Grasp]):
    """Up to four files a grasp; what is empty, such as the hull of a grasp without contacts, has none."""

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part."""
        files = 0
        grasps = list(part.items)
        for held in HeldReader(self.database).read(grasps):
            stem = path_of(self.folder, part.split, held.grasp.id)
            for name, (properties, faces) in _parts(held).items():
                write_ply(with_ending(stem, f"_{name}.ply"), properties, faces)
                files += 1
        return Written(part.split, {"grasps": len(grasps), "files": files})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return _FEATURES


def _parts(held: HeldObject) -> dict[str, tuple[dict[str, np.ndarray], np.ndarray | None]]:
    """Return properties of vertices and faces of each file that is not empty."""
    grasp, cloud = held.grasp, held.cloud
    objects = point_properties(cloud.points, cloud.normals)
    objects["area"] = cloud.areas.astype(np.float32)
    objects["feature"] = held.in_feature().astype(np.uint8)
    objects["gap"] = held.point_gaps().astype(np.float32)
    contacts = point_properties(grasp.contact_points, grasp.contact_normals)
    contacts["site"] = held.contact_site_numbers.astype(np.uint8)
    sites = point_properties(grasp.sites)
    sites["radius"] = held.radii.astype(np.float32)
    sites["gap"] = grasp.gap.astype(np.float32)
    sites["touching"] = held.touching.astype(np.uint8)
    parts = {
        "cloud": (objects, None),
        "hull": (point_properties(grasp.hull_vertices), grasp.hull_faces),
        "contacts": (contacts, None),
        "sites": (sites, None),
    }
    return {name: part for name, part in parts.items() if len(part[0]["x"])}
