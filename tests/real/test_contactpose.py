"""Contact maps against the contact that a thermal camera measured on a camera held by two hands."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from graspdb.cli import app
from graspdb.validation.contact_map import MeasuredMap, validate_map
from graspdb.validation.contact_map_file import read_measured_map
from graspdb_ingest.surface import SURFACES, HandPoints

FILE = "contactpose-camera/full1_use_camera_contact_derived.npz"
CONTACT_ABOVE = 0.4
Measured = tuple[MeasuredMap, tuple[HandPoints, ...]]


@pytest.fixture(scope="module")
def measured(shared_data: Path) -> Measured:
    return read_measured_map(shared_data / FILE)


def figures(
    map_: MeasuredMap, hands: tuple[HandPoints, ...], names: tuple[str, ...] = SURFACES
) -> dict[tuple[str, str], tuple[float, float]]:
    found = validate_map(map_, hands, names, CONTACT_ABOVE, [])
    return {(one.surface, one.gap): (one.auc, one.best.f1) for one in found}


def test_area_under_the_curve_and_f1(measured: Measured) -> None:
    found = figures(*measured)
    assert found["skin", "pressing"][0] >= 0.92
    assert found["skin", "pressing"][1] >= 0.52
    assert found["spheres", "distance"] == pytest.approx((0.875, 0.461), abs=0.01)
    assert found["capsules", "distance"] == pytest.approx((0.905, 0.498), abs=0.01)
    for gap in ("distance", "pressing"):
        aucs = [found[name, gap][0] for name in SURFACES]
        assert aucs == sorted(aucs)
    for name in SURFACES:
        assert found[name, "pressing"][0] > found[name, "distance"][0] + 0.01


@pytest.mark.parametrize("size", [0.85, 1.15])
def test_it_does_not_hang_on_the_radii(measured: Measured, size: float) -> None:
    map_, hands = measured
    scaled = tuple(replace(hand, radii=size * hand.radii) for hand in hands)
    auc, f1 = figures(map_, scaled, ("skin",))["skin", "pressing"]
    assert auc >= 0.92
    assert f1 >= 0.52


def test_the_command_prints_the_same(shared_data: Path) -> None:
    result = CliRunner().invoke(
        app, ["validate", "contact-map", str(shared_data / FILE), "--surface", "skin", "--json"]
    )
    assert result.exit_code == 0, result.output
    rows = json.loads(result.stdout)
    assert [row["gap"] for row in rows] == ["distance", "pressing"]
    assert rows[1]["auc"] == pytest.approx(0.931, abs=0.005)
    assert [round(one["threshold"], 6) for one in rows[1]["at"]] == [0.0, 0.002, 0.004]
    assert np.all(np.diff([one["recall"] for one in rows[1]["at"]]) > 0)
