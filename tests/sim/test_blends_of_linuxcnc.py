"""LinuxCNC's overlapping moves against LinuxCNC: 36 moves driven by the real controller, sampled every servo cycle.

LinuxCNC 2.9.0~pre1 (Debian 12, `linuxcnc-uspace`, POSIX non-realtime) with trivkins XYZABU, axis limits as below and
SERVO_PERIOD 1 ms ran the words below after `G90 G92 U0 G64 P0.01 G93`; `halsampler` recorded joint.N.motor-pos-cmd.
"""

import numpy as np
import pytest

from trunnion_motion.overlapping import Path, overlapping
from trunnion_sim.blend_kernel import linuxcnc

SPEED = np.array([200.0, 200.0, 20.0, 90.0, 180.0, 50.0])
ACCELERATION = np.array([1000.0, 1000.0, 200.0, 500.0, 1000.0, 3000.0])
TOLERANCE, CYCLE = 0.01, 1e-3
WORDS = np.array(
    [
        (0.4, 0, 0.02, 0.3, 1.5, 0.02, 4500),
        (0.7876, 0.099, 0.04, 0.7683, 2.8816, 0.04, 1800),
        (1.1386, 0.2907, 0.06, 1.2502, 3.9267, 0.06, 1800),
        (1.4313, 0.5634, 0.08, 1.5784, 4.4702, 0.08, 1800),
        (1.6474, 0.9, 0.1, 1.727, 4.4264, 0.1, 1800),
        (1.7735, 1.2796, 0.12, 1.8352, 3.8022, 0.12, 4500),
        (1.8018, 1.6786, 0.14, 2.0793, 2.6961, 0.14, 1800),
        (1.7305, 2.0722, 0.16, 2.5107, 1.2827, 0.16, 1800),
        (1.5641, 2.4359, 0.18, 3.0086, -0.2147, 0.18, 1800),
        (1.3128, 2.7471, 0.2, 3.391, -1.5598, 0.2, 1800),
        (0.9923, 2.9865, 0.22, 3.5822, -2.5403, 0.22, 4500),
        (0.6226, 3.1392, 0.24, 3.6822, -3.0013, 0.24, 1800),
        (0.2266, 3.1956, 0.26, 3.8749, -2.8701, 0.26, 1800),
        (-0.171, 3.1523, 0.28, 4.259, -2.1673, 0.28, 1800),
        (-0.5456, 3.012, 0.3, 4.7571, -1.0039, 0.3, 1800),
        (-0.8738, 2.7834, 0.32, 5.1871, 0.4363, 0.32, 4500),
        (-1.1353, 2.4807, 0.34, 5.4296, 1.9261, 0.34, 1800),
        (-1.3137, 2.1227, 0.36, 5.5373, 3.2302, 0.36, 1800),
        (-1.3981, 1.7317, 0.38, 5.6871, 4.1427, 0.38, 1800),
        (-1.383, 1.3319, 0.4, 6.0171, 4.5196, 0.4, 1800),
        (-1.2695, 0.9484, 0.42, 6.4996, 4.3014, 0.42, 4500),
        (-1.0647, 0.6048, 0.44, 6.967, 3.5224, 0.44, 1800),
        (-0.7812, 0.3226, 0.46, 7.2652, 2.3058, 0.46, 1800),
        (-0.4368, 0.1193, 0.48, 7.396, 0.8435, 0.48, 1800),
        (-0.4368, 0.1193, 0.48, 7.396, 0.8435, -0.32, 2625),
        (-0.4368, 0.1193, 1.48, 7.396, 0.8435, -0.32, 900),
        (11.5632, 3.1193, 1.48, 7.396, 0.8435, -0.32, 600),
        (11.5632, 3.1193, 0.48, 7.396, 0.8435, -0.32, 900),
        (11.5632, 3.1193, 0.48, 7.396, 0.8435, 0.48, 2625),
        (11.5632, 3.1193, 0.48, 7.396, 10.8435, 0.48, 300),
        (13.5632, 3.1193, 0.48, 7.396, 10.8435, 0.55, 1200),
        (15.5632, 3.1193, 0.48, 7.396, 10.8435, 0.62, 1200),
        (17.5632, 3.1193, 0.48, 7.396, 10.8435, 0.69, 1200),
        (19.5632, 3.1193, 0.48, 7.396, 10.8435, 0.76, 1200),
        (21.5632, 3.1193, 0.48, 7.396, 10.8435, 0.83, 1200),
        (23.5632, 3.1193, 0.48, 7.396, 10.8435, 0.9, 1200),
    ]
)
"""X, Y, Z mm, A, B degrees, U mm, F in 1/min: a curve that turns, a retraction, a travel, a prime, a turn, a bead."""
CYCLES = 2518
"""In which the controller moved."""
SAMPLES = {
    100: (0.499261, 0.027253, 0.025134, 0.423336, 1.852436, 0.025134),
    200: (1.197292, 0.34963, 0.064135, 1.313237, 4.023332, 0.064135),
    300: (1.756959, 1.241816, 0.11797, 1.82942, 3.847108, 0.11797),
    400: (1.754843, 1.936307, 0.153099, 2.362027, 1.770164, 0.153099),
    500: (1.474496, 2.546071, 0.187097, 3.143721, -0.691266, 0.187097),
    600: (0.814073, 3.059757, 0.229633, 3.63006, -2.760604, 0.229633),
}
"""Joints after so many cycles."""


def moves():
    places = np.vstack([np.zeros(6), WORDS[:, :6]])
    return places, np.diff(places, axis=0)


