"""A manifest becomes a session in SI units, or says everything that is wrong with it."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator

from graspdb_schemas.errors import ManifestError, ParameterError, Problem
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.manifest_schema import session_schema
from graspdb_schemas.units import METRES_PER, metres_per
from graspdb_schemas.vocabulary import FOREARM_MARKERS, SEGMENT_OF_SITE, SITES, Side

GOOD: dict[str, Any] = {
    "graspdb_session": 1,
    "id": "reach-2011",
    "units": "mm",
    "up": [0, 0, 2],
    "marker_set": "forearm4-dorsal20",
    "marker_names": {"T_CMC": "thumb_cmc"},
    "subjects": {
        "s1": {
            "hand": "right",
            "hand_length": 187,
            "hand_breadth": 84,
            "joint_thickness": {"index_pip": 17.5},
            "calibration": ["trials/rom.c3d"],
        }
    },
    "objects": {
        "mug": {
            "mesh": "objects/mug.stl",
            "mesh_units": "cm",
            "markers": {"mug_1": [12.0, 30.1, 55.2], "mug_2": [-40, 0, 10], "mug_3": [0, 41, 0]},
            "mass": 0.31,
            "category": "mug",
        }
    },
    "trials": [
        {"file": "trials/s1_mug_1.c3d", "subject": "s1", "object": "mug", "task": "lift", "repetition": 1}
    ],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a session's folder with the files that `GOOD` names."""
    session = tmp_path / "session"
    for name in ("trials/rom.c3d", "trials/s1_mug_1.c3d", "objects/mug.stl", "trials/extra.csv"):
        file = session / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"x")
    return session


def write(folder: Path, manifest: object) -> Path:
    file = folder / "session.yaml"
    file.write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
    return file


def changed(path: str, value: Any) -> dict[str, Any]:
    """Return the good manifest with one key set, or taken away where the value is `...`."""
    manifest = copy.deepcopy(GOOD)
    place: Any = manifest
    *parents, last = (int(part) if part.isdigit() else part for part in path.split("/"))
    for part in parents:
        place = place[part]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return manifest


def problems_of(folder: Path, manifest: object) -> list[Problem]:
    write(folder, manifest)
    with pytest.raises(ManifestError) as caught:
        parse_manifest(folder)
    assert str(folder / "session.yaml") in str(caught.value)
    return list(caught.value.problems)


def test_a_good_manifest_is_read_in_metres_and_absolute_paths(folder: Path) -> None:
    write(folder, GOOD)
    session = parse_manifest(folder)
    assert session == parse_manifest(folder / "session.yaml")
    assert (session.id, session.up, session.file_scale) == ("reach-2011", (0, 0, 1), 0.001)
    subject, thing, trial = session.subjects["s1"], session.objects["mug"], session.trials[0]
    assert subject.sides == (Side.RIGHT,)
    assert (subject.hand_length, subject.hand_breadth) == pytest.approx((0.187, 0.084))
    assert subject.joint_thickness == pytest.approx({"index_pip": 0.0175})
    assert subject.calibration == ((folder / "trials/rom.c3d").resolve(),)
    assert thing.mesh_scale == 0.01
    assert thing.markers["mug_1"] == pytest.approx((0.012, 0.0301, 0.0552))
    assert (thing.mass, thing.category) == (0.31, "mug")
    assert (trial.name, trial.source_file) == ("s1_mug_1", "trials/s1_mug_1.c3d")
    assert trial.file == (folder / "trials/s1_mug_1.c3d").resolve()
    assert (trial.task, trial.repetition, trial.attributes) == ("lift", 1, {})


def test_the_built_in_marker_set_has_four_markers_to_calibrate_and_one_over_each_site(folder: Path) -> None:
    write(folder, changed("marker_set", ...))
    markers = parse_manifest(folder).markers
    assert tuple(markers) == (*FOREARM_MARKERS, *SEGMENT_OF_SITE)
    assert all(markers[label].calibrated and markers[label].segment == "forearm" for label in FOREARM_MARKERS)
    assert all(markers[site].at == site for site in SITES)
    assert all(markers[site].segment == SEGMENT_OF_SITE[site] for site in SITES)


