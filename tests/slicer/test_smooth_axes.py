"""Orientation smoothing along paths: cones, closed paths, evenness against a general optimiser, the vertical tool."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from trunnion_slicer.nonplanar.fair import FAIRING, faired, refined
from trunnion_slicer.nonplanar.project import Lifted
from trunnion_slicer.nonplanar.smooth import headings, into_cone, smoothed

TOLERANCE = np.radians(2.0)


def faceted(n: int, facet: int, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """A straight path, 0.3 mm a row, whose axis turns by `bend` rad every `facet` rows, between them not at all."""
    angle = bend * (np.arange(n) // facet)
    points = np.column_stack([0.3 * np.arange(n), np.zeros(n), np.zeros(n)])
    return points, np.column_stack([np.sin(angle), np.zeros(n), np.cos(angle)])


def bending(points: np.ndarray, axes: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    rate = np.diff(axes, axis=0) / length[:, None]
    return np.linalg.norm(np.diff(rate, axis=0), axis=1) / (0.5 * (length[1:] + length[:-1]))


def between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(one - other, axis=1) / 2, 1)))


def test_facets_within_the_cone_are_ironed_out() -> None:
    points, axes = faceted(200, 10, np.radians(2.0))
    smooth = smoothed(points, axes, axes, np.array([0, 200]), TOLERANCE)
    assert between(smooth, axes).max() <= 2.0 + 1e-9
    assert_allclose(np.linalg.norm(smooth, axis=1), 1.0, atol=1e-12)
    assert bending(points, smooth).max() < 0.02 * bending(points, axes).max()


def test_no_other_axes_in_the_cones_bend_less() -> None:
    points, axes = faceted(36, 9, np.radians(6.0))
    smooth = smoothed(points, axes, axes, np.array([0, 36]), TOLERANCE)
    given = np.arctan2(axes[:, 0], axes[:, 2])

    def energy(angle: np.ndarray) -> float:
        return float((np.diff(angle, 2) ** 2).sum())

    bounds = list(zip(given - TOLERANCE, given + TOLERANCE, strict=True))
    options = {"maxiter": 20000, "maxfun": 1000000, "ftol": 1e-15, "gtol": 1e-12}
    best = minimize(energy, given, bounds=bounds, method="L-BFGS-B", options=options)
    assert energy(np.arctan2(smooth[:, 0], smooth[:, 2])) <= 1.15 * best.fun


def test_tips_leave_their_facets_by_microns_and_lose_their_kinks() -> None:
    x = np.arange(0, 30.01, 0.2)
    corners = np.arange(0, 31.0)
    z = np.interp(x, corners, 60 - np.sqrt(60**2 - (corners - 15) ** 2))
    points = np.column_stack([x, np.zeros_like(x), z])
    smooth = faired(points, np.array([0, len(x)]))
    assert np.linalg.norm(smooth - points, axis=1).max() <= FAIRING * (1 + 1e-9)
    kinks = [np.abs(np.diff(path[:, 2], 2) / 0.2).max() for path in (points, smooth)]
    assert kinks[1] < 0.35 * kinks[0]
    assert kinks[1] > 0.9 * 0.2 / 60


def test_corners_of_a_path_stay_corners() -> None:
    there = np.column_stack([np.arange(0, 10, 0.2), np.zeros(50), np.zeros(50)])
    back = there[::-1] + np.array([0, 0.4, 0])
    points = np.concatenate([there, back])
    step = np.diff(faired(points, np.array([0, 100])), axis=0)
    assert between(*(np.tile(v / np.linalg.norm(v), (1, 1)) for v in (step[48], step[49]))) > 88.0
    assert between(*(np.tile(v / np.linalg.norm(v), (1, 1)) for v in (step[49], step[50]))) > 88.0


def test_paths_do_not_hear_each_other() -> None:
    points, axes = faceted(80, 10, np.radians(3.0))
    alone = smoothed(points, axes, axes, np.array([0, 80]), TOLERANCE)
    twice = smoothed(
        np.tile(points, (2, 1)), both := np.concatenate([axes, axes[::-1]]), both, np.array([0, 80, 160]), TOLERANCE
    )
    assert_allclose(twice[:80], alone, atol=1e-9)


@pytest.mark.parametrize("seam", [0, 7, 30])
def test_a_closed_path_has_no_end(seam: int) -> None:
    turn = 2 * np.pi * np.arange(121) / 120
    turn = turn + 2 * np.pi * seam / 120
    facets = np.round(turn / (2 * np.pi) * 40) / 40 * 2 * np.pi
    tilt = np.radians(20.0)
    points = 8 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(121)])
    points[-1] = points[0]
    axes = np.column_stack([np.sin(tilt) * np.cos(facets), np.sin(tilt) * np.sin(facets), np.full(121, np.cos(tilt))])
    axes[-1] = axes[0]
    smooth = smoothed(points, axes, axes, np.array([0, 121]), TOLERANCE)
    assert (smooth[0] == smooth[-1]).all()
    assert between(smooth, axes).max() <= 2.0 + 1e-9
    again = np.concatenate([smooth[-2:-1], smooth[:2]])
    there = np.concatenate([points[-2:-1], points[:2]])
    inner = bending(points, smooth).max()
    assert bending(there, again).max() <= 1.5 * inner
    assert inner < 0.2 * bending(points, axes).max()


def test_no_tolerance_leaves_axes_alone() -> None:
    points, axes = faceted(20, 5, np.radians(6.0))
    assert smoothed(points, axes, axes, np.array([0, 20]), 0.0) is axes
    assert smoothed(points[:2], axes[:2], axes[:2], np.array([0, 2]), TOLERANCE) is not None


def test_refined_paths_lay_the_same_at_the_same_places() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1.1, 0, 0], [5, 0, 0], [6.5, 0, 0.0]])
    axes = np.tile([0.0, 0.0, 1.0], (5, 1))
    volume, run = np.array([0, 0.3, 0.1, 0, 0.7]), np.array([0, 1.0, 0.1, 0, 1.5])
    fine = refined(Lifted(points, axes, volume, run, np.array([0, 3, 5])))
    assert_allclose(fine.volume.sum(), volume.sum())
    assert_allclose(fine.run.sum(), run.sum())
    assert (fine.points[fine.starts[:-1]] == points[[0, 3]]).all()
    assert (fine.points[fine.starts[1:] - 1] == points[[2, 4]]).all()
    step = np.linalg.norm(np.diff(fine.points, axis=0), axis=1)
    step[fine.starts[1] - 1] = 0.0
    assert step.max() <= 0.4 + 1e-12


def straight(length: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (n,) and points (n, 3) every 0.2 mm along x."""
    place = np.arange(0, length, 0.2)
    return place, np.column_stack([place, np.zeros_like(place), np.zeros_like(place)])


