"""The page of a grasp, or of two beside each other: one file, which needs no network."""

from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Final

import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from graspdb.view import palette
from graspdb.view.camera import Camera
from graspdb.view.facts import description, facts, subtitle
from graspdb.view.likeness import Likeness
from graspdb.view.payload import json_for_script, scene_payload
from graspdb.view.picture import best_camera
from graspdb.view.scene import CAPSULE_SHARE, Floats, Scene
from graspdb_schemas.vocabulary import SITES

_ASSETS: Final = files("graspdb.view") / "assets"

_SCRIPTS: Final = ("page_data.js", "grasp_view.js", "grasp_page.js", "timeline.js", "begin.js")
"""What draws the page, in this order."""

_LAYERS: Final = (
    ("object", "Object", palette.OBJECT),
    ("hand", "Hand", palette.HAND),
    ("spheres", "Spheres, touching ones red", palette.TOUCHING),
    ("hull", "Enclosing space", palette.HULL),
    ("feature", "Graspable feature", palette.FEATURE),
    ("contacts", "Contact points and normals", palette.CONTACT),
    ("map", "Contact map", palette.SCALE[-2]),
)
"""Layers in the order of their keys: name, label, colour."""


@dataclass(frozen=True, eq=False)
class Laid:
    """A grasp and where its object lies in the page: world_from_object, shape (4, 4)."""

    scene: Scene
    world_from_object: Floats


def grasp_page(scene: Scene) -> str:
    """Return the page of one grasp as HTML."""
    laid = Laid(scene, scene.world_from_object)
    camera = _moved(best_camera(scene), laid.world_from_object)
    return _page([laid], camera, scene.grasp.id, subtitle(scene), None)


def likeness_page(first: Scene, second: Scene, likeness: Likeness) -> str:
    """Return the page of two grasps, the second laid over the first as their likeness says."""
    shown = [Laid(first, np.eye(4)), Laid(second, likeness.first_from_second)]
    title = f"{first.grasp.id} and {second.grasp.id}"
    return _page(shown, best_camera(first), title, likeness.summary, likeness)


def _page(shown: list[Laid], camera: Camera, title: str, line: str, likeness: Likeness | None) -> str:
    mapped = any(laid.scene.contact_map is not None for laid in shown)
    near, far = palette.MAP_RANGE
    template = _environment().from_string(_asset("viewer.html.jinja"))
    return template.render(
        title=title,
        subtitle=line,
        label=" ".join(description(laid.scene) for laid in shown),
        css=Markup(_asset("style.css") + _asset("viewer.css")),
        three=Markup(_asset("three.min.js")),
        viewer=Markup("\n".join(map(_asset, _SCRIPTS))),
        data=Markup(json_for_script(_data(shown, camera))),
        layers=[
            {"name": name, "label": label, "colour": colour, "missing": name == "map" and not mapped}
            for name, label, colour in _LAYERS
        ],
        grasps=[
            {"name": laid.scene.grasp.id, "about": subtitle(laid.scene), "facts": facts(laid.scene)}
            for laid in shown
        ],
        sites=SITES,
        scale=palette.SCALE,
        map_near=f"{1e3 * near:g} mm".replace("-", "\N{MINUS SIGN}"),
        map_far=f"{1e3 * far:g} mm",
        likeness=None if likeness is None else likeness.as_shown(),
    )


def _data(shown: list[Laid], camera: Camera) -> dict[str, Any]:
    return {
        "sites": list(SITES),
        "capsule_share": CAPSULE_SHARE,
        "scale": list(palette.SCALE),
        "map_range": list(palette.MAP_RANGE),
        "camera": {"eye": camera.eye.tolist(), "target": camera.target.tolist(), "up": camera.up.tolist()},
        "grasps": [scene_payload(laid.scene, laid.world_from_object) for laid in shown],
    }


def _moved(camera: Camera, transform: Floats) -> Camera:
    rotation, position = transform[:3, :3], transform[:3, 3]
    return Camera(rotation @ camera.eye + position, rotation @ camera.target + position, rotation @ camera.up)


def _environment() -> Environment:
    return Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")
