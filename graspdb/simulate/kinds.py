"""Five kinds of grasp for each object: which way the palm faces, what touches, with what posture.

Directions and places are for a right hand in the object's frame; a left hand takes their mirror
image in the plane y = 0, in which every object is symmetric.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from graspdb.simulate.arrays import Floats
from graspdb_schemas.vocabulary import DIGITS, FINGERS, JOINT_ANGLES

Measures = Mapping[str, float]

ALL_TIPS: Final = tuple(f"{digit}_tip" for digit in DIGITS)
Place = tuple[float, float, float]


@dataclass(frozen=True)
class Plan:
    """How one kind of grasp begins, before the hand is fitted to the surface.

    Attributes
    ----------
    kind : str
        Name of the kind.
    palm, fingers : tuple of float
        Directions in which the palm faces and the straight fingers point.
    centre : tuple of float
        Where on the object the grasp is [m].
    contacts : tuple of str
        Sites that are to touch.
    posture : mapping of str to float
        Joint angles [degrees]; those left out are zero.
    focus : tuple of float or None
        The point of the hand that goes to the centre, along x, y and z of the hand [hand lengths];
        None for the middle between the thumb's tip and the other touching tips.
    elevation : float
        Slope of the forearm, the elbow higher than the wrist [degrees].
    aims : mapping of str to tuple of float
        Where particular spheres are to be [m].
    part : int or None
        The part of the object that is to be touched; None for all of it.
    flexed : float
        Share of the fingers' flexion to start from, so that a wrapping hand starts around the object.
    exact : bool
        Whether no other digits may touch.
    """

    kind: str
    palm: Place
    fingers: Place
    centre: Place
    contacts: tuple[str, ...]
    posture: Mapping[str, float]
    focus: Place | None = None
    elevation: float = 10.0
    aims: Mapping[str, Place] = field(default_factory=dict)
    part: int | None = None
    flexed: float = 1.0
    exact: bool = False

    def angles(self) -> Floats:
        """Return the posture in the order of JOINT_ANGLES [rad], shape (23,)."""
        return np.deg2rad([self.posture.get(joint, 0.0) for joint in JOINT_ANGLES])

    def start_angles(self) -> Floats:
        """Return the posture to start from [rad], shape (23,)."""
        share = [self.flexed if joint.split("_")[0] in FINGERS else 1.0 for joint in JOINT_ANGLES]
        return self.angles() * share


def _sites(joints: str, digits: tuple[str, ...] = FINGERS) -> tuple[str, ...]:
    return tuple(f"{digit}_{joint}" for digit in digits for joint in joints.split())


def _fingers(mcp: float, pip: float, dip: float, digits: tuple[str, ...] = FINGERS) -> dict[str, float]:
    return {
        f"{d}_{angle}_flexion": value
        for d in digits
        for angle, value in (("mcp", mcp), ("pip", pip), ("dip", dip))
    }


def _thumb(abduction: float, flexion: float, mcp: float, ip: float) -> dict[str, float]:
    return {
        "thumb_cmc_abduction": abduction,
        "thumb_cmc_flexion": flexion,
        "thumb_mcp_flexion": mcp,
        "thumb_ip_flexion": ip,
    }


POWER: Final = _fingers(45, 50, 30) | _thumb(30, 10, 15, 25) | {"wrist_flexion": -20}
PRECISION: Final = _fingers(45, 35, 15) | _thumb(35, 10, 15, 15) | {"wrist_flexion": -20}
WIDE: Final = _fingers(30, 35, 15) | _thumb(35, -10, 10, 15) | {"wrist_flexion": -15}
PINCH: Final = (
    _fingers(50, 40, 15, ("index", "middle"))
    | _fingers(55, 70, 35, ("ring", "little"))
    | _thumb(35, 15, 15, 15)
    | {"wrist_flexion": -20}
)
HOOK_TWO: Final = (
    _fingers(30, 90, 45, ("index", "middle"))
    | _fingers(25, 45, 25, ("ring", "little"))
    | _thumb(20, 10, 15, 25)
    | {"wrist_flexion": -10}
)
HOOK: Final = _fingers(30, 90, 45) | _thumb(20, 15, 20, 30) | {"wrist_flexion": -10}

LEFTWARDS: Final = (0.0, 1.0, 0.0)
FORWARDS: Final = (1.0, 0.0, 0.0)
DOWNWARDS: Final = (0.0, 0.0, -1.0)
WRAP: Final = (*_sites("pip tip"), "middle_mcp", "ring_mcp", "thumb_ip", "thumb_tip")


def bottle_plans(m: Measures) -> tuple[Plan, ...]:
    """Return the five plans for a bottle with the given measures."""
    palm_depth = (m["radius"] + 0.014) / 0.185
    cap_middle = (m["cap_low"] + m["height"]) / 2
    three = ("thumb_tip", "index_tip", "middle_tip")
    return (
        Plan(
            "side_power",
            LEFTWARDS,
            FORWARDS,
            (0, 0, 0.085),
            WRAP,
            POWER,
            (0.42, -0.02, -palm_depth),
            flexed=0.4,
        ),
        Plan("side_precision", LEFTWARDS, FORWARDS, (0, 0, 0.095), ALL_TIPS, PRECISION),
        Plan("neck", (0, 0.8, -0.6), FORWARDS, (0, 0, 0.165), ALL_TIPS, PRECISION, elevation=20),
        Plan("cap_top", DOWNWARDS, FORWARDS, (0, 0, cap_middle), ALL_TIPS[:4], PINCH, elevation=35),
        Plan("cap_side", (0, 0.8, -0.6), FORWARDS, (0, 0, cap_middle), three, PINCH, elevation=15),
    )


def mug_plans(m: Measures) -> tuple[Plan, ...]:
    """Return the five plans for a mug with the given measures."""
    palm_depth = (m["radius"] + 0.014) / 0.185
    bar = (m["handle_depth"] + 0.019) / 0.185
    rim = (-m["radius"] + m["wall"] / 2, 0, m["height"] - 0.012)
    middle = m["height"] / 2
    hooked = (*_sites("dip tip", ("index", "middle")), "thumb_tip")
    away = (0.0, -1.0, 0.0)
    return (
        Plan(
            "handle",
            (-1, 0, 0),
            LEFTWARDS,
            (m["handle"], 0, m["handle_middle"] + 0.008),
            hooked,
            HOOK_TWO,
            (0.54, 0.055, -bar),
            part=1,
        ),
        Plan("rim", DOWNWARDS, FORWARDS, rim, ("thumb_tip", "index_tip", "middle_tip"), PINCH, elevation=30),
        Plan("top", DOWNWARDS, FORWARDS, (0, 0, m["height"] - 0.010), ALL_TIPS, WIDE, elevation=35),
        Plan(
            "side_power",
            FORWARDS,
            away,
            (0, 0, middle + 0.005),
            WRAP,
            POWER,
            (0.42, -0.02, -palm_depth),
            flexed=0.4,
        ),
        Plan("side_precision", FORWARDS, away, (0, 0, middle + 0.01), ALL_TIPS, WIDE),
    )


def jug_plans(m: Measures) -> tuple[Plan, ...]:
    """Return the five plans for a milk jug with the given measures."""
    palm_depth = (m["radius"] + 0.014) / 0.185
    bar = (m["handle_depth"] + 0.019) / 0.185
    cap_middle = (m["cap_low"] + m["height"]) / 2
    bar_middle = (m["handle_low"] + m["handle_high"]) / 2 + 0.004
    hooked = (*_sites("dip tip", ("index", "middle", "ring")), "thumb_tip")
    around = (*_sites("tip"), "index_mcp", "middle_mcp", "thumb_tip")
    away = (0.0, -1.0, 0.0)
    return (
        Plan(
            "handle",
            (-1, 0, 0),
            LEFTWARDS,
            (m["handle"], 0, bar_middle),
            hooked,
            HOOK,
            (0.54, -0.04, -bar),
            part=1,
            aims={"thumb_tip": (m["handle"], -0.016, bar_middle + 0.025)},
        ),
        Plan("cap_top", DOWNWARDS, FORWARDS, (0, 0, cap_middle), ALL_TIPS[:4], PINCH, elevation=35),
        Plan("cap_side", (0, 0.8, -0.6), FORWARDS, (0, 0, cap_middle), ALL_TIPS[:3], PINCH, elevation=15),
        Plan(
            "side_power", FORWARDS, away, (0, 0, 0.09), around, WIDE, (0.40, -0.02, -palm_depth), flexed=0.5
        ),
        Plan("side_precision", FORWARDS, away, (0, 0, 0.10), ALL_TIPS, WIDE),
    )


def force_panel_plans(m: Measures) -> tuple[Plan, ...]:
    """Return the four plans for the inverted T: the thumb on one panel, one finger on the other."""
    height = (m["panel_low"] + m["panel_high"]) / 2 + 0.01
    plans = []
    for finger, lower in zip(FINGERS, (0.005, 0.013, 0.02, 0.026), strict=True):
        others = tuple(f for f in FINGERS if f != finger)
        posture = _fingers(40, 35, 15, (finger,)) | _fingers(5, 12, 6, others) | _thumb(35, 10, 15, 15)
        outside = m["half_grip"] + 0.007
        plans.append(
            Plan(
                f"thumb_{finger}",
                (0.9, 0.42, -0.1),
                (0.42, -0.9, 0.0),
                (0, 0, height),
                ("thumb_tip", f"{finger}_tip"),
                posture | {"wrist_flexion": -20},
                elevation=15,
                exact=True,
                aims={
                    "thumb_tip": (0, outside, height + lower),
                    f"{finger}_tip": (0, -outside, height - lower),
                },
            )
        )
    return tuple(plans)


PLANS: Final = {"inverted_t": force_panel_plans, "bottle": bottle_plans, "mug": mug_plans, "jug": jug_plans}