@settings(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    tilt=st.floats(0, 1.2),
    rough=st.floats(0, 0.3),
    tolerance=st.floats(0.1, 5.0),
    stray=st.floats(0, 0.2),
)
@example(seed=2102, tilt=0.0, rough=0.0, tolerance=1.0, stray=0.0)
def test_no_axis_ever_leaves_its_cone(seed: int, tilt: float, rough: float, tolerance: float, stray: float) -> None:
    """Paths with corners and a seam, axes as rough as they come, over the vertical too, and wanted axes anywhere."""
    random = np.random.default_rng(seed)
    points = np.cumsum(random.normal(0, 0.2, (90, 3)), axis=0)
    points[59] = points[20]
    normals = np.array([np.sin(tilt), 0, np.cos(tilt)]) + random.normal(0, rough, (90, 3))
    wanted = normals + random.normal(0, stray, (90, 3))
    normals, wanted = (axes / np.linalg.norm(axes, axis=1, keepdims=True) for axes in (normals, wanted))
    smooth = smoothed(points, normals, wanted, np.array([0, 20, 60, 90]), np.radians(tolerance))
    assert between(smooth, normals).max() <= tolerance + 1e-9
    assert_allclose(np.linalg.norm(smooth, axis=1), 1.0, atol=1e-12)


def test_what_turns_evenly_already_is_left_alone() -> None:
    """A tilt that grows evenly at one heading, and a heading that turns evenly at one tilt."""
    place, points = straight(30.0)
    tilt, heading = np.radians(5 + 0.8 * place), np.radians(4 * place)
    great = np.column_stack([0.6 * np.sin(tilt), 0.8 * np.sin(tilt), np.cos(tilt)])
    around = np.column_stack([0.2 * np.cos(heading), 0.2 * np.sin(heading), np.full_like(place, np.sqrt(0.96))])
    for axes in (great, around):
        assert between(smoothed(points, axes, axes, np.array([0, len(points)]), TOLERANCE), axes).max() < 1e-6


@pytest.mark.parametrize("upright", [0.0, 0.3])
def test_a_flat_top_keeps_its_tool(upright: float) -> None:
    _, points = straight(10.0)
    axes = np.tile([np.sin(upright), 0.0, np.cos(upright)], (len(points), 1))
    assert_allclose(smoothed(points, axes, axes, np.array([0, len(points)]), TOLERANCE), axes, atol=1e-12)


@pytest.mark.parametrize(("beside", "less"), [(0.3, 0.01), (1.0, 0.05), (1.9, 0.3), (2.5, 0.4), (4.0, 0.7)])
def test_a_tool_that_passes_the_vertical_spares_the_platter(beside: float, less: float) -> None:
    """Within the cone it goes straight over the vertical, else round it on a wider way."""
    place, points = straight(30.0)
    tilt = np.radians(0.9 * (place - 15))
    axes = np.column_stack([np.sin(tilt), np.full_like(place, np.sin(np.radians(beside))), np.cos(tilt)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    smooth = smoothed(points, axes, axes, np.array([0, len(points)]), TOLERANCE)
    asked = [np.abs(np.diff(headings(each, np.array([0, len(points)]), 1e-4), 2)).max() for each in (axes, smooth)]
    assert asked[1] < less * asked[0]


def test_headings_go_on_over_the_vertical_and_round_it() -> None:
    place, _ = straight(20.0)
    tilt = np.radians(3 * (place - 10.03))
    over = np.column_stack([0.6 * np.sin(tilt), 0.8 * np.sin(tilt), np.cos(tilt)])
    assert_allclose(np.ptp(headings(over, np.array([0, len(over)]), TOLERANCE)), 0.0, atol=1e-9)
    turn = np.radians(9 * place)
    around = np.column_stack([0.3 * np.cos(turn), 0.3 * np.sin(turn), np.full_like(turn, np.sqrt(0.91))])
    assert_allclose(np.diff(headings(around, np.array([0, len(around)]), TOLERANCE)), np.radians(1.8), atol=1e-9)


def test_a_cone_is_entered_along_the_great_circle() -> None:
    centre, axis = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
    edge = into_cone(axis, centre, TOLERANCE)
    assert_allclose(edge, [[np.sin(TOLERANCE), 0, np.cos(TOLERANCE)]], atol=1e-12)
    assert into_cone(axis, axis, TOLERANCE)[0].tolist() == axis[0].tolist()
