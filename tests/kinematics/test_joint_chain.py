import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trunnion_core.errors import ProfileError
from trunnion_core.profile import load_profile
from trunnion_core.tolerance import ROUND_TRIP
from trunnion_kinematics.chain import JointChain


def unit_rows(rng, n):
    rows = rng.normal(size=(n, 3))
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def assert_undone(chain, points, tool_axes):
    """Every finite branch leads back, and there is one for every tool axis called reachable."""
    joints = chain.inverse(points, tool_axes)
    reachable = chain.reachable(tool_axes)
    for branch in joints:
        reached = np.isfinite(branch).all(axis=1)
        assert not reached[~reachable].any()
        again, axes_again = chain.forward(branch[reached])
        assert_allclose(again, points[reached], rtol=0, atol=ROUND_TRIP)
        assert_allclose(axes_again, tool_axes[reached], rtol=0, atol=ROUND_TRIP)
    return joints


def test_forward_is_the_two_chains_multiplied_out(machine, oracle):
    rng = np.random.default_rng(1)
    joints = rng.uniform(-3, 3, (50, 5)) * np.where([j.rotary for j in machine.joints], 2, 50)
    points, tool_axes = JointChain.from_profile(machine).forward(joints)
    expected, expected_axes = oracle(machine, joints)
    assert_allclose(points, expected, rtol=0, atol=1e-9)
    assert_allclose(tool_axes, expected_axes, rtol=0, atol=1e-12)


def test_forward_undoes_every_branch_of_inverse(machine):
    rng = np.random.default_rng(2)
    chain = JointChain.from_profile(machine)
    points, tool_axes = rng.uniform(-100, 100, (2000, 3)), unit_rows(rng, 2000)
    joints = assert_undone(chain, points, tool_axes)
    angles = joints[:, :, chain.rotary]
    assert (angles[np.isfinite(angles)] > -math.pi).all()
    assert (angles[np.isfinite(angles)] <= math.pi).all()


def test_random_chains_round_trip_and_agree_with_the_oracle(make_random_profile, oracle):
    rng = np.random.default_rng(3)
    for _ in range(100):
        machine = make_random_profile(rng)
        chain = JointChain.from_profile(machine)
        points, tool_axes = rng.uniform(-100, 100, (1000, 3)), unit_rows(rng, 1000)
        joints = assert_undone(chain, points, tool_axes)
        reached = np.isfinite(joints).all(axis=(0, 2))
        for branch in joints[:, reached][:, :2]:
            expected, expected_axes = oracle(machine, branch)
            assert_allclose(expected, points[reached][:2], rtol=1e-10, atol=1e-6)
            assert_allclose(expected_axes, tool_axes[reached][:2], rtol=0, atol=1e-9)


def test_poses_made_by_forward_are_found_again(machine):
    rng = np.random.default_rng(4)
    chain = JointChain.from_profile(machine)
    made = rng.uniform(-1, 1, (1000, 5)) * np.where([j.rotary for j in machine.joints], 3.1, 50)
    found = chain.inverse(*chain.forward(made))
    turn = np.mod(found - made + np.pi, 2 * np.pi) - np.pi
    turn[..., chain.linear] = (found - made)[..., chain.linear]
    miss = np.abs(turn).max(axis=2).min(axis=0)
    assert np.nanmax(miss) < 1e-6
    assert np.isfinite(miss).mean() > 0.99


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), polar=st.sampled_from([0, 1e-13, 1e-9, 1e-7, 1e-4, 0.01, 1]), turn=st.floats(-4, 4)
)
def test_near_the_pole_of_any_machine_nothing_is_lost(make_random_profile, seed, polar, turn):
    chain = JointChain.from_profile(make_random_profile(np.random.default_rng(seed)))
    w1 = chain.rotary_axes[0]
    side = np.cross(w1, [0.3, 0.5, 0.8])
    side = np.cos(turn) * side / np.linalg.norm(side) + np.sin(turn) * np.cross(w1, side / np.linalg.norm(side))
    tool_axes = np.stack([np.cos(polar) * w1 + np.sin(polar) * side, -np.cos(polar) * w1 + np.sin(polar) * side])
    assert_undone(chain, np.zeros((2, 3)), tool_axes)


@pytest.mark.parametrize("name", ["tilt_then_platter", "yaw_head", "nutating_head", "head_and_table"])
def test_at_the_pole_the_free_rotary_is_zero_and_all_else_exact(machines, name):
    chain = JointChain.from_profile(machines[name])
    points = np.array([[10.0, 20.0, 5.0]])
    joints = assert_undone(chain, points, np.array([[0.0, 0.0, 1.0]]))
    assert np.isfinite(joints).all()
    assert (joints[:, 0, chain.rotary[0]] == 0).all()
    assert chain.singularity(np.array([[0.0, 0.0, 1.0]]))[0] == pytest.approx(0, abs=1e-9)


def test_a_cradle_has_no_pole_at_the_upright_tool(machines):
    chain = JointChain.from_profile(machines["cradle"])
    assert chain.singularity(np.array([[0.0, 0.0, 1.0]]))[0] == pytest.approx(1)
    assert chain.singularity(np.array([[0.0, 1.0, 0.0]]))[0] == pytest.approx(0, abs=1e-12)