def test_a_table_of_markers_is_a_marker_set(folder: Path) -> None:
    manifest = changed(
        "marker_set",
        {
            "top": {"segment": "hand", "offset": "calibrate"},
            "nail": {"segment": "thumb_distal", "at": "thumb_tip"},
            "plate": {"segment": "forearm", "offset": [10, 0, -5]},
        },
    )
    manifest["marker_names"] = {"M1": "nail"}
    write(folder, manifest)
    session = parse_manifest(folder)
    assert session.marker_set == "custom"
    assert session.markers["top"].calibrated
    assert session.markers["nail"].at == "thumb_tip"
    assert session.markers["plate"].offset == pytest.approx((0.01, 0, -0.005))


@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("dm", 0.1), ("m", 1.0)])
def test_the_same_hand_in_any_unit_is_the_same_hand(folder: Path, unit: str, metres: float) -> None:
    manifest = copy.deepcopy(GOOD)
    manifest["units"] = unit
    subject = manifest["subjects"]["s1"]
    subject |= {"hand_length": 0.187 / metres, "hand_breadth": 0.084 / metres}
    subject["joint_thickness"] = {"index_pip": 0.0175 / metres}
    mug = manifest["objects"]["mug"]
    mug["markers"] = {k: [x * 0.001 / metres for x in v] for k, v in mug["markers"].items()}
    write(folder, manifest)
    session = parse_manifest(folder)
    assert session.subjects["s1"].hand_length == pytest.approx(0.187)
    assert session.subjects["s1"].joint_thickness["index_pip"] == pytest.approx(0.0175)
    assert session.objects["mug"].markers["mug_3"] == pytest.approx((0, 0.041, 0))


def test_gltf_is_in_metres_unless_the_manifest_says_otherwise(folder: Path) -> None:
    (folder / "objects/mug.glb").write_bytes(b"x")
    manifest = changed("objects/mug/mesh", "objects/mug.glb")
    del manifest["objects"]["mug"]["mesh_units"]
    write(folder, manifest)
    assert parse_manifest(folder).objects["mug"].mesh_scale == 1.0


def test_further_keys_of_a_trial_are_attributes_that_json_can_hold(folder: Path) -> None:
    write(folder, GOOD)
    text = (folder / "session.yaml").read_text()
    extra = "  date: 2011-03-26\n  time: 2011-03-26 10:15:00\n  lights: on\n  weights: [1, 2.5, null]\n"
    (folder / "session.yaml").write_text(text + extra)
    session = parse_manifest(folder)
    assert json.loads(json.dumps(session.trials[0].attributes)) == {
        "date": "2011-03-26",
        "time": "2011-03-26 10:15:00",
        "lights": True,
        "weights": [1, 2.5, None],
    }
    assert json.loads(json.dumps(session.raw)) == session.raw


def test_both_hands_and_a_trial_of_one_of_them(folder: Path) -> None:
    manifest = changed("subjects/s1/hand", "both")
    manifest["marker_names"] = {"R1": "right_thumb_cmc", "L1": "left_thumb_cmc", "X": "mug_1"}
    manifest["trials"].append({"file": "trials/rom.c3d", "subject": "s1", "hand": "left"})
    write(folder, manifest)
    session = parse_manifest(folder)
    assert session.subjects["s1"].sides == (Side.RIGHT, Side.LEFT)
    assert session.sides_of(session.trials[0]) == (Side.RIGHT, Side.LEFT)
    assert session.sides_of(session.trials[1]) == (Side.LEFT,)


