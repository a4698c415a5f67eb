"""Small pictures of grasps, drawn without a display: object, hand, enclosing space and graspable feature."""

from graspdb.thumbnails.picture import Picture, draw, draw_shaded
from graspdb.thumbnails.shapes import GraspShape, ObjectShape, ShapeReader

__all__ = ["GraspShape", "ObjectShape", "Picture", "ShapeReader", "draw", "draw_shaded"]
