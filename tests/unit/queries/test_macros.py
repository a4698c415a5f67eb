"""The functions of SQL against numpy and scipy, on numbers made at random, and on what is missing."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from worked_example import build

import graspdb
from graspdb_queries.engine import Engine
from graspdb_queries.macros import macros
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import QueryError
from graspdb_schemas.tables import TABLES
from graspdb_schemas.vocabulary import CONFIGURATION, DIGIT_OF_SITE, DIGITS, DOFS, JOINT_ANGLES, SITES

N = 20
Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    with Engine({name: TableSource() for name in TABLES}) as opened:
        yield opened


def ask(engine: Engine, expression: str, **parameters: Any) -> Any:
    """Evaluate an expression; arrays become lists."""
    plain = {name: np.asarray(value).tolist() for name, value in parameters.items()}
    return engine.sql(f"SELECT {expression}", plain).rows()[0][0]


def rotation(rng: np.random.Generator) -> Array:
    """Return a unit quaternion w x y z; a small one now and then, where rounding hurts most."""
    vector = rng.normal(size=3) * rng.choice([1.0, 1e-6])
    return Rotation.from_rotvec(vector).as_quat(scalar_first=True)


def rigid(rng: np.random.Generator) -> Array:
    """Return a rigid transform."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_quat(rotation(rng), scalar_first=True).as_matrix()
    made[:3, 3] = rng.normal(size=3)
    return made


seeds = given(seed=st.integers(0, 2**32 - 1))
few = settings(max_examples=N)


@few
@seeds
def test_vectors(engine: Engine, seed: int) -> None:
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    assert ask(engine, "norm($a)", a=a) == pytest.approx(np.linalg.norm(a))
    assert ask(engine, "distance($a, $b)", a=a, b=b) == pytest.approx(np.linalg.norm(a - b))
    assert ask(engine, "dot_product($a, $b)", a=a, b=b) == pytest.approx(a @ b)
    np.testing.assert_allclose(ask(engine, "cross_product($a, $b)", a=a, b=b), np.cross(a, b), atol=1e-14)
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    assert ask(engine, "angle_between($a, $b)", a=a, b=b) == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-9, np.pi])
def test_small_and_flat_angles_are_exact(engine: Engine, angle: float) -> None:
    a, b = [1.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0]
    assert ask(engine, "angle_between($a, $b)", a=a, b=b) == pytest.approx(angle, abs=1e-15)
    turned = Rotation.from_rotvec([0, 0, angle])
    quaternion = turned.as_quat(scalar_first=True)
    assert ask(engine, "quaternion_angle([1, 0, 0, 0], $q)", q=quaternion) == pytest.approx(angle, abs=1e-15)
    matrices = {"a": np.eye(4), "b": np.block([[turned.as_matrix(), np.zeros((3, 1))], [0, 0, 0, 1]])}
    assert ask(engine, "transform_angle($a, $b)", **matrices) == pytest.approx(angle, abs=1e-7)


