"""Opposition, virtual fingers and grasp types of hands made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.contact import Contacts
from graspdb_ingest.opposition import contact_surfaces, find_opposition
from graspdb_ingest.surface import HandPoints
from graspdb_ingest.surface.touch import pad_of
from graspdb_ingest.taxonomy import LEAST_CONFIDENCE, grasp_type
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, FINGERS, SEGMENTS_OF_DIGIT, SITES, Side


def flat_sites(side=Side.RIGHT):
    """Return a hand with straight fingers along x, the index at greater y; the thumb lies below them.

    Its wrist is the origin, and its back looks along z.
    """
    mirror = 1 if side is Side.RIGHT else -1
    sites = np.zeros((20, 3))
    sites[:4] = [[0, 0.03, -0.01], [0.03, 0.03, -0.03], [0.06, 0.02, -0.04], [0.08, 0.01, -0.045]]
    for i, y in enumerate((0.03, 0.01, -0.01, -0.03)):
        sites[4 * (i + 1) : 4 * (i + 2)] = [[0.04 + 0.025 * k, y, 0] for k in range(4)]
    return sites * [1, mirror, 1]


def touch(sites, pushes, side=Side.RIGHT, reach=0.008):
    """Return contacts at `reach` from the sites in the directions in which they push the object."""
    names = sorted(pushes, key=SITES.index)
    index = np.array([SITES.index(name) for name in names], dtype=np.int64)
    ways = np.array([pushes[name] for name in names], dtype=float).reshape(-1, 3)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    hand = hand_of(sites, side, reach)
    segments = tuple(segment_of(site) for site in index)
    pads = tuple(pad_of(hand, segment, way) for segment, way in zip(segments, ways, strict=True))
    nowhere = np.zeros(len(index), dtype=np.int64)
    return Contacts(index, nowhere, sites[index] + reach * ways, -ways, np.zeros(len(index)), segments, pads)


def hand_of(sites, side=Side.RIGHT, reach=0.008):
    return HandPoints(np.vstack([np.zeros(3), sites]), np.full(20, reach), side)


def segment_of(site):
    """Return the segment that ends at a site; a knuckle is the hand's."""
    digit, place = DIGIT_OF_SITE[site], site % 4
    return "hand" if not place else SEGMENTS_OF_DIGIT[digit][place - 1]


def opposed(pushes, sites=None, side=Side.RIGHT):
    contacts = touch(flat_sites(side) if sites is None else sites, pushes, side)
    return contacts, find_opposition(contacts)


def pinch(*fingers):
    """Return sites with the thumb's tip 30 mm below the middle of the fingers' tips, and how they push."""
    sites = flat_sites()
    tips = [SITES.index(f"{finger}_tip") for finger in fingers]
    sites[SITES.index("thumb_tip")] = sites[tips].mean(axis=0) - [0, 0, 0.03]
    return {"thumb_tip": [0, 0, 1], **{f"{finger}_tip": [0, 0, -1] for finger in fingers}}, sites


@pytest.mark.parametrize("fingers", [("index",), ("index", "middle"), ("index", "middle", "ring")])
def test_thumb_against_finger_pads_is_pad_opposition(fingers):
    _, found = opposed(*pinch(*fingers))
    assert found.kind == "pad"
    assert found.virtual_fingers == (("thumb",), fingers, ())
    assert found.shares == {"pad": 1, "palm": 0, "side": 0}


@pytest.mark.parametrize("side", list(Side))
def test_thumb_against_the_side_of_the_index_is_side_opposition(side):
    out = 1 if side is Side.RIGHT else -1
    sites = flat_sites(side)
    sites[SITES.index("thumb_tip")] = sites[SITES.index("index_dip")] + [0, 0.03 * out, 0]
    contacts, found = opposed({"thumb_tip": [0, -out, 0], "index_dip": [0, out, 0]}, sites, side)
    assert contact_surfaces(contacts) == ("thumb", "radial")
    assert found.kind == "side"
    assert found.virtual_fingers == (("thumb",), ("index",), ())
    assert grasp_type(contacts, found, hand_of(sites, side)).name == "lateral"


def fist(across=0.04):
    """Return fingers that come back towards the palm from below, `across` away, and how all push."""
    sites = flat_sites()
    pushes = {}
    for finger in FINGERS:
        first = SITES.index(f"{finger}_mcp")
        x, y, z = sites[first]
        sites[first + 1] = [x + 0.02, y, z - across / 2]
        sites[first + 2] = [x + 0.01, y, z - across]
        sites[first + 3] = [x, y, z - across]
        pushes |= {f"{finger}_mcp": [0, 0, -1], f"{finger}_pip": [-1, 0, 0], f"{finger}_tip": [0, 0, 1]}
    return pushes, sites