def law(words=slice(None), tolerance=TOLERANCE, cycle=CYCLE):
    _, delta = moves()
    delta = np.ascontiguousarray(delta[words])
    n = len(delta)
    linear = np.array([True, True, True, False, False, False])
    return linuxcnc(
        delta, linear, WORDS[words, 6] / 60, np.ones(n, bool), np.arange(n) == 0, SPEED, ACCELERATION, tolerance, cycle
    )


def joints_at(seconds, of):
    length, _, entry, cruise, leave, acceleration, duration = of
    ends = np.cumsum(duration)
    row = int(np.searchsorted(ends, seconds, side="right"))
    t = seconds - (ends[row] - duration[row])
    up, down = (cruise[row] - entry[row]) / acceleration[row], (cruise[row] - leave[row]) / acceleration[row]
    flat = duration[row] - up - down
    a, b, c = min(t, up), min(max(t - up, 0), flat), max(t - up - flat, 0)
    way = entry[row] * a + acceleration[row] / 2 * (a**2 - c**2) + cruise[row] * (b + c)
    places, delta = moves()
    return places[row] + way / length[row] * delta[row]


def test_the_whole_takes_as_long_as_in_the_real_controller():
    assert law()[-1].sum() / CYCLE == pytest.approx(CYCLES, abs=0.002 * CYCLES)


@pytest.mark.parametrize("cycles", SAMPLES)
def test_joints_are_where_the_real_controller_has_them(cycles):
    """Within what the controller itself leaves the corners by, up to 0.06 mm here."""
    there = joints_at((cycles + 1) * CYCLE, law())
    assert np.abs(there - SAMPLES[cycles])[:3].max() < 0.05
    assert np.abs(there - SAMPLES[cycles])[3:5].max() < 0.06


def test_every_row_is_a_trapezoid_of_its_own_length_and_time():
    length, _, entry, cruise, leave, acceleration, duration = law()
    up, down = (cruise - entry) / acceleration, (cruise - leave) / acceleration
    flat = duration - up - down
    assert flat.min() > -1e-9
    way = (entry + cruise) / 2 * up + cruise * flat + (cruise + leave) / 2 * down
    np.testing.assert_allclose(way, length, rtol=1e-6)


def test_plan_and_judge_follow_the_controller_alike():
    """Two roads: one simulates the queue of two moves, the other lays finished ramps over each other."""
    _, delta = moves()
    straight = np.linalg.norm(delta[:, :3], axis=1)
    turned = np.linalg.norm(delta[:, 3:5], axis=1)
    fed = np.abs(delta[:, 5])
    length = np.where(straight > 0, straight, np.where(fed > 0, fed, turned))
    with np.errstate(divide="ignore"):
        speed = (SPEED * length[:, None] / np.abs(delta)).min(axis=1)
        push = (ACCELERATION * length[:, None] / np.abs(delta)).min(axis=1)
    path = Path(
        length=length,
        wanted=np.minimum(speed, length * WORDS[:, 6] / 60),
        push=push,
        direction=np.where(straight[:, None] > 0, delta[:, :3] / np.maximum(straight, 1e-9)[:, None], [1.0, 0.0, 0.0]),
        plain=(straight > 0) & (turned == 0) & (fed == 0),
        stops=np.arange(len(length)) == 0,
    )
    entry, peak, leave, ramp = overlapping(path, ACCELERATION[:3], TOLERANCE)
    length, _, judged_entry, judged_peak, judged_leave, _, judged_time = law()
    time = (2 * peak - entry - leave) / ramp
    time += np.maximum(length - (2 * peak**2 - entry**2 - leave**2) / (2 * ramp), 0) / peak
    np.testing.assert_allclose(time, judged_time, atol=1.1e-3)
    assert time.sum() == pytest.approx(judged_time.sum(), abs=2e-3)
    close = np.abs(peak / judged_peak - 1) < 0.02
    assert length[close].sum() > 0.98 * length.sum()
    assert np.abs(entry - judged_entry)[close].max() < 1.0
    assert np.abs(leave - judged_leave)[close].max() < 1.0


def test_a_lone_move_has_half_its_acceleration():
    """2 mm at no more than 40 mm/s with 500 mm/s²: it never gets there."""
    assert law(slice(30, 31))[-1].sum() == pytest.approx(2 * np.sqrt(2.0 / 500), abs=2 * CYCLE)


def test_a_creeping_inverse_feed_is_lifted():
    """G93 reads no less than 0.1 units a minute (`inverse_time_rate_straight`)."""
    delta = np.array([[0.5, 0, 0, 0, 0, 0]])
    linear = np.array([True, True, True, False, False, False])
    one = np.ones(1, bool)
    asked = linuxcnc(delta, linear, np.array([0.001 / 60]), one, one, SPEED, ACCELERATION, TOLERANCE, CYCLE)[1]
    assert asked[0] == pytest.approx(0.1 / 60)


def test_a_zigzag_of_hundredths_leaves_something_between_its_arcs():
    """Both arcs of a move want more than half of it; what was left was nothing, and 0 / 0."""
    turns = np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0]])
    path = Path(
        length=np.full(4, 0.01),
        wanted=np.full(4, 50.0),
        push=np.full(4, 1000.0),
        direction=turns,
        plain=np.ones(4, bool),
        stops=np.arange(4) == 0,
    )
    entry, peak, leave, ramp = overlapping(path, np.full(3, 1000.0), TOLERANCE)
    assert np.isfinite([entry, peak, leave, ramp]).all()
    delta = np.column_stack([0.01 * turns, np.zeros((4, 3))])
    linear = np.array([True, True, True, False, False, False])
    judged = linuxcnc(
        delta, linear, np.full(4, 50.0), np.zeros(4, bool), np.arange(4) == 0, np.full(6, 200.0), np.full(6, 1000.0),
        TOLERANCE, CYCLE,
    )  # fmt: skip
    assert np.isfinite(judged).all()
    assert judged[6].min() > 0
