"""Orientation smoothing: cones, closed paths, evenness against a general optimiser, what the samples gain."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from trunnion_slicer.nonplanar.fair import FAIRING, faired, refined
from trunnion_slicer.nonplanar.project import Lifted
from trunnion_slicer.nonplanar.smooth import smoothed

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
