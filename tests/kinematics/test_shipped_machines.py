"""Every shipped 5-axis machine follows the same path with the same trace."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.profile import load_profile, shipped_profiles
from trunnion_kinematics.branches import choose
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.subdivide import from_segment, subdivide

FIVE_AXIS = [name for name in shipped_profiles() if load_profile(name).rotary]


def printed_dome():
    """Planar lines, then lines over a small dome of 20 mm radius, all within 10 mm of the part's origin."""
    y, x = np.mgrid[-8:8.1:2, -8:8.1:0.5]
    flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)], axis=1)
    up = np.stack([x.ravel(), y.ravel(), np.sqrt(400 - x.ravel() ** 2 - y.ravel() ** 2)], axis=1)
    points = np.concatenate([flat, up - [0, 0, 15]])
    tool_axes = np.concatenate([np.tile([0.0, 0, 1], (len(flat), 1)), up / 20])
    return points, tool_axes, np.arange(len(points)) % x.shape[1] == 0


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_the_same_path_gives_the_same_trace(name):
    machine = load_profile(name)
    chain = JointChain.from_profile(machine)
    points, tool_axes, travel = printed_dome()
    choice = choose(chain, machine, points, tool_axes, travel=travel)
    reached, turned = chain.forward(choice.joints)
    assert_allclose(reached, points, rtol=0, atol=1e-6)
    assert np.degrees(np.abs(turned - tool_axes).max()) < 1e-6
    assert choice.rewinds.size == 0
    fine = subdivide(chain, points, tool_axes, choice.joints, 0.01)
    middle, _ = chain.forward((fine.joints[:-1] + fine.joints[1:]) / 2)
    assert from_segment(middle, fine.points[:-1], fine.points[1:]).max() < 0.0105
    assert (choice.joints >= machine.array("min") - 1e-6).all()
    assert (choice.joints <= machine.array("max") + 1e-6).all()


def test_there_are_platters_and_heads_among_them():
    assert {"generic_ab_cradle"} <= set(FIVE_AXIS)
