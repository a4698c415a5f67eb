"""Hands that a MJCF file describes: a monkey's, a robot's.

Only what decides where spheres and markers are is taken from the file: bodies, joints, sites and
the defaults that they refer to. It is read as plain XML first, so that nothing in it makes MuJoCo
open another file; what it includes must lie beside it or below.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Final
from xml.etree import ElementTree

import mujoco
import numpy as np

from graspdb_ingest.hand.model import MARKER_PREFIX, Floats, HandModel
from graspdb_schemas.errors import HandFileError, HandModelError, nearest
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import SITES, Side

LARGEST_FILES: Final = 4_000_000
"""Bytes of a model and all that it includes; a hand's kinematics take a few kilobytes."""
MOST_FILES: Final = 32
MOST_DOFS: Final = 100
PLAUSIBLE_SPAN: Final = (0.02, 0.7)
"""Largest distance between two of the 20 sites, all joints at their reference [m]."""

_IN_BODY: Final = {"body", "frame", "joint", "freejoint", "site"}
_IN_DEFAULT: Final = {"default", "joint", "site"}
_MAKES_BODIES: Final = {"attach", "composite", "flexcomp", "replicate"}
_REFERENCES: Final = ("material", "user", "plugin")
_COMPILER: Final = ("angle", "autolimits", "eulerseq")
_COUPLINGS: Final = ("equality", "tendon")


@dataclass(frozen=True)
class HandFile:
    """A hand model as a file gives it.

    Attributes
    ----------
    hand : HandModel
        The hand, with the markers of the marker set.
    placements : mapping of str to MarkerPlacement
        Where each marker sits: where the file has it, else as the marker set says.
    notes : tuple of str
        What of the file plays no part in tracking although it bears on movement.
    """

    hand: HandModel
    placements: Mapping[str, MarkerPlacement]
    notes: tuple[str, ...] = ()


def load_hand(
    path: Path, side: Side, markers: Mapping[str, MarkerPlacement], mirrored: bool = False
) -> HandFile:
    """Load a hand model from a MJCF file.

    It must have the 20 sites of `SITES`, each the centre of a sphere and its size the radius; one
    free joint, at the root, which carries all of them; and any number of hinges. A marker is the
    site ``marker_<label>``; one that is missing there is put onto the body that the marker set
    names, where it gives an offset or leaves it to calibration.

    Parameters
    ----------
    path : Path
        The file.
    side : Side
        Which hand it shall be.
    markers : mapping of str to MarkerPlacement
        The marker set.
    mirrored : bool
        Whether the file shows the other hand, so that its mirror image (y reversed) is wanted.

    Returns
    -------
    HandFile
        The hand, and what was left out of it.

    Raises
    ------
    HandFileError
        With the file, what is wrong with it and what to do.
    """
    root, _ = _expanded(path)
    notes = tuple(
        f"{path.name}: its {part} elements are left out, so joints that they couple move freely"
        for part in _COUPLINGS
        if len(root.findall(part)) and any(len(found) for found in root.findall(part))
    )
    mjcf = ElementTree.tostring(_kinematics_only(path, root), encoding="unicode")
    try:
        source = mujoco.MjModel.from_xml_string(mjcf)
    except ValueError as error:
        raise HandFileError(path, f"MuJoCo cannot compile it: {error}", "Mend the MJCF.") from error
    spec = _skeleton(source, f"{side} hand from {path.name}", mirrored)
    placements = _add_markers(path, spec, markers)
    spec.compile()
    try:
        hand = HandModel(side=side, mjcf=spec.to_xml(), markers=tuple(markers), foreign=True)
        _check(hand)
    except HandModelError as error:
        raise HandFileError(path, error.found, error.remedy) from error
    return HandFile(hand, placements, notes)


def hand_files(path: Path) -> tuple[Path, ...]:
    """Return a model's file and all that it includes; the file alone where it cannot be read."""
    try:
        return _expanded(path)[1]
    except HandFileError:
        return (path,)


def _expanded(path: Path) -> tuple[ElementTree.Element, tuple[Path, ...]]:
    """Return the XML with its includes in place, and every file that was read."""
    files: list[Path] = []
    root = _read(path, path, files)
    if root.tag != "mujoco":
        raise HandFileError(
            path, f"its root is <{root.tag}>, not <mujoco>", "Give a MJCF file; MuJoCo converts URDF to it."
        )
    return root, tuple(files)


