"""``mjcf``: grasps as scenes for MuJoCo."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from graspdb.export.held import HeldObject, HeldReader
from graspdb.export.items import Grasp
from graspdb.export.names import path_of, with_ending
from graspdb.export.objects import ObjectMesh, ObjectMeshes
from graspdb.export.options import ExportOptions
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format

if TYPE_CHECKING:
    from graspdb.database import Database
    from graspdb.export.mjcf import Keyframe
    from graspdb.export.posed import PosedHand

NO_HAND: Final = "grasps with neither joint angles nor all sites"
NO_SURFACE: Final = "grasps of objects whose cloud is too small for a surface"

_FEATURES: Final = (
    Feature("<grasp>.xml", "MJCF", "()", "m, kg, s, rad", "hand, object, support plane, servos, keyframes"),
    Feature("keyframe grasp", "float64", "(37,)", "m, 1, rad", "snapshot: q (30), pose of the object (7)"),
    Feature("keyframes reach, contact, hold", "float64", "(37,)", "m, 1, rad",
            "0.3 s before the first contact, at it, and in mid-hold, where joint angles were tracked"),
    Feature("objects/*.obj", "text", "(v, 3)", "m", "closed surface through the object's cloud"),
)  # fmt: skip


@export_format(Format("mjcf", "MuJoCo scenes of grasps, with hand, object and keyframes", items="grasps"))
class MjcfWriter(Writer[Grasp]):
    """One scene a grasp, and one mesh an object."""

    def __init__(self, folder: Path, options: ExportOptions, database: "Database") -> None:
        super().__init__(folder, options, database)
        self._meshes = ObjectMeshes(folder, ".obj")

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part."""
        from graspdb.export.keyframes import other_keyframes
        from graspdb.export.posed import posed_hand

        counts = {"grasps": 0, "hands fitted to sites": 0}
        left_out = {NO_HAND: 0, NO_SURFACE: 0}
        grasps = list(part.items)
        others = other_keyframes(self.database, grasps)
        for held in HeldReader(self.database).read(grasps):
            posed, mesh = posed_hand(held), self._meshes.of(held)
            if posed is None or mesh is None:
                left_out[NO_HAND if posed is None else NO_SURFACE] += 1
                continue
            path = with_ending(path_of(self.folder, part.split, held.grasp.id), ".xml")
            write_scene(path, held, posed, mesh, others.get(held.grasp.id, ()))
            counts["grasps"] += 1
            counts["hands fitted to sites"] += posed.residual is not None
        return Written(part.split, counts, {reason: n for reason, n in left_out.items() if n})

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return _FEATURES


def write_scene(
    path: Path, held: HeldObject, posed: "PosedHand", mesh: ObjectMesh, others: Sequence["Keyframe"]
) -> None:
    """Write the scene of one grasp: in the lab frame, or in the object's where it was not seen in a lab.

    Parameters
    ----------
    path : Path
        The MJCF file.
    held : HeldObject
        The grasp.
    posed : PosedHand
        Its hand.
    mesh : ObjectMesh
        Its object.
    others : sequence of Keyframe
        Further postures, of the tracked hand in the lab frame.
    """
    from graspdb.export.mjcf import DENSITY, Keyframe, Press, SceneObject, grasp_scene
    from graspdb.export.posed import moved
    from graspdb_ingest.parameters import QualityParameters

    pose = np.eye(4) if held.world_from_object is None else held.world_from_object
    up = None if held.world_from_object is None else held.up
    grasp = Keyframe("grasp", moved(posed.q, pose), pose)
    support = None
    if up is not None and held.grasp.snapshot_kind != "static":
        support = float(np.nanmin((held.cloud.points @ pose[:3, :3].T + pose[:3, 3]) @ up))
    file = os.path.relpath(mesh.path, path.parent)
    mass = held.mass or DENSITY * mesh.surface.volume
    grasp_scene(
        path,
        held.grasp.id,
        posed.model,
        SceneObject(file, mass, held.friction or QualityParameters().friction, held.center),
        [grasp, *(others if posed.residual is None else ())],
        Press(held.contact_site_numbers.tolist(), held.grasp.contact_points, held.grasp.contact_normals),
        up,
        support,
    )
