"""Hands that are no human ones, as MJCF files: a macaque's and a robot's with three fingers."""

from pathlib import Path

import numpy as np

from graspdb_schemas.vocabulary import DIGITS, JOINTS_OF_DIGIT

MACAQUE_LENGTHS = {
    "thumb": (0.021, 0.014, 0.010),
    "index": (0.027, 0.016, 0.010),
    "middle": (0.030, 0.018, 0.011),
    "ring": (0.028, 0.017, 0.011),
    "little": (0.023, 0.013, 0.009),
}
MACAQUE_BASES = {
    "thumb": (0.014, 0.013, -0.004),
    "index": (0.042, 0.011, 0.0),
    "middle": (0.043, 0.002, 0.001),
    "ring": (0.040, -0.006, 0.0),
    "little": (0.036, -0.013, -0.002),
}

MACAQUE = """<mujoco model="macaque">
  <compiler angle="degree" eulerseq="xyz" meshdir="/nowhere"/>
  <default>
    <joint limited="true"/>
    <default class="flexion"><joint axis="0.05 1 0.02" range="-10 95"/></default>
    <default class="abduction"><joint axis="0 0.1 1" range="-20 20"/></default>
    <site size="0.004"/>
  </default>
  <asset><mesh name="palm" file="palm.stl"/></asset>
  <worldbody>
    <light pos="0 0 1"/>
    <body name="arm">
      <freejoint name="base"/>
      <geom type="mesh" mesh="palm"/>
      {arm}
      <body name="palm" pos="0.004 0 0">
        <joint name="wrist_roll" axis="1 0 0.1" range="-40 40"/>
        <joint name="wrist_flexion" class="flexion" range="-60 60" ref="10"/>
        {palm}
        <include file="digits.xml"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="wrist_roll"/></actuator>
</mujoco>
"""


def _marker(label: str, place: tuple[float, float, float]) -> str:
    return f'<site name="marker_{label}" pos="{place[0]:.4f} {place[1]:.4f} {place[2]:.4f}"/>'


def _digit(digit: str, spread: float) -> str:
    """Return a chain of three bodies; the thumb has a rolling joint, the little finger one in the palm."""
    joints, lengths = JOINTS_OF_DIGIT[digit], MACAQUE_LENGTHS[digit]
    turn = "20 30 -50" if digit == "thumb" else f"0 0 {spread}"
    text = ""
    for i in reversed(range(3)):
        place = MACAQUE_BASES[digit] if i == 0 else (lengths[i - 1], 0, 0)
        extra = ""
        if i == 0:
            extra = f'<joint name="{digit}_spread" class="abduction"/>'
            if digit == "thumb":
                extra += '<joint name="thumb_roll" axis="1 0 0" range="-30 30"/>'
            if digit == "little":
                extra += '<joint name="little_arch" axis="1 0.2 0" range="-8 15"/>'
        sites = f'<site name="{digit}_{joints[i + 1]}" pos="{lengths[i]} 0 0" size="{0.004 - 0.0005 * i}"/>'
        text = (
            f'<body name="{digit}_{i}" pos="{place[0]} {place[1]} {place[2]}" '
            f'euler="{turn if i == 0 else "0 2 0"}">'
            f'{extra}<joint name="{digit}_{joints[i]}" class="flexion"/>{sites}'
            f"{_marker(f'{digit}_{joints[i + 1]}', (lengths[i] - 0.002, 0, 0.005))}{text}</body>"
        )
    return text


def write_macaque(folder: Path) -> Path:
    """Write ``macaque.xml`` and the file that it includes; a right hand 74 mm long with 25 hinges."""
    folder.mkdir(parents=True, exist_ok=True)
    arm = "".join(
        _marker(f"forearm_{i + 1}", place)
        for i, place in enumerate(
            [(-0.02, 0.010, 0.008), (-0.02, -0.010, 0.008), (-0.05, 0.008, 0.010), (-0.05, -0.009, 0.010)]
        )
    )
    palm = "".join(
        f'<site name="{digit}_{JOINTS_OF_DIGIT[digit][0]}" pos="{x} {y} {z}" size="0.005"/>'
        + _marker(f"{digit}_{JOINTS_OF_DIGIT[digit][0]}", (x, y, z + 0.005))
        for digit, (x, y, z) in MACAQUE_BASES.items()
    )
    fan = dict(zip(DIGITS, (0, 8, 0, -7, -15), strict=True))
    digits = "".join(_digit(digit, fan[digit]) for digit in DIGITS)
    (folder / "digits.xml").write_text(f"<mujocoinclude>{digits}</mujocoinclude>")
    file = folder / "macaque.xml"
    file.write_text(MACAQUE.format(arm=arm, palm=palm))
    return file


def write_robot(folder: Path) -> Path:
    """Write ``robot.xml``: three fingers of four hinges each, which carry the 20 spheres between them."""
    folder.mkdir(parents=True, exist_ok=True)
    sites = [f"{digit}_{joint}" for digit in DIGITS for joint in JOINTS_OF_DIGIT[digit]]
    carried = {0: sites[:8], 1: sites[8:14], 2: sites[14:]}
    fingers = ""
    for finger, angle in enumerate((0.0, 2.1, 4.2)):
        parts = np.array_split(np.array(carried[finger]), 4)
        text = ""
        for link in reversed(range(4)):
            spheres = "".join(
                f'<site name="{site}" pos="{0.01 + 0.012 * i} 0 0" size="0.009"/>'
                for i, site in enumerate(parts[link])
            )
            place = f"{0.04 * np.cos(angle)} {0.04 * np.sin(angle)} 0.03" if link == 0 else "0.035 0 0"
            axis = "0 0 1" if link == 0 else "0 -1 0"
            text = (
                f'<body name="f{finger}_{link}" pos="{place}" euler="0 -0.4 {angle if link == 0 else 0}">'
                f'<joint name="f{finger}_j{link}" axis="{axis}" range="-0.6 1.2"/>{spheres}'
                f"{_marker(f'f{finger}_{link}', (0.02, 0.004, 0.012))}{text}</body>"
            )
        fingers += text
    base = "".join(
        _marker(f"base_{i}", place)
        for i, place in enumerate([(0.03, 0, 0), (-0.02, 0.02, 0), (0, -0.03, 0.02)])
    )
    file = folder / "robot.xml"
    file.write_text(
        f'<mujoco><compiler angle="radian"/><worldbody><body name="base"><freejoint/>{base}{fingers}'
        "</body></worldbody><equality><joint joint1='f0_j3' joint2='f0_j2'/></equality></mujoco>"
    )
    return file


ROBOT_MARKERS = (
    *(f"base_{i}" for i in range(3)),
    *(f"f{finger}_{link}" for finger in range(3) for link in range(4)),
)