def test_fingers_against_the_palm_are_palm_opposition():
    _, found = opposed(*fist())
    assert found.kind == "palm"
    assert found.virtual_fingers == (("palm",), FINGERS, ())


def test_a_thumb_that_only_touches_helps():
    pushes, sites = fist()
    _, found = opposed(pushes | {"thumb_ip": [0, -1, 0]}, sites)
    assert found.virtual_fingers == (("palm",), FINGERS, ("thumb",))


def test_two_fingers_squeezing_between_them_are_side_opposition():
    sites = flat_sites()
    contacts, found = opposed({"index_dip": [0, -1, 0], "middle_dip": [0, 1, 0]}, sites)
    assert found.kind == "side"
    assert found.virtual_fingers == (("index",), ("middle",), ())
    assert grasp_type(contacts, found, hand_of(sites)).name == "adduction grip"


@pytest.mark.parametrize(
    "pushes", [{}, {"thumb_tip": [0, 0, 1]}, {"index_tip": [0, 0, -1], "middle_tip": [0, 0, -1]}]
)
def test_what_does_not_oppose_has_no_opposition_and_no_type(pushes):
    contacts, found = opposed(pushes)
    hand = hand_of(flat_sites())
    assert found.kind is None
    assert found.virtual_fingers[:2] == ((), ())
    assert found.virtual_fingers[2] == contacts.digits
    typed = grasp_type(contacts, found, hand)
    assert (typed.name, typed.confidence) == (None, None)


def test_dorsal_contacts_are_told_from_pads():
    sites = flat_sites()
    contacts = touch(sites, {"index_dip": [0, 0, 1], "middle_dip": [0, 0, -1], "ring_dip": [0, -1, 0.2]})
    assert contact_surfaces(contacts) == ("dorsal", "pad", "ulnar")


@pytest.mark.parametrize(
    ("fingers", "name"),
    [
        (("index",), "palmar pinch"),
        (("index", "middle"), "prismatic 2 finger"),
        (("index", "middle", "ring"), "prismatic 3 finger"),
        (FINGERS, "prismatic 4 finger"),
    ],
)
def test_pinches_with_fingers_side_by_side(fingers, name):
    pushes, sites = pinch(*fingers)
    contacts, found = opposed(pushes, sites)
    typed = grasp_type(contacts, found, hand_of(sites))
    assert typed.name == name
    assert LEAST_CONFIDENCE <= typed.confidence < 1


def test_fingers_round_a_ball_are_a_tripod():
    sites = flat_sites()
    angle = np.deg2rad([180, 40, -40])
    ways = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    names = ("thumb_tip", "index_tip", "middle_tip")
    for name, way in zip(names, ways, strict=True):
        sites[SITES.index(name)] = 0.03 * way + [0.1, 0, -0.04]
    # the fingers come from above, bent by a right angle, so that their pads look back at the thumb
    for name in names[1:]:
        for back in (1, 2):
            tip = sites[SITES.index(name)]
            sites[SITES.index(name) - back] = tip + np.array([0, 0, 0.02 * back])
    _, found = opposed({name: -way for name, way in zip(names, ways, strict=True)}, sites)
    assert found.kind == "pad"
    assert found.virtual_fingers[:2] == (("thumb",), ("index", "middle"))


@pytest.mark.parametrize(
    ("across", "name"), [(0.036, "small diameter"), (0.06, "medium wrap"), (0.1, "large diameter")]
)
def test_wraps_differ_by_size(across, name):
    pushes, sites = fist(across)
    # the thumb comes round the other side and presses against the fingers' pads
    sites[SITES.index("thumb_tip")] = sites[SITES.index("index_tip")] + [0, 0, across + 0.01]
    contacts, found = opposed(pushes | {"thumb_tip": [0, 0, -1]}, sites)
    assert found.kind == "palm"
    assert grasp_type(contacts, found, hand_of(sites)).name == name


def test_opposition_mirrors_with_the_side():
    pushes, sites = pinch("index", "middle")
    mirror = np.array([1, -1, 1])
    _, here = opposed(pushes, sites)
    _, there = opposed({name: way * mirror for name, way in pushes.items()}, sites * mirror, Side.LEFT)
    assert here == there


def test_opposition_turns_with_the_hand():
    contacts, here = opposed(*pinch("index", "middle"))
    turn = Rotation.from_rotvec([0.3, -0.5, 1.2]).as_matrix()
    positions, normals = contacts.positions @ turn.T + 0.2, contacts.normals @ turn.T
    there = find_opposition(replace(contacts, positions=positions, normals=normals))
    assert there.virtual_fingers == here.virtual_fingers
    assert there.shares == pytest.approx(here.shares)
