"""A hand model file in the layout of MANO's, and its hand computed the long way.

The hand is made up: joints and tips of graspdb's own hand at rest, each amid four vertices that the regressor
averages, all other vertices and all blend shapes at random.
"""

import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csc_matrix
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, build_hand
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import SEGMENT_OF_SITE, SITES, Side

USUAL_OF_MANO = (0, 5, 6, 7, 9, 10, 11, 17, 18, 19, 13, 14, 15, 1, 2, 3, 4, 8, 12, 16, 20)
"""Of each of MANO's 16 joints and five tips, its place among wrist, thumb 1-4 ... little 1-4."""

TIP_VERTICES = (744, 320, 443, 554, 671)
PARENTS = (4294967295, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14)


def rest_key_points(side: Side) -> np.ndarray:
    """Return the 21 key points of a hand of usual size at rest, wrist at the origin [m]."""
    size = HandDimensions(hand_length=0.19, hand_breadth=0.084)
    markers = {site: MarkerPlacement(SEGMENT_OF_SITE[site], at=site) for site in SITES}
    hand = build_hand(size, side, markers)
    pose = hand.forward(hand.neutral())
    wrist = pose.positions[hand.segments.index("hand")]
    return np.asarray(np.vstack([wrist, pose.sites]) - wrist)


def mano_content(side: Side, usual: np.ndarray | None = None) -> dict[str, Any]:
    """Return the arrays of a model file, named and shaped as the published ones, by key points at rest."""
    rng = np.random.default_rng(7)
    points = (rest_key_points(side) if usual is None else usual)[list(USUAL_OF_MANO)]
    template = rng.normal(scale=0.02, size=(778, 3)) + points[rng.integers(0, 21, 778)]
    template[list(TIP_VERTICES)] = points[16:]
    free = [v for v in range(778) if v not in TIP_VERTICES]
    around = rng.permutation(free)[: 4 * 16].reshape(16, 4)
    regressor = np.zeros((16, 778))
    for j, vertices in enumerate(around):
        regressor[j, vertices] = 0.25
        template[vertices] += points[j] - template[vertices].mean(axis=0)
    weights = rng.dirichlet(np.full(16, 0.3), 778)
    for tip, distal in zip(TIP_VERTICES, (15, 3, 6, 12, 9), strict=True):
        weights[tip] = 0.0
        weights[tip, [distal, distal - 1]] = 0.9, 0.1
    components, _ = np.linalg.qr(rng.normal(size=(45, 45)))
    return {
        "v_template": template,
        "shapedirs": rng.normal(scale=1e-3, size=(778, 3, 10)),
        "posedirs": rng.normal(scale=5e-4, size=(778, 3, 135)),
        "J_regressor": csc_matrix(regressor),
        "weights": weights,
        "kintree_table": np.array([PARENTS, range(16)], dtype=np.int64),
        "hands_mean": rng.normal(scale=0.2, size=45),
        "hands_components": components,
        "hands_coeffs": rng.normal(size=(20, 45)),
        "f": rng.integers(0, 778, (1538, 3)).astype(np.uint32),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
    }


def slow_key_points(
    content: Mapping[str, Any],
    pose: np.ndarray,
    orientation: np.ndarray,
    place: np.ndarray,
    shape: np.ndarray,
) -> np.ndarray:
    """Return the key points in the usual order, shape (21, 3), by skinning all vertices with matrices."""
    template = content["v_template"] + content["shapedirs"] @ shape
    regressor = content["J_regressor"]
    joints = (regressor.toarray() if hasattr(regressor, "toarray") else regressor) @ template
    rotations = [Rotation.from_rotvec(v).as_matrix() for v in np.vstack([orientation, pose.reshape(15, 3)])]
    posed = template + content["posedirs"] @ np.concatenate([(r - np.eye(3)).ravel() for r in rotations[1:]])
    frames: list[np.ndarray] = []
    for j, rotation in enumerate(rotations):
        local = np.eye(4)
        local[:3, :3] = rotation
        local[:3, 3] = joints[j] - (joints[PARENTS[j]] if j else 0.0)
        frames.append(frames[PARENTS[j]] @ local if j else local)
    vertices = np.zeros((778, 3))
    for j, frame in enumerate(frames):
        resting = np.eye(4)
        resting[:3, 3] = -joints[j]
        carried = np.hstack([posed, np.ones((778, 1))]) @ (frame @ resting).T
        vertices += content["weights"][:, j, None] * carried[:, :3]
    in_mano_order = np.vstack([[f[:3, 3] for f in frames], vertices[list(TIP_VERTICES)]]) + place
    usual = np.empty((21, 3))
    usual[list(USUAL_OF_MANO)] = in_mano_order
    return usual


def write_mano(folder: Path, side: Side, content: Mapping[str, Any] | None = None) -> Path:
    """Write a model file as Python 2 with chumpy did: its strings, its names of modules, its classes."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"MANO_{side.upper()}.pkl"
    content = dict(mano_content(side) if content is None else content)
    with _chumpy() as (ch, select):
        more = np.concatenate([content["shapedirs"], np.ones((778, 3, 10))], axis=2)
        chosen = np.arange(more.size).reshape(more.shape)[:, :, :10].ravel()
        content["shapedirs"] = select(
            a=ch(x=more), idxs=chosen, preferred_shape=(778, 3, 10), _dirty_vars={"a"}
        )
        content["v_template"] = ch(x=np.asfortranarray(content["v_template"]))
        path.write_bytes(python2_pickle(content))
    return path


def python2_pickle(content: object) -> bytes:
    """Return a pickle of protocol 2 with the strings and names of Python 2, numpy 1 and scipy 1.0."""
    stream = BytesIO()
    _Python2Pickler(stream, protocol=2).dump(content)
    data = stream.getvalue()
    for now, then in (
        (b"cnumpy._core.", b"cnumpy.core."),
        (b"cscipy.sparse._csc\n", b"cscipy.sparse.csc\n"),
        (b"cbuiltins\n", b"c__builtin__\n"),
    ):
        data = data.replace(now, then)
    return data


class _Python2Pickler(pickle._Pickler):  # type: ignore[name-defined,misc]
    """Writes text and bytes as Python 2 wrote its strings."""

    dispatch: ClassVar[dict[type, Callable[..., None]]] = dict(pickle._Pickler.dispatch)  # type: ignore[attr-defined]

    def save_string(self, text: str | bytes) -> None:
        data = text.encode("latin-1") if isinstance(text, str) else text
        self.write(b"T" + len(data).to_bytes(4, "little") + data)
        self.memoize(text)

    dispatch[str] = save_string
    dispatch[bytes] = save_string


@contextmanager
def _chumpy() -> Iterator[tuple[type, type]]:
    """Have modules of chumpy's names with classes of chumpy's names for as long as a pickle is written."""

    def keep(self: object, **attributes: object) -> None:
        self.__dict__.update(attributes)

    classes = []
    for module, name in (("chumpy.ch", "Ch"), ("chumpy.reordering", "Select")):
        classes.append(type(name, (), {"__init__": keep, "__module__": module}))
        sys.modules[module] = ModuleType(module)
        setattr(sys.modules[module], name, classes[-1])
    sys.modules["chumpy"] = ModuleType("chumpy")
    try:
        yield classes[0], classes[1]
    finally:
        for module in ("chumpy", "chumpy.ch", "chumpy.reordering"):
            del sys.modules[module]
