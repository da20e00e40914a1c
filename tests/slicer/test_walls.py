"""Walls: where they lie, what they leave, what they do in necks."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LinearRing, LineString, MultiPolygon, Point, Polygon, box

from trunnion_slicer.walls import walls

WIDTH, SPACING = 0.4, 0.336


@pytest.mark.parametrize("count", [1, 2, 5])
def test_wall_i_of_a_box_runs_where_the_rule_says(count: int) -> None:
    rings, inside = walls(box(0, 0, 20, 10), count, WIDTH, SPACING)
    assert [index for index, _ in rings] == list(range(count))
    for index, ring in rings:
        inset = WIDTH / 2 + index * SPACING
        assert (ring[0] == ring[-1]).all()
        expected = box(inset, inset, 20 - inset, 10 - inset)
        assert Polygon(ring).symmetric_difference(expected).area == pytest.approx(0, abs=1e-9)
    inset = WIDTH / 2 + (count - 0.5) * SPACING
    assert inside.area == pytest.approx((20 - 2 * inset) * (10 - 2 * inset))


def test_no_walls_leave_the_whole_region() -> None:
    rings, inside = walls(box(0, 0, 2, 2), 0, WIDTH, SPACING)
    assert rings == []
    assert inside.area == 4


def test_walls_run_round_holes_the_other_way() -> None:
    region = Point(0, 0).buffer(10) - Point(0, 0).buffer(4)
    rings, inside = walls(region, 2, WIDTH, SPACING)
    turns = [(index, LinearRing(ring).is_ccw) for index, ring in rings]
    assert sorted(turns) == [(0, False), (0, True), (1, False), (1, True)]
    assert not inside.contains(Point(0, 0))


def test_a_neck_too_narrow_for_two_runs_gets_none() -> None:
    # Two squares joined by a neck: 0.9 mm takes two runs 0.5 mm apart, 0.5 mm would put them 0.1 mm apart.
    for neck, runs in ((0.9, 2), (0.5, 0)):
        region = shapely.union_all([box(0, 0, 5, 5), box(10, 0, 15, 5), box(4, 2.5 - neck / 2, 11, 2.5 + neck / 2)])
        rings, _ = walls(region, 1, WIDTH, SPACING)
        cut = LineString([(7.5, 0), (7.5, 5)])
        crossings = sum(shapely.get_coordinates(LineString(ring).intersection(cut)).shape[0] for _, ring in rings)
        assert crossings == runs


@st.composite
def regions(draw: st.DrawFn) -> MultiPolygon:
    discs = [
        Point(draw(st.integers(-100, 100)) / 10, draw(st.integers(-100, 100)) / 10).buffer(
            draw(st.integers(3, 60)) / 10, 8
        )
        for _ in range(5)
    ]
    whole = shapely.union_all(discs[:4]).difference(discs[4])
    return MultiPolygon([part for part in shapely.get_parts(whole) if isinstance(part, Polygon)])


@settings(max_examples=40, deadline=None)
@given(regions(), st.integers(1, 4))
def test_beads_stay_inside_and_the_rest_begins_at_their_inner_edge(region: MultiPolygon, count: int) -> None:
    rings, inside = walls(region, count, WIDTH, SPACING)
    for index, ring in rings:
        from_outline = shapely.distance(shapely.points(ring), region.boundary)
        assert from_outline.min() > WIDTH / 2 + index * SPACING - 1e-5
        assert region.contains(LineString(ring))
    innermost = [LineString(ring) for index, ring in rings if index == count - 1]
    if innermost and not inside.is_empty:
        edge = np.concatenate([shapely.get_coordinates(part.exterior) for part in inside.geoms])
        assert shapely.distance(shapely.points(edge), shapely.union_all(innermost)).min() > SPACING / 2 - 1e-5