@pytest.mark.parametrize(
    ("path", "value", "key", "said"),
    [
        ("graspdb_session", 2, "graspdb_session", "1"),
        ("id", "a/b", "id", "letters"),
        ("id", 5, "id", "quotes"),
        ("units", "inch", "units", "mm, cm, dm, m"),
        ("up", [0, 0, 0], "up", "not zero"),
        ("up", [0, 0], "up", "a list of 3"),
        ("up", ["a", 0, 1], "up[0]", "a number"),
        ("trials", ..., "trials", "the recordings"),
        ("trials", [], "trials", "at least 1"),
        ("trials", "none", "trials", "a list"),
        ("subjects", {}, "subjects", "at least 1"),
        ("marker_sets", {}, "marker_sets", "did you mean 'marker_set'"),
        ("marker_set", "forearm4-dorsal2", "marker_set", "did you mean 'forearm4-dorsal20'"),
        ("marker_set", {"a": {"segment": "hand"}}, "marker_set.a", "either at or offset"),
        (
            "marker_set",
            {"a": {"segment": "hand", "at": "thumb_cmc", "offset": "calibrate"}},
            "marker_set.a",
            "not both",
        ),
        (
            "marker_set",
            {"a": {"segment": "hnd", "offset": "calibrate"}},
            "marker_set.a.segment",
            "did you mean 'hand'",
        ),
        (
            "marker_set",
            {"a": {"segment": "hand", "at": "index_tipp"}},
            "marker_set.a.at",
            "did you mean 'index_tip'",
        ),
        (
            "marker_set",
            {"a": {"segment": "hand", "at": "index_tip"}},
            "marker_set.a.segment",
            "index_distal",
        ),
        (
            "marker_set",
            {"a": {"segment": "hand", "offset": "calibrat"}},
            "marker_set.a.offset",
            "did you mean 'calibrate'",
        ),
        ("marker_names/T_CMC", "thumb_cm", "marker_names.T_CMC", "did you mean 'thumb_cmc'"),
        ("subjects/s1/hand", "rigth", "subjects.s1.hand", "did you mean 'right'"),
        ("subjects/s1/hand", ..., "subjects.s1.hand", "the hand that was recorded"),
        ("subjects/s1/hand_lenght", 187, "subjects.s1.hand_lenght", "did you mean 'hand_length'"),
        ("subjects/s1/hand_length", "long", "subjects.s1.hand_length", "a number"),
        ("subjects/s1/hand_length", True, "subjects.s1.hand_length", "a number"),
        ("subjects/s1/hand_length", 0.187, "subjects.s1.hand_length", "0.187 m would do"),
        ("subjects/s1/hand_length", 18.7, "subjects.s1.hand_length", "18.7 cm would do"),
        ("subjects/s1/hand_length", -187, "subjects.s1.hand_length", "above 0"),
        ("subjects/s1/hand_breadth", 190, "subjects.s1.hand_breadth", "less than the hand's length"),
        (
            "subjects/s1/joint_thickness/index_pipp",
            17,
            "subjects.s1.joint_thickness.index_pipp",
            "did you mean 'index_pip'",
        ),
        ("subjects/s1/joint_thickness/index_pip", 175, "subjects.s1.joint_thickness.index_pip", "3 to 60 mm"),
        ("subjects/s1/calibration", ["trials/no.c3d"], "subjects.s1.calibration[0]", "does not exist"),
        ("objects/mug/mesh", "objects/mag.stl", "objects.mug.mesh", "did you mean 'mug.stl'"),
        ("objects/mug/mesh", "objects", "objects.mug.mesh", "not a file"),
        ("objects/mug/mass", 310, "objects.mug.mass", "grams"),
        ("objects/mug/markers/mug_3", ..., "objects.mug.markers", "at least 3"),
        ("objects/mug/markers/mug_3", [1, 2], "objects.mug.markers.mug_3", "a list of 3"),
        ("objects/mug/markers/mug_3", [1e6, 0, 0], "objects.mug.markers.mug_3", "0 to 5000 mm"),
        ("objects/mug/markers/mug_3", [12.0, 30.1, 55.3], "objects.mug.markers", "a place of its own"),
        ("objects/mug/markers/thumb_tip", [5, 5, 5], "objects.mug.markers.thumb_tip", "hand's markers"),
        ("trials/0/subject", "s2", "trials[0].subject", "allowed: s1"),
        ("trials/0/object", "mugg", "trials[0].object", "did you mean 'mug'"),
        ("trials/0/file", "trials/s1_mug_2.c3d", "trials[0].file", "did you mean 's1_mug_1.c3d'"),
        ("trials/0/file", "trials\\s1_mug_1.c3d", "trials[0].file", "separated by '/'"),
        ("trials/0/glove", "trials/no.csv", "trials[0].glove", "does not exist"),
        ("trials/0/reference_contacts", "trials/no.csv", "trials[0].reference_contacts", "does not exist"),
        ("trials/0/file", "../session/trials/rom.c3d", "trials[0].file", "climbs"),
        ("trials/0/file", "/etc/hostname", "trials[0].file", "absolute"),
        ("trials/0/file", "C:\\data\\a.c3d", "trials[0].file", "absolute"),
        ("trials/0/repetition", 1.5, "trials[0].repetition", "a whole number"),
        ("trials/0/start", -1, "trials[0].start", "0 or more"),
        ("trials/0/hand", "left", "trials[0].hand", "the hand of subject s1"),
    ],
)
def test_a_bad_value_is_named_with_its_key_and_what_is_allowed(
    folder: Path, path: str, value: Any, key: str, said: str
) -> None:
    problems = problems_of(folder, changed(path, value))
    lines = [str(problem) for problem in problems if problem.key == key]
    assert lines, problems
    assert any(said in line for line in lines), lines


