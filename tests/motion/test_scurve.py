"""Jerk-limited straight moves against ruckig."""

import numpy as np
import pytest
import ruckig
from numpy.testing import assert_allclose

from trunnion_motion.scurve import rest_to_rest, s_curve_times


def by_ruckig(distance, speed, acceleration, jerk):
    move = ruckig.InputParameter(1)
    move.current_position = move.current_velocity = move.current_acceleration = [0.0]
    move.target_velocity = move.target_acceleration = [0.0]
    move.target_position = [distance]
    move.max_velocity, move.max_acceleration, move.max_jerk = [speed], [acceleration], [jerk]
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(move, trajectory)
    return trajectory.duration


def test_random_moves_take_ruckigs_time():
    rng = np.random.default_rng(1)
    n = 500
    limits = [10 ** rng.uniform(low, high, n) for low, high in [(-4, 3), (0, 2.5), (1, 4), (2, 5)]]
    expected = [by_ruckig(*row) for row in zip(*limits, strict=True)]
    assert_allclose(rest_to_rest(*limits), expected, rtol=1e-3)


def test_the_slowest_joint_sets_the_time_of_a_straight_move():
    speed, acceleration, jerk = np.array([200.0, 3.0]), np.array([2000.0, 30.0]), np.array([40000.0, 600.0])
    both = s_curve_times(np.array([[10.0, 1.0]]), speed, acceleration, jerk)[0]
    alone = [by_ruckig(d, v, a, j) for d, v, a, j in zip([10.0, 1.0], speed, acceleration, jerk, strict=True)]
    assert both == pytest.approx(max(alone), rel=1e-9)


def test_without_jerk_limit_it_is_a_trapezoid_and_nothing_takes_no_time():
    steps = np.array([[100.0], [0.0]])
    times = s_curve_times(steps, np.array([50.0]), np.array([2000.0]), np.array([np.inf]))
    assert_allclose(times, [100 / 50 + 50 / 2000, 0.0])