@few
@seeds
def test_quaternions(engine: Engine, seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, q, v = rotation(rng), rotation(rng), rng.normal(size=3)
    first, second = (Rotation.from_quat(x, scalar_first=True) for x in (p, q))
    np.testing.assert_allclose(ask(engine, "quaternion_rotate($p, $v)", p=p, v=v), first.apply(v), atol=1e-14)
    product = (first * second).as_quat(scalar_first=True)
    found = np.array(ask(engine, "quaternion_multiply($p, $q)", p=p, q=q))
    np.testing.assert_allclose(found * np.sign(found @ product), product, atol=1e-14)
    np.testing.assert_array_equal(ask(engine, "quaternion_inverse($p)", p=p), p * [1, -1, -1, -1])
    angle = (first.inv() * second).magnitude()
    for other in (q, -q):
        assert ask(engine, "quaternion_angle($p, $q)", p=p, q=other) == pytest.approx(angle, abs=1e-12)


@few
@seeds
def test_transforms(engine: Engine, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, v, q = rigid(rng), rigid(rng), rng.normal(size=3), rotation(rng)

    def check(expression: str, wanted: Array, **parameters: Any) -> None:
        np.testing.assert_allclose(ask(engine, expression, **parameters), wanted, atol=1e-14)

    made = np.eye(4)
    made[:3, :3], made[:3, 3] = Rotation.from_quat(q, scalar_first=True).as_matrix(), v
    check("transform_from($v, $q)", made, v=v, q=q)
    check("transform_point($a, $v)", a[:3, :3] @ v + a[:3, 3], a=a, v=v)
    check("transform_vector($a, $v)", a[:3, :3] @ v, a=a, v=v)
    check("transform_inverse($a)", np.linalg.inv(a), a=a)
    check("transform_compose($a, $b)", a @ b, a=a, b=b)
    check("transform_position($a)", a[:3, 3], a=a)
    check("transform_compose($a, transform_inverse($a))", np.eye(4), a=a)
    angle = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude()
    assert ask(engine, "transform_angle($a, $b)", a=a, b=b) == pytest.approx(angle, abs=1e-7)


@few
@seeds
def test_arrays_are_decoded_by_name(engine: Engine, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, sd, gap, sites = (
        rng.normal(size=30),
        rng.normal(size=29),
        rng.normal(size=20),
        rng.normal(size=(20, 3)),
    )
    joint, site, digit = (str(rng.choice(names)) for names in (JOINT_ANGLES, SITES, DIGITS))
    assert ask(engine, "joint_angle($q, $name)", q=q, name=joint) == q[CONFIGURATION.index(joint)]
    assert ask(engine, "joint_angle_sd($sd, $name)", sd=sd, name=joint) == sd[DOFS.index(joint)]
    assert ask(engine, "joint_angles($q)", q=q) == q[7:].tolist()
    assert ask(engine, "site_gap($gap, $site)", gap=gap, site=site) == gap[SITES.index(site)]
    assert (
        ask(engine, "site_position($sites, $site)", sites=sites, site=site)
        == sites[SITES.index(site)].tolist()
    )
    of_digit = [gap[i] for i, name in enumerate(DIGIT_OF_SITE) if name == digit]
    assert ask(engine, "digit_gap($gap, $digit)", gap=gap, digit=digit) == min(of_digit)


def test_names(engine: Engine) -> None:
    rows = engine.sql(
        "SELECT site, site_index(site), digit_of(site) FROM unnest(site_names()) t(site)"
    ).rows()
    assert rows == [
        (site, i, digit) for i, (site, digit) in enumerate(zip(SITES, DIGIT_OF_SITE, strict=True), 1)
    ]
    assert ask(engine, "[digit_index(d) for d in digit_names()]") == [1, 2, 3, 4, 5]
    assert ask(engine, "[joint_index(j) for j in joint_names()]") == list(range(1, 24))
    assert ask(engine, "digit_pattern(['thumb', 'ring'])") == "thumb+ring"
    assert ask(engine, "digits_of_pattern(' ring+ thumb')") == ["thumb", "ring"]


@few
@given(a=st.sets(st.integers(0, 9)), b=st.sets(st.integers(0, 9), min_size=1))
def test_overlap(engine: Engine, a: set[int], b: set[int]) -> None:
    expression = "overlap($a::INT[], $b::INT[])"
    assert ask(engine, expression, a=list(a), b=list(b)) == pytest.approx(len(a & b) / len(a | b))
    assert ask(engine, "overlap([], [])") is None


def test_units(engine: Engine) -> None:
    row = engine.sql("SELECT to_mm(0.5e0), from_mm(500e0), to_deg(pi()), from_deg(180)").rows()[0]
    assert row == pytest.approx((500, 0.5, 180, np.pi))


@pytest.mark.parametrize("macro", [m for m in macros() if m.arguments], ids=lambda macro: macro.name)
def test_null_in_is_null_out(engine: Engine, macro: Any) -> None:
    """Each argument in turn is null, in a row beside one that has all, so that no row is told by another."""
    whole = {
        **dict.fromkeys("abpvq", "[1.0, 0.0, 0.0]"),
        "t": "transform_from([1, 2, 3], [1, 0, 0, 0])",
        "site": "'index_tip'",
        "digit": "'index'",
        "joint": "'wrist_flexion'",
        "sites": "[[1.0, 2, 3] for i in range(20)]",
        "gap": "[1.0 for i in range(20)]",
        "q_sd": "[1.0 for i in range(29)]",
        "digits": "['thumb']",
        "pattern": "'thumb'",
        **dict.fromkeys(("metres", "millimetres", "radians", "degrees"), "1.0"),
    }
    if macro.name.startswith("quaternion_") or macro.name == "transform_from":
        whole |= {"a": "[1.0, 0, 0, 0]", "b": "[1.0, 0, 0, 0]", "q": "[1.0, 0, 0, 0]"}
    if macro.name in ("transform_compose", "transform_angle"):
        whole |= dict.fromkeys("ab", whole["t"])
    if macro.name.startswith("joint_"):
        whole["q"] = "[1.0 for i in range(30)]"
    for missing in macro.arguments:
        arguments = ", ".join(
            f"CASE WHEN i = 0 THEN {whole[name]} END" if name == missing else whole[name]
            for name in macro.arguments
        )
        rows = engine.sql(f"SELECT {macro.name}({arguments}) FROM range(3) r(i) ORDER BY i").rows()
        assert rows[0][0] is not None
        assert rows[1:] == [(None,), (None,)]


@pytest.mark.parametrize(
    "expression",
    [
        "norm([1, NULL, 2])",
        "distance([1, 2, 3], [1, NULL, 3])",
        "distance([1, 2, 3], [1, 2])",
        "cross_product([NULL, 2, 3], [1, 2, 3])",
        "quaternion_rotate([1, 0, 0, 0], [NULL, NULL, NULL])",
        "quaternion_rotate([1, 0, 0], [1, 2, 3])",
        "transform_point([[1, 0, 0, 0], NULL, [0, 0, 1, 0], [0, 0, 0, 1]], [1, 2, 3])",
        "transform_inverse([[1, 0], [0, 1]])",
        "angle_between([0, 0, 0], [1, 0, 0])",
        "joint_angles([1, 2])",
    ],
)
def test_what_is_incomplete_is_null(engine: Engine, expression: str) -> None:
    assert ask(engine, expression) is None
    # Beside complete rows too, which DuckDB works out at once.
    table = "(VALUES (1), (2), (3)) t(i)"
    assert engine.sql(f"SELECT DISTINCT CASE WHEN i > 0 THEN {expression} END FROM {table}").rows() == [
        (None,)
    ]


def test_missing_vectors_in_a_table_are_null(engine: Engine) -> None:
    values = "(VALUES ([1.0, 2, 3]), ([NULL, NULL, NULL]), (NULL), ([1.0, 2])) t(v)"
    for call in (
        "norm(v)",
        "distance(v, v)",
        "dot_product(v, v)",
        "angle_between(v, v)",
        "cross_product(v, v)[1]",
    ):
        found = [row[0] for row in engine.sql(f"SELECT {call} FROM {values}").rows()]
        assert found[0] is not None
        assert found[1:] == [None] * 3


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        ("site_index('indx_tip')", "no site is called indx_tip; there are thumb_cmc"),
        ("digit_of('indx_tip')", "no site is called indx_tip"),
        ("digit_gap([1.0], 'pinky')", "no digit is called pinky; there are thumb"),
        (
            "joint_angle([1.0], 'index_flexion')",
            "no joint angle is called index_flexion; there are wrist_flexion",
        ),
    ],
)
def test_unknown_names_are_errors(engine: Engine, expression: str, said: str) -> None:
    with pytest.raises(QueryError, match=said):
        ask(engine, expression)


def test_every_function_is_documented_and_its_example_runs(tmp_path: Path) -> None:
    build(tmp_path / "db")
    with graspdb.open(tmp_path / "db") as database:
        known = dict(
            database.sql(
                "SELECT function_name, comment FROM duckdb_functions() "
                "WHERE function_type = 'macro' AND NOT internal"
            ).rows()
        )
        assert known == {macro.name: macro.doc for macro in macros()}
        for macro in macros():
            assert macro.name in macro.example
            assert macro.doc.endswith(".")
            assert len(database.sql(f"SELECT {macro.example}")) == 1