def test_one_wrong_value_is_one_problem(folder: Path) -> None:
    for path, value in (("units", "inch"), ("trials/0/subject", "s2"), ("subjects/s1/hand_length", 0.187)):
        wrong = [problem.key for problem in problems_of(folder, changed(path, value))]
        assert len(wrong) <= (2 if path.endswith("length") else 1)


def test_all_problems_are_reported_at_once(folder: Path) -> None:
    manifest = changed("units", "ft")
    manifest["up"] = [0, 0, 0]
    manifest["subjects"]["s1"]["hand"] = "third"
    manifest["objects"]["mug"]["colour"] = "red"
    manifest["trials"][0] |= {"object": "jug", "start": 3, "end": 3, "glove": "no.csv"}
    keys = {problem.key for problem in problems_of(folder, manifest)}
    assert keys == {
        "units",
        "up",
        "subjects.s1.hand",
        "objects.mug.colour",
        "trials[0].object",
        "trials[0].start",
        "trials[0].glove",
    }


def test_markers_on_a_line_are_refused_however_it_lies(folder: Path) -> None:
    line = {f"m{i}": [10.0 * i, -7.0 * i + 3, 2.0 * i] for i in range(4)}
    problems = problems_of(folder, changed("objects/mug/markers", line))
    assert [(p.key, p.found) for p in problems] == [("objects.mug.markers", "markers on one line")]


def test_two_trials_of_one_name_are_refused(folder: Path) -> None:
    (folder / "other").mkdir()
    (folder / "other/s1_mug_1.trc").write_bytes(b"x")
    manifest = copy.deepcopy(GOOD)
    manifest["trials"].append({"file": "other/s1_mug_1.trc", "subject": "s1"})
    (problem,) = problems_of(folder, manifest)
    assert problem.key == "trials[1].file"
    assert "trials[0].file" in problem.found


def test_a_link_that_leads_out_is_refused_and_one_that_stays_is_not(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.c3d").write_bytes(b"x")
    (folder / "trials/link.c3d").symlink_to(tmp_path / "secret.c3d")
    (folder / "trials/inside.c3d").symlink_to(folder / "trials/rom.c3d")
    (problem,) = problems_of(folder, changed("trials/0/file", "trials/link.c3d"))
    assert "leads to" in problem.found
    write(folder, changed("trials/0/file", "trials/inside.c3d"))
    assert parse_manifest(folder).trials[0].file == (folder / "trials/rom.c3d").resolve()


def test_files_may_lie_under_the_data_root(folder: Path, tmp_path: Path) -> None:
    root = tmp_path / "root"
    (root / "day1").mkdir(parents=True)
    (root / "day1/a.c3d").write_bytes(b"x")
    manifest = changed("trials/0/file", "day1/a.c3d")
    assert problems_of(folder, manifest)[0].key == "trials[0].file"
    session = parse_manifest(folder, root)
    assert session.trials[0].file == (root / "day1/a.c3d").resolve()
    assert session.objects["mug"].mesh == (folder / "objects/mug.stl").resolve()
    with pytest.raises(ParameterError):
        parse_manifest(folder, root / "nowhere")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\n  b: 2\n", "line 2"),
        ("a: [1, 2\n", "line 2"),
        ("\tid: x\n", "line 1"),
        ("", "nothing"),
        ("just text", "a table"),
        ("a: !!python/object/apply:os.getcwd []\n", "line 1"),
        ("a: &a [*a]\n", "without end"),
        ("id: x\nup: 1\nid: y\n", "line 1 and in line 3"),
        ("subjects:\n  s1: {hand: right}\n  s1: {hand: left}\n", "line 2 and in line 3"),
        ("a: .nan\n", "a finite number"),
        ("subjects: {1: {hand: right}}\n", "put it in quotes"),
        ("a: !!binary aGVsbG8=\n", "bytes"),
        ("id: x\nup: !!timestamp tomorrow\n", "line 2, column 5: .*'tomorrow' is no timestamp"),
        ("a: !!bool maybe\n", "'maybe' is no bool"),
        ("a: !!int ''\n", "empty text is no int"),
        ("a: 0b_\n", "'0b_' is no int"),
        ("a: " + "[" * 3000 + "]" * 3000, "recursion"),
    ],
)
def test_what_is_no_plain_yaml_is_said_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "session.yaml"
    file.write_text(text)
    with pytest.raises(ManifestError, match=said):
        parse_manifest(file)


