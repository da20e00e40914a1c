"""The planner's times against closed forms and against a look-ahead written another way."""

import math

import numpy as np
import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.firmware.planner import FIRST_MOVE_DELAY, Planner

STEPPING = 0.012
"""s by which the whole steps of the timer interrupt may end a move early: its slowing down begins a step late, runs
ahead by another, and stops at 120 steps/s, so that a move to rest saves the few slowest steps."""
LIMITS_X = (200.0, 2000.0, 8.0)
"""Speed, acceleration and corner speed of X on the cradle; A has 180, 1800 and 8."""


@pytest.fixture(scope="module")
def profile() -> MachineProfile:
    return load_profile("generic_ab_cradle")


def run(planner: Planner, moves: list[tuple[dict[str, float], float]]) -> np.ndarray:
    """Execute moves as an ideal host would send them; returns when each ended, without the first delay."""
    now = 0.0
    here = [0.0] * planner.n
    for words, feed in moves:
        while planner.full:
            now = planner.next_event
            planner.fire()
        for letter, value in words.items():
            here["XYZABE".index(letter)] = value
        planner.add(here, feed, 1.0, 1, now)
    if len(moves) < 3:
        now = FIRST_MOVE_DELAY
    while planner.moves:
        planner.fire()
    begun = FIRST_MOVE_DELAY if len(moves) < 3 else 0.0
    return np.asarray(planner.records()[:, -1]) - begun


def trapezoid(length: float, speed: float, acceleration: float) -> float:
    """Time of one move from rest to rest."""
    reach = math.sqrt(length * acceleration)
    if reach < speed:
        return 2 * length / reach
    return length / speed + speed / acceleration


@pytest.mark.parametrize(
    ("words", "feed", "length", "speed", "acceleration"),
    [
        ({"X": 100.0}, 50.0, 100.0, 50.0, 2000.0),
        ({"X": 1.0}, 150.0, 1.0, 150.0, 2000.0),
        ({"X": 100.0}, 500.0, 100.0, 200.0, 2000.0),
        ({"X": 60.0, "Y": 80.0}, 100.0, 100.0, 100.0, 2500.0),
        ({"Z": 20.0}, 100.0, 20.0, 40.0, 500.0),
        ({"A": 90.0}, 60.0, 90.0, 60.0, 1800.0),
        ({"A": 30.0, "B": 40.0}, 50.0, 50.0, 50.0, 2250.0),
        ({"E": 10.0}, 40.0, 10.0, 40.0, 3000.0),
    ],
)
def test_one_move_takes_the_time_of_a_trapezoid(
    profile: MachineProfile, words: dict[str, float], feed: float, length: float, speed: float, acceleration: float
) -> None:
    times = run(Planner(profile), [(words, feed)])
    assert times[-1] == pytest.approx(trapezoid(length, speed, acceleration), rel=2e-3, abs=STEPPING)


def test_f_counts_linear_axes_only_when_one_of_them_moves(profile: MachineProfile) -> None:
    """A turn of 60 degrees beside 10 mm of X lasts as long as the 10 mm alone (NIST RS274NGC 2.1.2.5)."""
    both = run(Planner(profile), [({"X": 10.0, "A": 6.0}, 5.0)])
    alone = run(Planner(profile), [({"X": 10.0}, 5.0)])
    assert both[-1] == pytest.approx(alone[-1], rel=2e-3)
    fast_turn = run(Planner(profile), [({"X": 1.0, "A": 90.0}, 100.0)])
    assert fast_turn[-1] == pytest.approx(trapezoid(90.0, 180.0, 1800.0), abs=STEPPING)


def test_filament_speed_limits_a_move(profile: MachineProfile) -> None:
    times = run(Planner(profile), [({"X": 10.0, "E": 60.0}, 200.0)])
    assert times[-1] == pytest.approx(trapezoid(60.0, 60.0, 3000.0), rel=5e-3)


def test_straight_pieces_take_as_long_as_the_whole(profile: MachineProfile) -> None:
    pieces = run(Planner(profile), [({"X": 2.0 * i}, 50.0) for i in range(1, 51)])
    assert pieces[-1] == pytest.approx(trapezoid(100.0, 50.0, 2000.0), rel=1e-2)


def test_look_ahead_stops_within_fifteen_blocks(profile: MachineProfile) -> None:
    """0.1 mm pieces: speed is bounded by what the known blocks give room to stop in."""
    count = 2000
    times = run(Planner(profile), [({"X": 0.1 * i}, 200.0) for i in range(1, count + 1)])
    speed = 0.1 / np.diff(times)
    bound = math.sqrt(2 * 2000.0 * 0.1 * 15)
    assert speed[200:-200].max() <= bound * 1.03
    assert np.median(speed[200:-200]) >= 0.85 * bound


