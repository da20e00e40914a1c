import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.profile import load_profile
from trunnion_kinematics.branches import choose
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.subdivide import from_segment, great_circle, subdivide


def dome_pass(off_deg, step, radius=40.0):
    aside = radius * np.sin(np.radians(off_deg))
    ring = np.sqrt(radius**2 - aside**2)
    a = np.radians(np.arange(-45, 45, np.degrees(step / ring)))
    normals = np.stack([ring * np.sin(a), np.full(len(a), aside), ring * np.cos(a)], axis=1) / radius
    return normals * radius - [0, 0, radius - 20], normals


def chosen(machine, points, tool_axes, tolerance_deg=0.0):
    chain = JointChain.from_profile(machine)
    first = np.arange(len(points)) == 0
    return chain, choose(chain, machine, points, tool_axes, travel=first, axis_tolerance=np.radians(tolerance_deg))


@pytest.mark.parametrize(("off_deg", "tolerance_deg"), [(0, 0), (0.1, 0), (1, 0), (1, 5), (5, 5), (20, 0)])
def test_tip_and_tool_stay_within_tolerance_between_all_rows(machine, off_deg, tolerance_deg):
    points, tool_axes = dome_pass(off_deg, 3.0)
    chain, choice = chosen(machine, points, tool_axes, tolerance_deg)
    fine = subdivide(chain, points, choice.tool_axes, choice.joints, 0.01, axis_tolerance=np.radians(0.05))
    assert_allclose(chain.forward(fine.joints)[0], fine.points, rtol=0, atol=1e-9)
    assert_allclose(chain.forward(fine.joints)[1], fine.tool_axes, rtol=0, atol=1e-9)
    for t in np.linspace(0, 1, 41):
        tips, tools = chain.forward(fine.joints[:-1] * (1 - t) + fine.joints[1:] * t)
        assert from_segment(tips, fine.points[:-1], fine.points[1:]).max() < 0.0105
        away = np.linalg.norm(tools - great_circle(fine.tool_axes[:-1], fine.tool_axes[1:], t), axis=1)
        assert np.degrees(away.max()) < 0.0525


def test_old_rows_stay_and_new_rows_lie_on_the_line_in_order(machines):
    points, tool_axes = dome_pass(10, 3.0)
    chain, choice = chosen(machines["tilt_then_platter"], points, tool_axes)
    fine = subdivide(chain, points, choice.tool_axes, choice.joints, 0.002)
    ends = np.append(np.flatnonzero(np.diff(fine.source)), len(fine.source) - 1)
    assert len(fine.source) > 2 * len(points)
    assert (fine.points[ends] == points).all()
    assert (fine.joints[ends] == choice.joints).all()
    assert (np.diff(fine.source) >= 0).all()
    inside = fine.source > 0
    start, end = points[fine.source[inside] - 1], points[fine.source[inside]]
    assert from_segment(fine.points[inside], start, end).max() < 1e-12
    way = np.linalg.norm(np.diff(fine.points, axis=0), axis=1)
    assert way.sum() == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum(), rel=1e-12)


def test_it_inserts_no_more_than_a_few_times_what_the_bow_asks_for(machines):
    points, tool_axes = dome_pass(20, 5.0)
    chain, choice = chosen(machines["cradle"], points, tool_axes)
    rows = [len(subdivide(chain, points, tool_axes, choice.joints, t).source) for t in (0.1, 0.01, 0.001)]
    assert rows[0] < rows[1] < rows[2] < 4 * np.sqrt(10) * rows[1]


def test_rows_on_which_the_rotaries_stand_still_are_left_whole(machines):
    chain = JointChain.from_profile(machines["tilt_then_platter"])
    points = np.array([[0.0, 0, 5], [80, 0, 5], [80, 60, 5]])
    upright = np.tile([0.0, 0, 1], (3, 1))
    joints = chain.at_angles(points, np.tile([0.7, 0.0], (3, 1)))
    fine = subdivide(chain, points, upright, joints, 0.001)
    assert fine.source.tolist() == [0, 1, 2]


def test_a_platter_that_turns_under_an_upright_tool_keeps_the_tip_on_the_line(machines):
    chain = JointChain.from_profile(machines["tilt_then_platter"])
    points = np.array([[40.0, 0, 5], [40, 10, 5]])
    upright = np.tile([0.0, 0, 1], (2, 1))
    joints = chain.at_angles(points, np.array([[0.0, 0.0], [1.5, 0.0]]))
    fine = subdivide(chain, points, upright, joints, 0.01)
    tips = [chain.forward(fine.joints[:-1] * (1 - t) + fine.joints[1:] * t)[0] for t in np.linspace(0, 1, 21)]
    assert max(from_segment(tip, fine.points[:-1], fine.points[1:]).max() for tip in tips) < 0.0105
    assert (np.diff(fine.joints[:, chain.rotary[0]]) > 0).all()
    assert_allclose(fine.tool_axes, np.tile([0.0, 0, 1], (len(fine.source), 1)), atol=1e-12)


def test_rewinds_stay_whole(machines):
    points, tool_axes = dome_pass(10, 3.0)
    chain, choice = chosen(machines["tilt_then_platter"], points, tool_axes)
    fine = subdivide(chain, points, tool_axes, choice.joints, 0.002, rewinds=np.array([5, 9]))
    assert (np.bincount(fine.source)[[5, 9]] == 1).all()


def test_a_machine_without_rotaries_needs_no_rows():
    chain = JointChain.from_profile(load_profile("generic_3axis"))
    points = np.array([[0.0, 0, 0], [50, 50, 20]])
    fine = subdivide(chain, points, np.tile([0.0, 0, 1], (2, 1)), chain.at_angles(points, np.empty((2, 0))), 0.01)
    assert fine.source.tolist() == [0, 1]


def test_a_step_from_beside_the_pole_to_its_far_side_does_not_turn_the_platter_round(machines):
    """Halving must not creep from one branch to the other: the table would swing the tip through the part."""
    tilt, azimuth = np.radians([0.391, 3.012]), np.radians([-96.0, -2.1])
    tool_axes = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)], axis=1)
    points = np.array([[-17.426, -1.585, 9.2], [-17.237, -1.585, 9.195]])
    chain = JointChain.from_profile(machines["tilt_then_platter"])
    near, far = np.moveaxis(chain.inverse(points, tool_axes), 1, 0)
    column = chain.rotary[0]
    for start in near:
        for end in far.copy():
            end[column] += 2 * np.pi * np.rint((start[column] - end[column]) / (2 * np.pi))
            fine = subdivide(chain, points, tool_axes, np.stack([start, end]), 0.01)
            steps = np.abs(np.diff(fine.joints[:, chain.rotary], axis=0))
            assert np.degrees(steps.max()) < 60
            for t in np.linspace(0, 1, 21):
                tips, _ = chain.forward(fine.joints[:-1] * (1 - t) + fine.joints[1:] * t)
                assert from_segment(tips, *np.broadcast_arrays(tips * 0 + points[0], points[1])).max() < 0.02
