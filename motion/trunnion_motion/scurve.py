"""Turn straight moves from rest to rest into times under speed, acceleration and jerk: the seven-phase S-curve.

Along a straight move every joint keeps its share of the path, so the path has one limit of each kind: that of the
joint that reaches it first. The time follows in closed form from which of the three limits come to bear (Biagiotti &
Melchiorri 2008, "Trajectory Planning for Automatic Machines and Robots", section 3.4).
"""

import numpy as np

from trunnion_core.arrays import FloatArray


def s_curve_times(steps: FloatArray, speed: FloatArray, acceleration: FloatArray, jerk: FloatArray) -> FloatArray:
    """(n,) s of the fastest straight moves `steps` (n, k), from rest to rest; 0 where nothing moves.

    `speed`, `acceleration`, `jerk` (k,) are the joints' limits; an infinite jerk leaves trapezoids.
    """
    share = np.abs(steps)
    v, a, j = (_path_limit(share, limit) for limit in (speed, acceleration, jerk))
    return np.where(share.max(axis=1, initial=0.0) > 0, rest_to_rest(np.ones(len(steps)), v, a, j), 0.0)


def rest_to_rest(distance: FloatArray, speed: FloatArray, acceleration: FloatArray, jerk: FloatArray) -> FloatArray:
    """(n,) s of the time-optimal single-axis moves over `distance` (n,), from rest to rest; limits (n,) positive."""
    distance = np.abs(distance)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        build = np.where(np.isinf(jerk), 0.0, acceleration / jerk)
        reaches_acceleration = speed >= acceleration * build
        to_speed = np.where(reaches_acceleration, build + speed / acceleration, 2 * np.sqrt(speed / jerk))
        cruising = to_speed + distance / speed
        no_cruise = build + np.sqrt(build**2 + 4 * distance / acceleration)
        no_plateau = 4 * np.cbrt(distance / (2 * jerk))
        short = distance < 2 * acceleration * build**2
        hurried = np.where(short, no_plateau, no_cruise)
        return np.where(distance >= speed * to_speed, cruising, hurried)


def _path_limit(share: FloatArray, limit: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.asarray(np.min(np.where(share > 0, limit / share, np.inf), axis=1, initial=np.inf))
