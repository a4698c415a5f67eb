"""How a grasp shows itself in a notebook."""

import base64
from typing import Final

from markupsafe import Markup

from graspdb.grasp import Grasp
from graspdb.view.facts import facts, grasp_facts
from graspdb.view.picture import picture, png
from graspdb.view.reading import read_scene
from graspdb_schemas.errors import GraspDBError

SIZE: Final = 320
"""Side of the picture [pixels]."""

_PICTURE: Final = Markup('<img alt="grasp {}" width="{}" height="{}" src="data:image/png;base64,{}">')
_ROW: Final = Markup('<tr><th style="text-align:left">{}</th><td style="text-align:left">{}</td></tr>')
_WHOLE: Final = Markup(
    '<div style="display:flex;flex-wrap:wrap;gap:16px;align-items:center">{}'
    "<div><strong>{}</strong><table>{}</table></div></div>"
)


def grasp_html(grasp: Grasp) -> str:
    """Return a picture of a grasp and what is known of it, as HTML; every name in it is text.

    Without its database, or where that lacks what a picture needs, the facts stand alone.
    """
    image, known = Markup(""), grasp_facts(grasp)
    if grasp.database is not None:
        try:
            scene = read_scene(grasp.database, grasp.id, motion=False)
        except GraspDBError:
            scene = None
        if scene is not None:
            known = facts(scene)
            drawn = base64.b64encode(png(picture(scene, SIZE, SIZE))).decode()
            image = _PICTURE.format(grasp.id, SIZE, SIZE, drawn)
    rows = Markup("").join(_ROW.format(name, value) for name, value in known)
    return str(_WHOLE.format(image, grasp.id, rows))