def _read(main: Path, path: Path, files: list[Path]) -> ElementTree.Element:
    if path in files:
        raise HandFileError(main, f"{path.name} is included twice", "Include each file once.")
    files.append(path)
    try:
        if len(files) > MOST_FILES or sum(file.stat().st_size for file in files) > LARGEST_FILES:
            found = f"it and its includes are more than {MOST_FILES} files or {LARGEST_FILES:,} bytes"
            raise HandFileError(main, found, "Keep bodies, joints and sites only.")
        data = path.read_bytes()
    except OSError as error:
        raise HandFileError(main, f"{path.name} cannot be read ({error.strerror})", "Check it.") from error
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise HandFileError(main, f"{path.name} declares entities", "Take its DOCTYPE out.")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise HandFileError(main, f"{path.name} is no well-formed XML ({error})", "Mend it.") from error
    _include(main, root, files)
    return root


def _include(main: Path, element: ElementTree.Element, files: list[Path]) -> None:
    """Put the content of included files in the place of each include, as MuJoCo does."""
    children: list[ElementTree.Element] = []
    for child in element:
        if child.tag == "include":
            children.extend(_read(main, _beside(main, child.get("file", "")), files))
        else:
            _include(main, child, files)
            children.append(child)
    element[:] = children


def _beside(main: Path, name: str) -> Path:
    folder = main.parent.resolve()
    try:
        file = (folder / name).resolve()
        absolute = Path(name).is_absolute() or bool(PureWindowsPath(name).drive)
        if not absolute and file.is_relative_to(folder) and file.is_file():
            return file
    except (OSError, RuntimeError, ValueError):  # over-long names, loops of links, NUL
        pass
    raise HandFileError(
        main,
        f"it includes {name!r}, which is no file in its folder or below",
        "Put what it includes beside it.",
    )


def _kinematics_only(path: Path, root: ElementTree.Element) -> ElementTree.Element:
    """Return a model with bodies, joints, sites and their defaults, and nothing that names a file."""
    kept = ElementTree.Element("mujoco")
    for compiler in root.findall("compiler"):
        settings = {name: value for name, value in compiler.items() if name in _COMPILER}
        ElementTree.SubElement(kept, "compiler", settings)
    # Bodies without geoms have no mass of their own, and MuJoCo compiles no massless moving body.
    ElementTree.SubElement(kept, "compiler", {"boundmass": "1e-3", "boundinertia": "1e-6"})
    # MuJoCo's own default is 5 mm: a sphere whose size was forgotten must not pass for one.
    ElementTree.SubElement(ElementTree.SubElement(kept, "default"), "site", {"size": "1e-4"})
    kept.extend([_copy(path, part, _IN_DEFAULT) for part in root.findall("default")])
    kept.extend([_copy(path, part, _IN_BODY) for part in root.findall("worldbody")])
    return kept


def _copy(path: Path, element: ElementTree.Element, wanted: set[str]) -> ElementTree.Element:
    attributes = {name: value for name, value in element.items() if name not in _REFERENCES}
    copied = ElementTree.Element(element.tag, attributes)
    for child in element:
        if child.tag in _MAKES_BODIES:
            raise HandFileError(
                path, f"it has <{child.tag}>", "Write its bodies out: MuJoCo saves a compiled model as such."
            )
        if child.tag in wanted:
            copied.append(_copy(path, child, wanted))
    return copied


