"""Jerk-limited motion along a path: straight lines against the closed form, curves against their limits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline, make_interp_spline

from trunnion_motion.jerk_law import jerk_law, joint_motion
from trunnion_motion.scurve import rest_to_rest
from trunnion_motion.topp import toppra_law

SPEED = np.array([200.0, 200.0, 40.0, 3.0, 3.0])
ACCELERATION = np.array([2000.0, 2000.0, 500.0, 30.0, 30.0])
JERK = np.array([40000.0, 40000.0, 20000.0, 700.0, 700.0])


def random_path(seed, n):
    rng = np.random.default_rng(seed)
    spline = CubicSpline(np.linspace(0, 1, 9), rng.normal(size=(9, 5)) * [60, 60, 20, 1, 1])
    path = np.linspace(0, 1, n)
    return path, spline(path)


@pytest.mark.parametrize("distance", [2.0, 15.0, 100.0])
def test_a_straight_line_takes_the_s_curves_time(distance):
    path = np.linspace(0, distance, 20)
    _, law = jerk_law(path, path[:, None] * [1.0, 0, 0, 0, 0], SPEED, ACCELERATION, JERK)
    expected = rest_to_rest(*(np.array([value]) for value in (distance, 200.0, 2000.0, 40000.0)))
    assert_allclose(law.total, expected, rtol=0.005)


@pytest.mark.parametrize(("seed", "samples"), [(0, 400), (2, 400), (5, 400), (1, 500)])
def test_resampled_tenfold_no_joint_breaks_a_limit_and_little_time_is_lost(seed, samples):
    path, joints = random_path(seed, 300)
    s, law = jerk_law(path, joints, SPEED, ACCELERATION, JERK, samples=samples)
    spline = make_interp_spline(path, joints, k=5)
    middle, squared = 0.5 * (s[1:] + s[:-1]), law.path_speed**2
    u, x = np.diff(squared) / (2 * np.diff(s)), 0.5 * (squared[1:] + squared[:-1])
    acceleration = spline(middle, 1) * u[:, None] + spline(middle, 2) * x[:, None]
    when = 0.5 * (law.time[1:] + law.time[:-1])
    jerk = np.diff(acceleration, axis=0) / np.diff(when)[:, None]
    assert (np.abs(jerk) <= JERK * 1.001).all()
    assert (np.abs(acceleration) <= ACCELERATION * 1.001).all()

    time = np.linspace(0, law.total, 10 * len(s))
    motion = joint_motion(s, law, path, joints, time)
    acceleration = np.diff(motion, 2, axis=0) / time[1] ** 2
    assert (np.abs(acceleration) <= ACCELERATION * 1.001).all()
    velocity = np.diff(motion, axis=0) / time[1]
    assert (np.abs(velocity) <= SPEED * 1.001).all()
    assert_allclose(motion[[0, -1]], joints[[0, -1]], atol=1e-9)
    assert law.total < 1.1 * toppra_law(path, joints, SPEED, ACCELERATION).total
    assert law.total > toppra_law(path, joints, SPEED, ACCELERATION).total * 0.999


def test_a_joint_without_jerk_limit_does_not_matter():
    path, joints = random_path(1, 300)
    free = np.full(5, np.inf)
    _, law = jerk_law(path, joints, SPEED, ACCELERATION, free, samples=1000)
    assert_allclose(law.total, toppra_law(path, joints, SPEED, ACCELERATION).total, rtol=0.02)


def test_a_path_that_does_not_grow_is_refused():
    with pytest.raises(ValueError, match="strictly growing"):
        jerk_law(np.zeros(8), np.zeros((8, 5)), SPEED, ACCELERATION, JERK)
