"""Hands from MJCF files: a macaque's and a robot's become hand models, and what is wrong is said."""

from pathlib import Path

import numpy as np
import pytest
from foreign_hands import MACAQUE_LENGTHS, ROBOT_MARKERS, write_macaque, write_robot
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.foreign import hand_files, load_hand
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.tracking.fit import fit_frame
from graspdb_ingest.tracking.geometry import HandGeometry
from graspdb_schemas.errors import HandFileError
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.manifest_reader import BUILT_IN_MARKERS
from graspdb_schemas.vocabulary import SITES, Side

MIRROR = np.array([1.0, -1.0, 1.0])
ON_BASE = {label: MarkerPlacement("base", offset=(0.0, 0.0, 0.0)) for label in ROBOT_MARKERS}


@pytest.fixture(scope="module")
def macaque_file(tmp_path_factory):
    return write_macaque(tmp_path_factory.mktemp("hands"))


@pytest.fixture(scope="module")
def macaque(macaque_file):
    return load_hand(macaque_file, Side.RIGHT, BUILT_IN_MARKERS).hand


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return load_hand(write_robot(tmp_path_factory.mktemp("robot")), Side.RIGHT, ON_BASE)


def random_configuration(hand, rng):
    q = hand.neutral()
    q[:3] = rng.normal(0, 0.3, 3)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = rng.uniform(*hand.joint_range.T)
    return q


def test_macaque_has_its_own_joints_radii_and_lengths(macaque):
    assert (macaque.n_dof, macaque.n_q) == (30, 31)
    assert macaque.joints[:4] == ("wrist_roll", "wrist_flexion", "thumb_spread", "thumb_roll")
    assert macaque.markers == tuple(BUILT_IN_MARKERS)
    chains = macaque.forward(macaque.neutral()).sites.reshape(5, 4, 3)
    lengths = np.linalg.norm(np.diff(chains, axis=1), axis=2)
    assert np.allclose(lengths, list(MACAQUE_LENGTHS.values()), atol=1e-5)
    assert np.allclose(macaque.radii.reshape(5, 4), [0.005, 0.004, 0.0035, 0.003])


def test_left_macaque_is_the_mirror_image_at_equal_angles(macaque, macaque_file):
    left = load_hand(macaque_file, Side.LEFT, BUILT_IN_MARKERS, mirrored=True).hand
    rng = np.random.default_rng(0)
    assert left.joints == macaque.joints
    assert np.array_equal(left.joint_range, macaque.joint_range)
    for _ in range(10):
        q = macaque.neutral()
        q[7:] = rng.uniform(*macaque.joint_range.T)
        assert np.allclose(macaque.forward(q).sites * MIRROR, left.forward(q).sites, atol=1e-6)
        assert np.allclose(macaque.forward(q).markers * MIRROR, left.forward(q).markers, atol=1e-6)


@pytest.mark.parametrize("which", ["macaque", "left", "robot"])
def test_jacobians_are_the_central_differences(macaque, macaque_file, robot, which):
    hand = {
        "macaque": macaque,
        "left": load_hand(macaque_file, Side.LEFT, BUILT_IN_MARKERS, mirrored=True).hand,
        "robot": robot.hand,
    }[which]
    rng, h = np.random.default_rng(7), 1e-6
    workspace = Kinematics(hand)
    for _ in range(3):
        q = random_configuration(hand, rng)
        poses = [
            [hand.forward(hand.integrate(q, sign * h * unit)) for sign in (1, -1)]
            for unit in np.eye(hand.n_dof)
        ]
        sites = np.stack([(p.sites - m.sites) / (2 * h) for p, m in poses], axis=-1)
        markers = np.stack([(p.markers - m.markers) / (2 * h) for p, m in poses], axis=-1)
        assert np.allclose(hand.site_jacobian(q), sites, atol=1e-8)
        workspace.move(q)
        assert np.allclose(workspace.marker_jacobian(), markers, atol=1e-8)


def test_prior_of_a_foreign_hand_comes_from_its_ranges_even_where_names_are_human(macaque):
    prior = default_prior(macaque)
    low, high = macaque.joint_range.T
    assert np.allclose(prior.mean, (low + high) / 2)
    assert np.allclose(prior.covariance, np.diag(((high - low) / 4) ** 2))


def test_calibration_of_a_foreign_hand_moves_markers_and_no_bones(macaque):
    assert HandGeometry(macaque, BUILT_IN_MARKERS).n_parameters == 3 * len(macaque.markers)


@pytest.mark.parametrize("which", ["macaque", "robot"])
def test_a_frame_is_fitted_from_nowhere(macaque, robot, which):
    hand = macaque if which == "macaque" else robot.hand
    rng = np.random.default_rng(3)
    q = hand.neutral()
    q[:3] = (0.3, -0.2, 1.0)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    low, high = hand.joint_range.T
    q[7:] = (low + high) / 2 + 0.25 * (high - low) * rng.uniform(-1, 1, len(low))
    true = hand.forward(q)
    sd = np.full(len(hand.markers), 0.0005)
    fit = fit_frame(Kinematics(hand), true.markers, default_prior(hand), sd)
    assert np.abs(hand.forward(fit.q).sites - true.sites).max() < 0.001


