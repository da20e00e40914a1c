"""Time-optimal paths against toppra, and resampled ten times finer."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from trunnion_motion.topp import spline_derivatives, toppra_law

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # toppra's own docstrings hold escapes that Python warns of
    import toppra
    import toppra.algorithm
    import toppra.constraint

SPEED = np.array([200.0, 200.0, 40.0, 3.0, 3.0])
ACCELERATION = np.array([2000.0, 2000.0, 500.0, 30.0, 30.0])


def random_path(seed, n):
    rng = np.random.default_rng(seed)
    spline = CubicSpline(np.linspace(0, 1, 9), rng.normal(size=(9, 5)) * [60, 60, 20, 1, 1])
    path = np.linspace(0, 1, n)
    return path, spline(path)


toppra.setup_logging("ERROR")


def by_toppra(path, joints):
    spline = toppra.SplineInterpolator(path, joints)
    limits = [
        toppra.constraint.JointVelocityConstraint(np.stack([-SPEED, SPEED], 1)),
        toppra.constraint.JointAccelerationConstraint(np.stack([-ACCELERATION, ACCELERATION], 1)),
    ]
    planner = toppra.algorithm.TOPPRA(limits, spline, gridpoints=path, parametrizer="ParametrizeConstAccel")
    return planner.compute_trajectory().duration


@pytest.mark.parametrize("seed", range(5))
def test_the_duration_is_that_of_toppra(seed):
    path, joints = random_path(seed, 600)
    assert_allclose(toppra_law(path, joints, SPEED, ACCELERATION).total, by_toppra(path, joints), rtol=5e-3)


@pytest.mark.parametrize("n", [300, 4000])
@pytest.mark.parametrize("seed", range(5))
def test_resampled_tenfold_no_joint_breaks_a_limit_by_a_thousandth(seed, n):
    path, joints = random_path(seed, n)
    law = toppra_law(path, joints, SPEED, ACCELERATION)
    spline = CubicSpline(path, joints)
    x = law.path_speed**2
    fraction = np.linspace(0, 1, 10, endpoint=False)
    s = (path[:-1, None] + fraction * np.diff(path)[:, None]).ravel()
    squared = (x[:-1, None] + fraction * np.diff(x)[:, None]).ravel()
    u = np.repeat(np.diff(x) / (2 * np.diff(path)), 10)
    assert (np.abs(spline(s, 1)) * np.sqrt(squared)[:, None] <= SPEED * 1.001).all()
    assert (np.abs(spline(s, 1) * u[:, None] + spline(s, 2) * squared[:, None]) <= ACCELERATION * 1.001).all()


def test_a_straight_line_is_a_trapezoid():
    path = np.linspace(0, 100, 2001)
    joints = path[:, None] * [1.0, 0, 0, 0, 0]
    law = toppra_law(path, joints, SPEED, ACCELERATION, tip_max=50)
    assert_allclose(law.total, 100 / 50 + 50 / 2000, rtol=1e-5)
    assert law.path_speed.max() <= 50 * (1 + 1e-12)


def test_the_tip_window_is_kept_where_it_varies():
    path = np.linspace(0, 100, 2001)
    joints = np.stack([path, 5 * np.sin(path / 9), 0 * path, 0.2 * np.cos(path / 7), 0 * path], axis=1)
    window = 40 + 25 * np.sin(path / 11)
    law = toppra_law(path, joints, SPEED, ACCELERATION, tip_max=window)
    assert (law.path_speed <= window * (1 + 1e-9)).all()
    assert law.total < toppra_law(path, joints, SPEED, ACCELERATION, tip_max=15).total


def test_a_path_that_does_not_grow_is_refused():
    with pytest.raises(ValueError, match="strictly growing"):
        toppra_law(np.array([0.0, 1.0, 1.0, 2.0]), np.zeros((4, 5)), SPEED, ACCELERATION)


@pytest.mark.parametrize("n", [4, 5, 6, 50])
def test_the_spline_is_scipys(n):
    rng = np.random.default_rng(n)
    path = np.cumsum(rng.uniform(0.2, 1.5, n))
    joints = rng.normal(size=(n, 3))
    first, second = spline_derivatives(path, joints)
    assert_allclose(first, CubicSpline(path, joints)(path, 1), atol=1e-9)
    assert_allclose(second, CubicSpline(path, joints)(path, 2), atol=1e-9)


def test_the_limit_of_a_circle_is_its_centripetal_one():
    radius = 10.0
    path = np.linspace(0, 2 * np.pi * radius, 3001)
    angle = path / radius
    zero = np.zeros_like(angle)
    joints = np.stack([radius * np.cos(angle), radius * np.sin(angle), zero, zero, zero], axis=1)
    law = toppra_law(path, joints, SPEED, ACCELERATION)
    along_x = np.argmin(np.abs(angle - np.pi))
    assert_allclose(law.limit[along_x], np.sqrt(2000 * radius), rtol=1e-3)
    assert (law.path_speed <= law.limit * (1 + 1e-9)).all()
