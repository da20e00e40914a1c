"""Measure the time laws beside toppra and ruckig in one run, and print the ratios.

    python bench/timelaw.py [SECONDS_PER_CASE]

Everything runs on one core, compiled code warm. A *point* is a path sample or a row; a *move* is one single-axis move
from rest to rest. Durations are compared on the very same paths and limits.
"""

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
import ruckig
from scipy.interpolate import CubicSpline

from trunnion_motion.jerk_law import jerk_law
from trunnion_motion.scurve import rest_to_rest
from trunnion_motion.timelaw import time_law
from trunnion_motion.topp import law_of_derivatives, toppra_law

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # toppra's own docstrings hold escapes that Python warns of
    import toppra
    import toppra.algorithm
    import toppra.constraint

SPEED = np.array([200.0, 200.0, 40.0, 3.0, 3.0])
ACCELERATION = np.array([2000.0, 2000.0, 500.0, 30.0, 30.0])
JERK = np.array([40000.0, 40000.0, 20000.0, 700.0, 700.0])
CORNER = np.array([8.0, 8.0, 4.0, 0.15, 0.15])


def main() -> None:
    """Run every case and print one line each."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    toppra.setup_logging("ERROR")

    path, joints = random_path(0, 2000)
    theirs, their_rate = duration_by_toppra(path, joints, seconds)
    ours = toppra_law(path, joints, SPEED, ACCELERATION).total
    long_path, long_joints = wave(1_000_000)
    spline = CubicSpline(long_path, long_joints)
    first, second = spline(long_path, 1), spline(long_path, 2)
    free = np.full(len(long_path), np.inf)
    whole = rate(lambda: toppra_law(long_path, long_joints, SPEED, ACCELERATION), len(long_path), seconds)
    passes = rate(
        lambda: law_of_derivatives(long_path, first, second, SPEED, ACCELERATION, free), len(long_path), seconds
    )
    worst = max(
        abs(
            toppra_law(*random_path(seed, 800), SPEED, ACCELERATION).total
            / duration_by_toppra(*random_path(seed, 800))[0]
            - 1
        )
        for seed in range(10)
    )
    print(f"time-optimal: ours {whole:,.0f} points/s with the spline, {passes:,.0f} in the two passes alone")
    print(
        f"              toppra {their_rate:,.0f} points/s: {whole / their_rate:.0f} and {passes / their_rate:.0f} times"
    )
    print(f"              duration {ours:.5f} s against {theirs:.5f} s; largest difference of ten paths {worst:.4%}")

    steps = np.diff(long_joints, axis=0)
    length = np.linalg.norm(steps[:, :3], axis=1)
    wanted = np.full(len(steps), 50.0)
    rows = rate(lambda: time_law(steps, length, wanted, SPEED, ACCELERATION, CORNER), len(steps), seconds)
    print(f"look-ahead:   {rows:,.0f} rows/s, {rows / their_rate:.0f} times toppra's points")

    rng = np.random.default_rng(1)
    limits = [10 ** rng.uniform(low, high, 100_000) for low, high in [(-4, 3), (0, 2.5), (1, 4), (2, 5)]]
    moves = rate(lambda: rest_to_rest(*limits), 100_000, seconds)
    few = [values[:2000] for values in limits]
    expected, ruckig_rate = durations_by_ruckig(few)
    difference = np.abs(rest_to_rest(*few) / expected - 1).max()
    print(
        f"single axis with jerk: ours {moves:,.0f} moves/s, ruckig {ruckig_rate:,.0f}: {moves / ruckig_rate:.0f} times"
    )
    print(f"              largest difference of duration in 2000 moves {difference:.2e}")

    started = time.perf_counter()
    ratios = [
        jerk_law(*random_path(seed, 300), SPEED, ACCELERATION, JERK)[1].total
        / toppra_law(*random_path(seed, 3000), SPEED, ACCELERATION).total
        for seed in range(5)
    ]
    each = (time.perf_counter() - started) / 5
    print(
        f"along a path with jerk: {max(ratios) - 1:.1%} over the acceleration-limited time at most, {each:.2f} s a path"
    )


def rate(work: Callable[[], object], items: int, seconds: float) -> float:
    """Items per second of the fastest run of several, after one to warm up."""
    work()
    best = np.inf
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or not np.isfinite(best):
        started = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - started)
    return items / best


def random_path(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A spline through nine random joint states, sampled at n places."""
    rng = np.random.default_rng(seed)
    spline = CubicSpline(np.linspace(0, 1, 9), rng.normal(size=(9, 5)) * [60, 60, 20, 1, 1])
    path = np.linspace(0, 1, n)
    return path, spline(path)


def wave(n: int) -> tuple[np.ndarray, np.ndarray]:
    """20 m of waves and turns, n samples."""
    s = np.linspace(0, 20000, n)
    columns = [40 * np.cos(s / 40), 40 * np.sin(s / 40), s * 0.001, 0.5 * np.sin(s / 13), 0.3 * np.cos(s / 17)]
    return s, np.stack(columns, axis=1)


def duration_by_toppra(path: np.ndarray, joints: np.ndarray, seconds: float = 0.0) -> tuple[float, float]:
    """The duration that toppra finds, and its points per second."""
    spline = toppra.SplineInterpolator(path, joints)
    limits = [
        toppra.constraint.JointVelocityConstraint(np.stack([-SPEED, SPEED], 1)),
        toppra.constraint.JointAccelerationConstraint(np.stack([-ACCELERATION, ACCELERATION], 1)),
    ]

    def solve() -> float:
        planner = toppra.algorithm.TOPPRA(limits, spline, gridpoints=path, parametrizer="ParametrizeConstAccel")
        return float(planner.compute_trajectory().duration)

    return solve(), rate(solve, len(path), seconds) if seconds else 0.0


def durations_by_ruckig(limits: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """The durations that ruckig finds, and its moves per second."""
    solver, move, trajectory = ruckig.Ruckig(1), ruckig.InputParameter(1), ruckig.Trajectory(1)
    zero = [0.0]
    move.current_position = move.current_velocity = move.current_acceleration = zero
    move.target_velocity = move.target_acceleration = zero
    found = np.empty(len(limits[0]))
    started = time.perf_counter()
    for i, (distance, speed, acceleration, jerk) in enumerate(zip(*limits, strict=True)):
        move.target_position = [distance]
        move.max_velocity, move.max_acceleration, move.max_jerk = [speed], [acceleration], [jerk]
        solver.calculate(move, trajectory)
        found[i] = trajectory.duration
    return found, len(found) / (time.perf_counter() - started)


if __name__ == "__main__":
    main()
