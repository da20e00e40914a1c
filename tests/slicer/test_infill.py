"""Contract of every infill pattern: inside, dense enough, deterministic, no crumbs; and the zig-zag in particular."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiPolygon, Point, Polygon, box

from trunnion_core.errors import SettingsError
from trunnion_slicer import infill
from trunnion_slicer.walls import as_multipolygon

L_SHAPE = Polygon([(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)])
RING = Point(0, 0).buffer(10, 64) - Point(2, 0).buffer(4, 32)
COMB = shapely.union_all([box(0, 0, 30, 3)] + [box(3 * i, 0, 3 * i + 1.5, 10 + i % 3) for i in range(10)])
COMPACT = {"box": box(0, 0, 20, 20), "disc": Point(3, 4).buffer(9, 64), "l": L_SHAPE, "ring": RING}


def lay(pattern: str, region: object, spacing: float, angle: float, **options: bool) -> list[np.ndarray]:
    return infill.fill(pattern, as_multipolygon(region), spacing, angle, **options)


def length(lines: list[np.ndarray]) -> float:
    return sum(LineString(line).length for line in lines)


@st.composite
def regions(draw: st.DrawFn) -> MultiPolygon:
    """Islands of discs and bars with holes."""
    parts = []
    for _ in range(draw(st.integers(1, 5))):
        place = Point(draw(st.floats(-10, 10)), draw(st.floats(-10, 10)))
        parts.append(place.buffer(draw(st.floats(0.2, 6)), draw(st.integers(1, 12))))
    bars = [
        box(*corner, corner[0] + draw(st.floats(0.1, 15)), corner[1] + draw(st.floats(0.1, 15)))
        for corner in [(draw(st.floats(-10, 5)), draw(st.floats(-10, 5)))]
    ]
    hole = Point(draw(st.floats(-5, 5)), draw(st.floats(-5, 5))).buffer(draw(st.floats(0.2, 3)), 6)
    return as_multipolygon(shapely.union_all(parts + bars).difference(hole))


@pytest.mark.parametrize("pattern", infill.patterns())
@settings(max_examples=40, deadline=None)
@given(regions(), st.floats(0.2, 3), st.floats(-7, 7), st.booleans())
def test_lines_stay_inside_are_no_crumbs_and_come_out_the_same_twice(
    pattern: str, region: MultiPolygon, spacing: float, angle: float, fit: bool
) -> None:
    lines = lay(pattern, region, spacing, angle, fit=fit)
    again = lay(pattern, region, spacing, angle, fit=fit)
    assert len(lines) == len(again)
    assert all((a == b).all() for a, b in zip(lines, again, strict=True))
    within = region.buffer(1e-6)
    for line in lines:
        assert within.covers(LineString(line))
        assert LineString(line).length >= spacing / 2
        assert np.linalg.norm(np.diff(line, axis=0), axis=1).min() > 0


@pytest.mark.parametrize("pattern", infill.patterns())
@pytest.mark.parametrize("name", COMPACT)
@pytest.mark.parametrize("degrees", [0, 45, 30, -60, 90])
def test_length_times_spacing_is_the_area(pattern: str, name: str, degrees: float) -> None:
    region = COMPACT[name]
    spacing = 0.336
    inside = region.buffer(-spacing / 2, join_style="mitre")
    covered = length(lay(pattern, inside, spacing, math.radians(degrees))) * spacing
    assert covered == pytest.approx(region.area, rel=0.02)


@pytest.mark.parametrize("pattern", infill.patterns())
def test_every_place_is_near_a_line_at_full_density(pattern: str) -> None:
    spacing = 0.4
    for region in COMPACT.values():
        lines = lay(pattern, region.buffer(-spacing / 2), spacing, 0.5)
        bare = region.difference(shapely.union_all([LineString(line).buffer(spacing * 0.56) for line in lines]))
        assert bare.buffer(-0.05).area < 0.005 * region.area


@pytest.mark.parametrize("pattern", infill.patterns())
def test_nothing_in_nothing_out(pattern: str) -> None:
    assert infill.fill(pattern, MultiPolygon(), 0.4, 0.0) == []
    assert infill.fill(pattern, MultiPolygon([box(0, 0, 1e-3, 1e-3)]), 0.4, 0.0) == []


def test_an_unknown_pattern_names_the_nearest() -> None:
    with pytest.raises(SettingsError, match=r"fill_pattern: 'rectilinar' is unknown, did you mean 'rectilinear'\?"):
        infill.fill("rectilinar", MultiPolygon([box(0, 0, 1, 1)]), 0.4, 0.0)


@pytest.mark.parametrize("name", ["box", "disc", "l"])
def test_a_region_without_splits_is_one_unbroken_zigzag(name: str) -> None:
    assert len(lay("rectilinear", COMPACT[name], 0.4, 0.0)) == 1


def test_a_ring_breaks_once_at_most() -> None:
    assert len(lay("rectilinear", RING, 0.4, 0.0)) <= 2


def test_a_comb_breaks_no_more_often_than_it_has_teeth() -> None:
    assert len(lay("rectilinear", COMB, 0.3, 0.0)) <= 10


def test_turns_follow_the_boundary() -> None:
    disc = COMPACT["disc"]
    (line,) = lay("rectilinear", disc, 0.5, 0.0)
    step = np.diff(line, axis=0)
    turns = np.abs(step[:, 1]) > 1e-6
    assert turns.sum() > 30
    ends = line[1:][turns]
    assert shapely.distance(shapely.points(ends), disc.exterior).max() < 1e-9


def test_unfitted_lines_lie_on_the_same_grid_wherever_the_region_is() -> None:
    for shift in (0.0, 0.3, 1.7):
        lines = lay("rectilinear", box(0, shift, 10, 8 + shift), 2.0, 0.0, fit=False)
        heights = np.concatenate([line[:-1][np.diff(line[:, 1]) == 0][:, 1] for line in lines])
        assert np.abs(heights / 2.0 - np.round(heights / 2.0)).max() < 1e-9


def test_fitted_lines_reach_both_edges() -> None:
    (line,) = lay("rectilinear", box(0, 0, 10, 7.13), 0.5, 0.0)
    assert line[:, 1].min() == pytest.approx(0, abs=0.03)
    assert line[:, 1].max() == pytest.approx(7.13, abs=0.03)
