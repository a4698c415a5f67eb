"""A scene as JSON for a page: numbers as base64 of little-endian arrays, text escaped for scripts."""

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspdb.view.scene import SEGMENTS_DRAWN, Floats, Motion, Scene


def json_for_script(value: object) -> str:
    """Return JSON that may stand in a script element.

    Whatever text is in it, it cannot end the element: ``<``, ``>`` and ``&`` are escaped, and so is all that
    is not ASCII, U+2028 and U+2029 among it.
    """
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def scene_payload(scene: Scene, world_from_object: Floats) -> dict[str, Any]:
    """Return what the page draws of a grasp.

    Parameters
    ----------
    scene : Scene
        The grasp.
    world_from_object : ndarray, shape (4, 4)
        Where its object is laid at the snapshot, in the frame of the page's camera.
    """
    grasp, surface = scene.grasp, scene.surface
    return {
        "object": grasp.object,
        "world_from_object": world_from_object.T.ravel().tolist(),
        "surface": {
            "points": _floats(surface.points),
            "normals": _floats(surface.normals),
            "faces": _integers(surface.faces),
        },
        "feature": _integers(scene.feature),
        "map": None
        if scene.contact_map is None
        else {"points": _integers(scene.contact_map.points), "gaps": _floats(scene.contact_map.gaps)},
        "nodes": _floats(scene.nodes),
        "radii": _floats(scene.radii),
        "segments": [[segment.name, segment.start, segment.end] for segment in SEGMENTS_DRAWN],
        "touching": scene.touching.tolist(),
        "gap": _floats(grasp.gap),
        "contacts": {
            "sites": list(grasp.contact_sites[: len(grasp.contact_points)]),
            "positions": _floats(grasp.contact_points),
            "normals": _floats(grasp.contact_normals),
        },
        "hull": None
        if grasp.hull_volume is None or not len(grasp.hull_faces)
        else {
            "vertices": _floats(grasp.hull_vertices),
            "faces": _integers(grasp.hull_faces),
            "volume": grasp.hull_volume,
        },
        "motion": None if scene.motion is None else _motion(scene.motion),
    }


def _motion(motion: Motion) -> dict[str, Any]:
    bits = motion.touching.astype(np.uint32) << np.arange(motion.touching.shape[1], dtype=np.uint32)
    return {
        "times": _floats(motion.times),
        "nodes": _floats(motion.nodes),
        "position": _floats(motion.object_position),
        "quaternion": _floats(motion.object_quaternion),
        "gap": _floats(motion.gap),
        "touching": _integers(bits.sum(axis=1)),
        "snapshot": motion.snapshot,
        "phases": [{"name": p.name, "start": p.start, "end": p.end} for p in motion.phases],
    }


def _floats(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _integers(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<u4").tobytes()).decode()