def test_a_reversal_is_taken_at_the_corner_speed(profile: MachineProfile) -> None:
    """Out and back: two trapezoids from rest to the corner speed of 8 mm/s; Marlin lets each side jump by it."""
    times = run(Planner(profile), [({"X": 50.0}, 50.0), ({"X": 0.0}, 50.0), ({"X": 50.0}, 50.0)])
    v, a, corner = 50.0, 2000.0, LIMITS_X[2]
    inner = 50.0 / v + (v - corner) ** 2 / (2 * v * a) * 2
    assert times[1] - times[0] == pytest.approx(inner, rel=5e-3)


def test_corner_deviation_slows_a_right_angle(profile: MachineProfile) -> None:
    planner = Planner(profile)
    planner.state[5] = 0.02
    moves = [({"X": 20.0}, 60.0), ({"Y": 20.0}, 60.0), ({"X": 40.0}, 60.0)]
    times = run(planner, moves)
    half = math.sin(math.radians(45.0))
    corner = math.sqrt(2000.0 * math.sqrt(2) * 0.02 * half / (1 - half))
    inner = 20.0 / 60.0 + (60.0 - corner) ** 2 / (2 * 60.0 * 2000.0) * 2
    assert times[1] - times[0] == pytest.approx(inner, rel=1e-2)


def reference_times(points: np.ndarray, feed: float, speed: np.ndarray, acceleration: np.ndarray, jump: np.ndarray):
    """Rest to rest over all points with unlimited look-ahead: speeds per corner, then two passes, in plain numpy."""
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps[:, :3], axis=1)
    ratio = np.abs(steps) / length[:, None]
    nominal = np.minimum(feed, (speed / np.maximum(ratio, 1e-12)).min(axis=1))
    rate = (acceleration / np.maximum(ratio, 1e-12)).min(axis=1)
    direction = steps / length[:, None]
    corner = np.zeros(len(steps) + 1)
    for i in range(1, len(steps)):
        v = min(nominal[i - 1], nominal[i])
        change = np.abs(direction[i] - direction[i - 1]) * v
        corner[i] = v * min(1.0, (jump / np.maximum(change, 1e-12)).min())
    for i in range(len(steps) - 1, -1, -1):
        corner[i] = min(corner[i], math.sqrt(corner[i + 1] ** 2 + 2 * rate[i] * length[i]))
    total = 0.0
    for i in range(len(steps)):
        corner[i + 1] = min(corner[i + 1], math.sqrt(corner[i] ** 2 + 2 * rate[i] * length[i]))
        peak = math.sqrt((corner[i] ** 2 + corner[i + 1] ** 2) / 2 + rate[i] * length[i])
        top = min(peak, nominal[i])
        ramps = (2 * top**2 - corner[i] ** 2 - corner[i + 1] ** 2) / (2 * rate[i])
        total += (2 * top - corner[i] - corner[i + 1]) / rate[i] + max(length[i] - ramps, 0.0) / top
    return total


@pytest.mark.parametrize("seed", range(4))
def test_job_time_agrees_with_a_second_planner(profile: MachineProfile, seed: int) -> None:
    """Five axes on a curved path in 1 to 3 mm pieces: long enough to make sixteen blocks as good as all."""
    random = np.random.default_rng(seed)
    t = np.cumsum(random.uniform(0.02, 0.06, 300))
    points = np.column_stack([50 * np.cos(t), 50 * np.sin(t), 0.2 * t, 20 * np.sin(1.3 * t), 20 * np.cos(0.7 * t) - 20])
    points = np.vstack([np.zeros(5), points])
    steps = np.array([80, 80, 400, 44.4444, 44.4444])
    points = np.round(points * steps) / steps
    feed = 40.0
    moves = [(dict(zip("XYZAB", row, strict=True)), feed) for row in points[1:]]
    times = run(Planner(profile), moves)
    limits = np.array([[200, 200, 40, 180, 180], [2000, 2000, 500, 1800, 1800], [8, 8, 4, 8, 8]], float)
    assert times[-1] == pytest.approx(reference_times(points, feed, *limits), rel=0.03)


def test_too_short_moves_are_not_lost(profile: MachineProfile) -> None:
    """Under six steps nothing moves; the next block makes up for it."""
    planner = Planner(profile)
    run(planner, [({"X": 0.01 * i}, 10.0) for i in range(1, 101)])
    assert planner.records()[-1, 0] == pytest.approx(1.0, abs=0.06)
    assert len(planner.records()) < 100


def test_joints_are_where_the_trapezoid_says_at_every_moment(profile: MachineProfile) -> None:
    planner = Planner(profile)
    planner.add([100.0, 0, 0, 0, 0, 0], 100.0, 1.0, 1, 0.0)
    planner.fire()
    t = np.linspace(0.0, 1.05, 200)
    x = np.array([planner.steps_now(FIRST_MOVE_DELAY + float(at))[0] / 80.0 for at in t])
    ramp = 100.0 / 2000.0
    exact = np.where(
        t < ramp,
        1000.0 * t**2,
        np.where(t < 1.0, 2.5 + 100.0 * (t - ramp), 100.0 - 1000.0 * (1.05 - t) ** 2),
    )
    behind = exact - x
    assert behind.max() < 5 / 80.0
    assert behind.min() > -4 / 80.0
