"""Charts: everything shown lies where its value belongs, whatever the values and names are."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspdb.pages.charts import Series, columns, scatter, shades, spreads
from graspdb.pages.scales import names, numbers
from graspdb.pages.templates import environment

values = st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=20)


@given(values, st.booleans())
def test_a_scale_has_every_value_between_its_ends(given_values: list[float], zero: bool) -> None:
    scale = numbers(given_values, 0.0, 100.0, zero=zero)
    shown = [*given_values, 0.0] if zero else given_values
    assert all(-0.1 <= scale(value) <= 100.1 for value in shown)


@given(values)
def test_ticks_are_evenly_spaced_from_end_to_end_and_not_many(given_values: list[float]) -> None:
    scale = numbers(given_values, 20.0, 220.0)
    at = [tick.at for tick in scale.ticks]
    steps = [b - a for a, b in pairwise(at)]
    assert at[0] == 20.0
    assert at[-1] == 220.0
    assert 2 <= len(at) <= 8
    assert max(steps) - min(steps) <= 0.21


@pytest.mark.parametrize(
    ("given_values", "labels"),
    [
        ([0.0, 10.0], ["0", "2", "4", "6", "8", "10"]),
        ([0.12, 0.57], ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6"]),
        ([-3.0, 4.0], ["-4", "-2", "0", "2", "4"]),
    ],
)
def test_ticks_are_round_numbers(given_values: list[float], labels: list[str]) -> None:
    assert [tick.label for tick in numbers(given_values, 0, 100).ticks] == labels


def test_values_that_are_not_finite_do_not_count() -> None:
    assert numbers([1.0, math.nan, 3.0, math.inf], 0, 1) == numbers([1.0, 3.0], 0, 1)
    assert numbers([], 0, 1) == numbers([math.nan], 0, 1)


@given(st.integers(1, 30))
def test_names_share_an_axis_evenly(n: int) -> None:
    at = [tick.at for tick in names([str(i) for i in range(n)], 0.0, 300.0).ticks]
    assert at == pytest.approx([300 / n * (i + 0.5) for i in range(n)], abs=0.06)


def test_points_without_a_number_are_left_out() -> None:
    chart = scatter("t", [Series("a", [1, None, 3], [1, 2, math.nan], ["p", "q", "r"])], "x", "y")
    assert [mark.title for mark in chart.marks] == ["p"]


def test_bars_are_as_high_as_their_values() -> None:
    chart = columns("t", ["a", "b", "c"], [1.0, -2.0, None], "y")
    heights = [mark.points[1][1] for mark in chart.marks]
    assert heights[1] == pytest.approx(2 * heights[0], abs=0.2)
    assert chart.marks[0].points[0][1] + heights[0] == pytest.approx(chart.marks[1].points[0][1])


def test_spreads_order_least_quartiles_and_greatest() -> None:
    chart = spreads("t", [("m", (1.0, 2.0, 3.0, 4.0, 5.0))], "x")
    whisker, box, median = chart.marks
    (least, _), (greatest, _) = whisker.points
    (lower, _), (width, _) = box.points
    assert least < lower < median.points[0][0] < lower + width < greatest


def test_shades_cover_just_the_parts_with_a_value() -> None:
    chart = shades("t", [("trial", [0.0, 0.5, 0.5, None, 0.1])], 0.5, "x", width=500)
    part = (chart.x.end - chart.x.start) / 5
    spans = [((m.points[0][0] - chart.x.start) / part, m.points[1][0] / part) for m in chart.marks]
    assert spans == [
        (pytest.approx(1, abs=0.01), pytest.approx(2, abs=0.01)),
        (pytest.approx(4, abs=0.01), pytest.approx(1, abs=0.01)),
    ]
    assert chart.marks[0].opacity == 1
    assert 0 < chart.marks[1].opacity < 0.5


def test_names_in_a_chart_are_text() -> None:
    nasty = "<script>alert(1)</script>\"'&"
    template = environment().from_string('{% from "chart.svg" import draw %}{{ draw(chart) }}')
    for chart in (
        scatter(nasty, [Series(nasty, [1], [1], [nasty]), Series("b", [2], [2])], nasty, nasty),
        columns(nasty, [nasty], [1.0], nasty),
        shades(nasty, [(nasty, [0.5])], 0.5, nasty),
        spreads(nasty, [(nasty, (1, 2, 3, 4, 5))], nasty),
    ):
        written = template.render(chart=chart)
        assert "<script" not in written
        assert "&lt;script&gt;alert(1)&lt;/script&gt;" in written
