"""The firmware's time law: analytic cases, limits kept when resampled, brute force on small cases."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_motion.timelaw import BY_WISH, speeds_at, time_law

SPEED = np.array([200.0, 150.0, 40.0, 3.0, 3.0])
ACCELERATION = np.array([2000.0, 1500.0, 500.0, 30.0, 25.0])
CORNER = np.array([8.0, 8.0, 2.0, 0.15, 0.15])


def law_of(joints, wanted=np.inf, tip=None, **more):
    steps = np.diff(joints, axis=0)
    length = np.linalg.norm(steps[:, :3], axis=1) if tip is None else tip
    return time_law(steps, length, np.full(len(steps), wanted), SPEED, ACCELERATION, CORNER, **more)


def wavy(n=4000, seed=0):
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 300, n)
    joints = np.zeros((n, 5))
    for j, size in enumerate([40, 30, 6, 0.6, 0.8]):
        for wave in rng.uniform(8, 60, 3):
            joints[:, j] += size / 3 * np.sin(s / wave + rng.uniform(0, 6))
    return joints


def test_a_single_straight_move_is_a_trapezoid():
    joints = np.zeros((2, 5))
    joints[1, 0] = 100
    law = law_of(joints, wanted=50)
    assert_allclose(law.total, 100 / 50 + 50 / 2000, rtol=1e-12)
    assert_allclose(law.peak, [50])
    assert law.limited_by[0] == BY_WISH


def test_a_short_move_is_a_triangle():
    joints = np.zeros((2, 5))
    joints[1, 0] = 1
    assert_allclose(law_of(joints).total, 2 * np.sqrt(1 / 2000), rtol=1e-12)


def test_splitting_a_straight_move_changes_nothing():
    joints = np.array([[0, 0, 0, 0, 0], [60, 30, 5, 0.4, -0.2]], dtype=float)
    fraction = np.sort(np.random.default_rng(3).uniform(0, 1, 400))
    split = np.concatenate([joints[:1], fraction[:, None] * joints[1], joints[1:]])
    assert_allclose(law_of(split, 80).total, law_of(joints, 80).total, rtol=1e-9)


def test_a_pure_turn_takes_the_rotary_its_time():
    joints = np.zeros((2, 5))
    joints[1, 3] = 1.5
    law = law_of(joints, tip=np.zeros(1))
    assert_allclose(law.total, 1.5 / 3 + 3 / 30, rtol=1e-12)
    assert law.limited_by[0] == 3


def test_the_tip_still_rows_obey_a_share_of_full_speed():
    joints = np.zeros((2, 5))
    joints[1, 3] = 3
    assert_allclose(law_of(joints, wanted=0.5, tip=np.zeros(1)).peak * 3, 1.5)


def test_a_right_angle_is_passed_at_the_corner_speed():
    joints = np.zeros((3, 5))
    joints[1:, 0] = 50
    joints[2, 1] = 50
    law = law_of(joints, 100)
    assert_allclose(law.leave[0], 8)
    assert_allclose(law.entry[1], 8)


def test_a_gentle_corner_slows_just_enough():
    turn = 0.12
    joints = np.zeros((3, 5))
    joints[1, 0] = 50
    joints[2, :2] = [50 + 50 * np.cos(turn), 50 * np.sin(turn)]
    law = law_of(joints, 100)
    assert_allclose(law.entry[1] * np.sin(turn), 8)


def test_junction_deviation_replaces_the_corner_speed():
    joints = np.zeros((3, 5))
    joints[1:, 0] = 50
    joints[2, 1] = 50
    law = law_of(joints, 100, junction_deviation=0.013)
    half = np.sqrt(0.5)
    assert_allclose(law.entry[1] ** 2, 1500 * 0.013 * half / (1 - half), rtol=1e-9)


def test_rows_without_any_motion_take_no_time_and_do_not_stop_the_machine():
    joints = np.zeros((4, 5))
    joints[:, 0] = [0, 30, 30, 60]
    whole = np.zeros((2, 5))
    whole[1, 0] = 60
    law = law_of(joints, 70)
    assert law.duration[1] == 0
    assert_allclose(law.total, law_of(whole, 70).total, rtol=1e-12)


def test_no_rows_take_no_time():
    assert law_of(np.zeros((1, 5))).total == 0


@pytest.mark.parametrize("seed", range(4))
def test_resampled_tenfold_no_joint_breaks_a_limit(seed):
    joints = wavy(seed=seed)
    steps = np.diff(joints, axis=0)
    law = law_of(joints, 120)
    fraction = np.linspace(0, 1, 11)
    times, speeds = speeds_at(law, fraction)
    assert_allclose(times[:, -1], law.duration, rtol=1e-9, atol=1e-12)
    rate = steps / law.length[:, None]
    assert (np.abs(rate[:, None] * speeds[:, :, None]) <= SPEED * (1 + 1e-9)).all()
    inside = np.diff(speeds, axis=1) / np.maximum(np.diff(times, axis=1), 1e-300)
    assert (np.abs(rate[:, None] * inside[:, :, None]) <= ACCELERATION * (1 + 1e-6)).all()
    jump = np.abs(np.diff(rate, axis=0)) * law.entry[1:, None]
    assert (jump <= CORNER * (1 + 1e-9)).all()
    # A run of corners is a curve: what jumps, spread from mid-row to mid-row, is an acceleration too.
    spread = 0.5 * (law.length[1:] + law.length[:-1])
    assert (jump * law.entry[1:, None] / spread[:, None] <= ACCELERATION * (1 + 1e-9)).all()


def test_speeds_meet_at_the_joins_and_rest_at_the_ends():
    law = law_of(wavy())
    assert law.entry[0] == 0
    assert law.leave[-1] == 0
    assert_allclose(law.leave[:-1], law.entry[1:], rtol=1e-12)


def test_no_entry_speed_could_be_higher():
    """On short random paths raising any join's speed breaks a limit somewhere: the law is the pointwise largest."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        joints = np.cumsum(rng.normal(size=(6, 5)) * [2, 2, 0.3, 0.05, 0.05], axis=0)
        law = law_of(joints, 60)
        steps = np.diff(joints, axis=0)
        rate = steps / law.length[:, None]
        for i in range(1, len(steps)):
            raised = law.entry[i] * 1.001
            jump = np.abs(rate[i] - rate[i - 1])
            spread = 0.5 * (law.length[i] + law.length[i - 1])
            corner = (jump * raised > CORNER).any() or (jump * raised**2 / spread > ACCELERATION).any()
            cap = (
                raised > 60 or (np.abs(rate[i]) * raised > SPEED).any() or (np.abs(rate[i - 1]) * raised > SPEED).any()
            )
            late = raised**2 > law.leave[i] ** 2 + 2 * law.acceleration[i] * law.length[i]
            early = raised**2 > law.entry[i - 1] ** 2 + 2 * law.acceleration[i - 1] * law.length[i - 1]
            assert corner or cap or late or early