def test_couplings_are_left_out_with_a_note(robot):
    assert robot.hand.n_dof == 18
    assert "equality" in robot.notes[0]


def test_files_are_the_model_and_all_that_it_includes(macaque_file):
    assert [file.name for file in hand_files(macaque_file)] == ["macaque.xml", "digits.xml"]


def test_a_marker_that_the_file_lacks_is_put_onto_the_body_that_the_marker_set_names(macaque_file):
    extra = {
        "known": MarkerPlacement("index_1", offset=(0.005, 0.001, 0.004)),
        "unknown": MarkerPlacement("palm"),
    }
    file = load_hand(macaque_file, Side.RIGHT, BUILT_IN_MARKERS | extra)
    model = file.hand.mujoco_model
    assert [label for label, place in file.placements.items() if place.calibrated] == ["unknown"]
    assert file.placements["forearm_1"] == MarkerPlacement("arm", offset=(-0.02, 0.01, 0.008))
    assert np.allclose(model.site("marker_known").pos, (0.005, 0.001, 0.004))
    assert model.body(int(model.site("marker_unknown").bodyid[0])).name == "palm"


def change(folder: Path, old: str, new: str, name: str = "macaque.xml") -> Path:
    file = write_macaque(folder)
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new))
    return file


@pytest.mark.parametrize(
    ("name", "old", "new", "complaint"),
    [
        ("digits.xml", 'site name="ring_pip"', 'site name="ring_pipp"', "lacks the sites ring_pip"),
        ("digits.xml", "marker_ring_pip", "ring_marker", "no site marker_ring_pip, and no body ring_prox"),
        ("digits.xml", "<mujocoinclude>", "<mujocoinclude><include file='digits.xml'/>", "included twice"),
        ("macaque.xml", '<freejoint name="base"/>', "", "free joint"),
        (
            "macaque.xml",
            'name="wrist_roll"',
            'type="slide" name="wrist_roll"',
            "free joint followed by hinges",
        ),
        ("macaque.xml", 'class="flexion" range', 'class="no_such" range', "MuJoCo cannot compile"),
        ("macaque.xml", "</mujoco>", "", "no well-formed XML"),
        ("macaque.xml", "<mujoco model", "<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco model", "declares entities"),
        ("macaque.xml", "digits.xml", "../digits.xml", "no file in its folder or below"),
        ("macaque.xml", "digits.xml", "/etc/hosts", "no file in its folder or below"),
        ("macaque.xml", "digits.xml", "", "no file in its folder or below"),
        ("macaque.xml", "<light pos", "<replicate count='2'/><light pos", "it has <replicate>"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_with_its_name(tmp_path, name, old, new, complaint):
    with pytest.raises(HandFileError, match=complaint) as caught:
        load_hand(change(tmp_path, old, new, name), Side.RIGHT, BUILT_IN_MARKERS)
    assert str(caught.value).startswith(str(tmp_path / "macaque.xml"))
    assert caught.value.remedy


def test_a_sphere_without_a_size_is_refused_although_mujoco_has_a_default(tmp_path):
    file = write_macaque(tmp_path)
    for part in (file, tmp_path / "digits.xml"):
        text = part.read_text().replace('<site size="0.004"/>', "").replace(' size="0.003"', "")
        part.write_text(text)
    with pytest.raises(HandFileError, match=r"thumb_tip, index_tip.* are not 0.5 to 50 mm"):
        load_hand(file, Side.RIGHT, BUILT_IN_MARKERS)


def test_a_model_in_millimetres_is_refused(tmp_path):
    file = write_robot(tmp_path)
    file.write_text(file.read_text().replace('pos="0.035 0 0"', 'pos="35 0 0"'))
    with pytest.raises(HandFileError, match="in metres"):
        load_hand(file, Side.RIGHT, ON_BASE)


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    outside = tmp_path / "outside.xml"
    outside.write_text("<mujocoinclude/>")
    file = write_macaque(tmp_path / "hands")
    (file.parent / "digits.xml").unlink()
    (file.parent / "digits.xml").symlink_to(outside)
    with pytest.raises(HandFileError, match="no file in its folder"):
        load_hand(file, Side.RIGHT, BUILT_IN_MARKERS)


def test_all_sites_that_are_missing_are_named_at_once(tmp_path):
    file = write_robot(tmp_path)
    text = file.read_text()
    for site in SITES[16:]:
        text = text.replace(f'name="{site}"', f'name="no_{site}"')
    file.write_text(text)
    with pytest.raises(HandFileError, match="little_mcp, little_pip, little_dip, little_tip"):
        load_hand(file, Side.RIGHT, ON_BASE)