def test_aliases_that_multiply_stop_soon(tmp_path: Path) -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    (tmp_path / "session.yaml").write_text("\n".join(lines))
    with pytest.raises(ManifestError, match="larger than any session"):
        parse_manifest(tmp_path)


def test_bytes_and_missing_files_are_no_manifest(tmp_path: Path) -> None:
    with pytest.raises(ManifestError, match="no such file"):
        parse_manifest(tmp_path)
    (tmp_path / "session.yaml").write_bytes(b"\xff\x00\xfe")
    with pytest.raises(ManifestError, match="UTF-8"):
        parse_manifest(tmp_path)


def test_the_schema_is_one_and_knows_the_words_of_the_vocabulary() -> None:
    schema = session_schema()
    Draft202012Validator.check_schema(schema)
    definitions = schema["$defs"]
    assert tuple(definitions["placement"]["properties"]["at"]["enum"]) == SITES
    assert tuple(definitions["subject"]["properties"]["joint_thickness"]["propertyNames"]["enum"]) == SITES
    assert schema["properties"]["units"]["enum"] == list(METRES_PER)
    for name in ("placement", "subject", "object", "trial"):
        assert all("description" in entry for entry in definitions[name]["properties"].values()), name


def test_units_in_long_and_short() -> None:
    assert metres_per("Millimeters") == metres_per(" MM ") == 0.001
    assert metres_per("metre") == metres_per("Meters") == 1.0
    assert metres_per("parsec") is None


def with_model(folder: Path, model: object, hand: str = "right", **more: object) -> dict[str, Any]:
    (folder / "hands").mkdir(exist_ok=True)
    (folder / "hands/monkey.xml").write_text("<mujoco/>")
    manifest = copy.deepcopy(GOOD)
    manifest["subjects"]["s1"] = {"hand": hand, "model": model, **more}
    return manifest


def test_a_subject_may_bring_a_model_of_its_hand_instead_of_measures(folder: Path) -> None:
    manifest = with_model(folder, "hands/monkey.xml")
    manifest["marker_set"] = {"a": {"segment": "any_body", "offset": [1, 2, 3]}}
    del manifest["marker_names"]
    write(folder, manifest)
    subject = parse_manifest(folder).subjects["s1"]
    assert subject.models == {Side.RIGHT: (folder / "hands/monkey.xml").resolve()}
    assert (subject.hand_length, subject.hand_breadth) == (None, None)


def test_a_model_of_one_hand_stands_for_both(folder: Path) -> None:
    write(folder, with_model(folder, {"left": "hands/monkey.xml"}, hand="both", hand_length=70))
    subject = parse_manifest(folder).subjects["s1"]
    assert subject.sides == (Side.RIGHT, Side.LEFT)
    assert tuple(subject.models) == (Side.LEFT,)
    assert subject.hand_length == pytest.approx(0.07)