def _skeleton(source: mujoco.MjModel, name: str, mirrored: bool) -> mujoco.MjSpec:
    """Return the bodies, joints and sites of a compiled model, or of its mirror image at y = 0.

    A mirror turns a rotation of angle a about axis (x, y, z) into one of a about (-x, y, -z), so
    the image has the same joint angles.
    """
    place = np.array([1.0, -1.0, 1.0]) if mirrored else np.ones(3)
    axis = -place if mirrored else place
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-3, 1e-6
    spec.option.gravity = [0, 0, 0]
    bodies = {0: spec.worldbody}
    for i in range(1, source.nbody):
        quaternion = source.body_quat[i] * np.array([1.0, *axis])
        parent = bodies[int(source.body_parentid[i])]
        bodies[i] = parent.add_body(
            name=source.body(i).name or f"body_{i}", pos=source.body_pos[i] * place, quat=quaternion
        )
    for i in range(source.njnt):
        bodies[int(source.jnt_bodyid[i])].add_joint(
            name=source.joint(i).name or f"joint_{i}",
            type=mujoco.mjtJoint(source.jnt_type[i]),
            pos=source.jnt_pos[i] * place,
            axis=source.jnt_axis[i] * axis,
            limited=int(source.jnt_limited[i]),
            range=source.jnt_range[i],
            ref=_reference(source, i),
        )
    for i in range(source.nsite):
        bodies[int(source.site_bodyid[i])].add_site(
            name=source.site(i).name or f"site_{i}",
            pos=source.site_pos[i] * place,
            size=[source.site_size[i, 0], 0, 0],
            rgba=source.site_rgba[i],
            group=1 if source.site(i).name.startswith(MARKER_PREFIX) else 0,
        )
    return spec


def _reference(source: mujoco.MjModel, joint: int) -> float:
    free = source.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
    return 0.0 if free else float(source.qpos0[source.jnt_qposadr[joint]])


def _add_markers(
    path: Path, spec: mujoco.MjSpec, markers: Mapping[str, MarkerPlacement]
) -> dict[str, MarkerPlacement]:
    """Add the markers that the file has no site for, where the marker set says enough; say where all are."""
    placements = {}
    for label, placement in markers.items():
        name = MARKER_PREFIX + label
        site, body = spec.site(name), spec.body(placement.segment)
        if site is not None:
            x, y, z = (float(part) for part in site.pos)
            placements[label] = MarkerPlacement(site.parent.name, offset=(x, y, z))
            continue
        if placement.at is not None or body is None:
            names = [found.name for found in spec.bodies][1:]
            found = f"it has no site {name}"
            if body is None:
                found += f", and no body {placement.segment}{nearest(placement.segment, names)}"
            raise HandFileError(
                path,
                found,
                f"Add a site {name} where that marker sits, or give the marker in marker_set a segment "
                "that is one of the model's bodies and an offset (or offset: calibrate).",
            )
        position = (0.0, 0.0, 0.0) if placement.offset is None else placement.offset
        body.add_site(name=name, pos=position, size=[0.002, 0, 0], rgba=[0.1, 0.3, 0.9, 1], group=1)
        placements[label] = placement
    return placements


def _check(hand: HandModel) -> None:
    """Refuse what would be followed as a wrong hand."""
    model = hand.mujoco_model
    if not 6 < hand.n_dof <= MOST_DOFS:
        found = f"it has {hand.n_dof - 6} hinges"
        raise HandModelError(found, f"A hand has 1 to {MOST_DOFS - 6} of them.")
    root = model.body_rootid[model.jnt_bodyid[0]]
    loose = list(_elsewhere(hand, int(root)))
    if loose:
        raise HandModelError(
            f"{', '.join(loose)} do not move with the body that has the free joint",
            "Hang all bodies of the hand below that one.",
        )
    flat = [site for site, radius in zip(SITES, hand.radii, strict=True) if not 0.0005 <= radius <= 0.05]
    if flat:
        raise HandModelError(
            f"the sites {', '.join(flat)} are not 0.5 to 50 mm large",
            "Give each site its sphere's radius in metres as size.",
        )
    low, high = PLAUSIBLE_SPAN
    span = _span(hand.forward(hand.neutral()).sites)
    if not low <= span <= high:
        raise HandModelError(
            f"its sites lie up to {span:.3g} m apart, and a hand's are {low:g} to {high:g} m",
            "Write the model in metres.",
        )


def _elsewhere(hand: HandModel, root: int) -> Iterator[str]:
    model = hand.mujoco_model
    for joint in range(1, model.njnt):
        if model.body_rootid[model.jnt_bodyid[joint]] != root:
            yield f"joint {model.joint(joint).name}"
    for i in (*hand.site_ids, *hand.marker_ids):
        if model.body_rootid[model.site_bodyid[i]] != root:
            yield f"site {model.site(int(i)).name}"


def _span(sites: Floats) -> float:
    return float(np.linalg.norm(sites[:, None] - sites[None], axis=2).max())