def test_orthogonal_axes_have_the_known_pair_of_solutions(machines):
    chain = JointChain.from_profile(machines["tilt_then_platter"])
    lean = np.radians(30)
    first, second = chain.inverse(np.zeros((1, 3)), np.array([[np.sin(lean), 0, np.cos(lean)]]))[:, 0][:, chain.rotary]
    assert first[1] == pytest.approx(-second[1])
    assert abs(first[0] - second[0]) == pytest.approx(np.pi)
    assert {round(abs(first[0]), 9), round(abs(second[0]), 9)} == {0, round(np.pi, 9)}


def test_a_nutating_head_of_45_degrees_reaches_a_half_space(machines):
    chain = JointChain.from_profile(machines["nutating_head"])
    tilt = np.radians([0, 45, 89.99, 90.01, 135, 180])
    tool_axes = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=1)
    assert chain.reachable(tool_axes).tolist() == [True, True, True, False, False, False]
    assert np.isnan(chain.inverse(np.zeros((6, 3)), tool_axes)[:, 3:]).all()
    assert np.isnan(chain.singularity(tool_axes)[3:]).all()


def test_reach_is_what_sampled_rotaries_can_do(make_random_profile):
    rng = np.random.default_rng(5)
    for _ in range(10):
        chain = JointChain.from_profile(make_random_profile(rng))
        joints = np.zeros((4000, 5))
        joints[:, chain.rotary] = rng.uniform(-np.pi, np.pi, (4000, 2))
        along = chain.forward(joints)[1] @ chain.rotary_axes[0]
        wanted = unit_rows(rng, 500)
        inside = (wanted @ chain.rotary_axes[0] > along.min()) & (wanted @ chain.rotary_axes[0] < along.max())
        assert (chain.reachable(wanted) | ~inside).all()
        assert (chain.reachable(wanted) == inside).mean() > 0.98


def test_jacobian_is_the_derivative_and_its_orientation_part_has_the_singularity_as_determinant(machine):
    rng = np.random.default_rng(6)
    chain = JointChain.from_profile(machine)
    joints = rng.uniform(-1, 1, (30, 5)) * np.where([j.rotary for j in machine.joints], 3, 50)
    jacobian = chain.jacobian(joints)
    _, tool_axes = chain.forward(joints)
    for column in range(5):
        step = np.zeros(5)
        step[column] = 1e-5
        there, back = np.hstack(chain.forward(joints + step)), np.hstack(chain.forward(joints - step))
        assert_allclose(jacobian[:, :, column], (there - back) / 2e-5, rtol=0, atol=1e-6)
    turning = jacobian[:, 3:, chain.rotary]
    area = np.linalg.norm(np.cross(turning[:, :, 0], turning[:, :, 1]), axis=1)
    assert_allclose(chain.singularity(tool_axes), area, rtol=0, atol=1e-7)


def test_at_angles_puts_the_tip_on_the_point(machine):
    rng = np.random.default_rng(7)
    chain = JointChain.from_profile(machine)
    points, angles = rng.uniform(-50, 50, (100, 3)), rng.uniform(-1, 1, (100, 2))
    joints = chain.at_angles(points, angles)
    assert_allclose(joints[:, chain.rotary], angles, rtol=0, atol=0)
    assert_allclose(chain.forward(joints)[0], points, rtol=0, atol=ROUND_TRIP)


def test_a_machine_without_rotaries_has_one_branch_and_one_tool_axis(oracle):
    machine = load_profile("generic_3axis")
    chain = JointChain.from_profile(machine)
    points = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]])
    lean = np.radians([0, 0.0005, 1])
    tool_axes = np.stack([np.sin(lean), 0 * lean, np.cos(lean)], axis=1)
    joints = chain.inverse(points, tool_axes)
    assert joints.shape == (1, 3, 3)
    assert chain.reachable(tool_axes).tolist() == [True, True, False]
    assert np.isnan(joints[0, 2]).all()
    assert_allclose(oracle(machine, joints[0, :2])[0], points[:2], rtol=0, atol=1e-12)
    assert_allclose(chain.forward(joints[0, :2])[0], points[:2], rtol=0, atol=1e-12)
    assert chain.jacobian(joints[0, :2]).shape == (2, 6, 3)
    assert chain.singularity(tool_axes)[0] == 1


def test_a_rotary_that_only_spins_the_tool_is_refused(make_profile, joint_tables):
    linear, rotary = joint_tables
    moves = [linear("X", "tool", [1, 0, 0], -9, 9), linear("Y", "tool", [0, 1, 0], -9, 9)]
    turns = [rotary("B", "work", [0, 1, 0], [0, 0, 0], 90), rotary("C", "tool", [0, 0, 1], [0, 0, 0], 90)]
    with pytest.raises(ProfileError, match="joint C: its axis is parallel to tool"):
        JointChain.from_profile(make_profile("spin", [*moves, linear("Z", "tool", [0, 0, 1], -9, 9), *turns]))


def test_no_rows_give_no_rows(machine):
    chain = JointChain.from_profile(machine)
    assert chain.inverse(np.empty((0, 3)), np.empty((0, 3))).shape == (2, 0, 5)
    assert chain.forward(np.empty((0, 5)))[0].shape == (0, 3)


def test_wrong_shapes_are_refused(machine):
    with pytest.raises(ValueError, match="should be"):
        JointChain.from_profile(machine).forward(np.zeros((3, 4)))