@pytest.mark.parametrize(
    ("model", "hand", "more", "key", "words"),
    [
        ("hands/ape.xml", "right", {}, "subjects.s1.model", "does not exist"),
        ("../monkey.xml", "right", {}, "subjects.s1.model", "climbs"),
        ({"right": "/etc/hosts"}, "right", {}, "subjects.s1.model.right", "absolute"),
        ("hands/monkey.xml", "both", {}, "subjects.s1.model", "mirror image"),
        ({}, "right", {}, "subjects.s1.model", "at least 1"),
        ({"thumb": "hands/monkey.xml"}, "right", {}, "subjects.s1.model.thumb", "not known"),
        (3, "right", {}, "subjects.s1.model", "text"),
        (
            "hands/monkey.xml",
            "right",
            {"joint_thickness": {"index_pip": 10}},
            "subjects.s1.joint_thickness",
            "sizes",
        ),
    ],
)
def test_a_model_that_cannot_be_meant_is_named(
    folder: Path, model: object, hand: str, more: dict[str, Any], key: str, words: str
) -> None:
    problems = problems_of(folder, with_model(folder, model, hand, **more))
    assert [problem.key for problem in problems] == [key]
    assert words in str(problems[0])


def test_a_segment_that_no_human_hand_has_is_named_where_no_subject_has_a_model(folder: Path) -> None:
    manifest = changed("marker_set", {"a": {"segment": "index_middel", "offset": "calibrate"}})
    manifest["marker_names"] = {}
    (problem,) = problems_of(folder, manifest)
    assert problem.key == "marker_set.a.segment"
    assert "did you mean 'index_middle'" in problem.allowed


def test_a_sessions_glove_says_what_its_files_do_not(folder: Path) -> None:
    manifest = changed("glove", {"units": "deg", "rate": 100, "names": {"T_IPJ": "thumb_ip_flexion"}})
    manifest["trials"][0]["glove"] = "trials/extra.csv"
    write(folder, manifest)
    session = parse_manifest(folder)
    assert (session.glove.units, session.glove.rate) == ("deg", 100)
    assert session.glove.names == {"T_IPJ": "thumb_ip_flexion"}
    assert session.trials[0].glove == (folder / "trials/extra.csv").resolve()


@pytest.mark.parametrize(
    ("glove", "key", "words"),
    [
        ({"units": "degrees"}, "glove.units", "deg, rad"),
        ({"rate": 0}, "glove.rate", "above 0"),
        ({"rate": float("nan")}, "glove.rate", "finite"),
        ({"unit": "deg"}, "glove.unit", "did you mean 'units'"),
        ({"names": {"a": 3}}, "glove.names.a", "text"),
    ],
)
def test_a_glove_that_cannot_be_meant_is_named(folder: Path, glove: object, key: str, words: str) -> None:
    problems = problems_of(folder, changed("glove", glove))
    assert key in [problem.key for problem in problems]
    assert any(words in str(problem) for problem in problems)


@pytest.mark.parametrize(
    "key",
    [
        "subjects/s1/calibration/0",
        "subjects/s1/model",
        "objects/mug/mesh",
        "trials/0/file",
        "trials/0/glove",
        "trials/0/clouds",
        "trials/0/reference_contacts",
    ],
)
@pytest.mark.parametrize(
    "way", ["climbs", "is absolute", "follows a link", "follows a linked folder", "is no path"]
)
def test_no_key_leads_out_of_the_session(folder: Path, tmp_path: Path, key: str, way: str) -> None:
    secret = tmp_path / "secret.c3d"
    secret.write_bytes(b"x")
    (folder / "link.c3d").symlink_to(secret)
    (folder / "linked").symlink_to(tmp_path, target_is_directory=True)
    named = {
        "climbs": "trials/../../secret.c3d",
        "is absolute": str(secret),
        "follows a link": "link.c3d",
        "follows a linked folder": "linked/secret.c3d",
        "is no path": "x\0y",
    }[way]
    problems = problems_of(folder, changed(key, named))
    about = [problem for problem in problems if problem.key.replace("[0]", ".0") == key.replace("/", ".")]
    assert len(about) == 1
    assert "a path inside" in about[0].allowed
