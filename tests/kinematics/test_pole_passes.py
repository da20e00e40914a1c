"""A platter machine is singular at the vertical tool: passing the top of a dome is the hard case."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_kinematics.branches import choose
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.pole import tube

RADIUS, WANTED = 40.0, 30.0


def dome_pass(off_deg, turn_deg=0.0, step=0.4):
    """Straight over a dome, `off_deg` beside its top at the nearest, in any direction."""
    aside = RADIUS * np.sin(np.radians(off_deg))
    ring = np.sqrt(RADIUS**2 - aside**2)
    a = np.radians(np.arange(-45, 45, np.degrees(step / ring)))
    normals = np.stack([ring * np.sin(a), np.full(len(a), aside), ring * np.cos(a)], axis=1) / RADIUS
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    normals = normals @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return normals * RADIUS - [0, 0, RADIUS - 20], normals


def lean_deg(one, other):
    return np.degrees(2 * np.arcsin(np.linalg.norm(one - other, axis=1) / 2))


def speed_ratio(machine, points, joints):
    """Least ratio of the tip speed that the joints' caps allow to the wanted one."""
    wanted = np.linalg.norm(np.diff(points, axis=0), axis=1) / WANTED
    needed = (np.abs(np.diff(joints, axis=0)) / machine.array("speed")).max(axis=1)
    return float((wanted / needed).min())


@pytest.mark.parametrize("turn_deg", [0, 37, 180, 260])
@pytest.mark.parametrize("off_deg", [0, 0.1, 1, 2.5, 3.5, 5])
@pytest.mark.parametrize("name", ["tilt_then_platter", "finite_platter", "yaw_head", "nutating_head", "head_and_table"])
def test_with_five_degrees_of_tolerance_a_dome_is_passed_at_speed(machines, name, off_deg, turn_deg):
    machine = machines[name]
    chain = JointChain.from_profile(machine)
    points, tool_axes = dome_pass(off_deg, turn_deg)
    first = np.arange(len(points)) == 0
    choice = choose(chain, machine, points, tool_axes, travel=first, axis_tolerance=np.radians(5))
    reached, turned = chain.forward(choice.joints)
    assert_allclose(reached, points, rtol=0, atol=1e-9)
    assert_allclose(turned, choice.tool_axes, rtol=0, atol=1e-8)
    assert lean_deg(turned, tool_axes).max() <= 5 + 1e-6
    assert choice.rewinds.size == 0
    assert speed_ratio(machine, points, choice.joints) >= 0.8


def test_without_tolerance_the_tool_keeps_to_the_normals_and_the_platter_pays(machines):
    machine = machines["tilt_then_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = dome_pass(1)
    choice = choose(chain, machine, points, tool_axes, travel=np.arange(len(points)) == 0)
    assert (choice.tool_axes == tool_axes).all()
    assert_allclose(chain.forward(choice.joints)[1], tool_axes, atol=1e-9)
    assert speed_ratio(machine, points, choice.joints) < 0.2


def test_exactly_over_the_pole_the_platter_stands_still_and_the_tilt_passes_through_zero(machines):
    machine = machines["tilt_then_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = dome_pass(0, 37)
    choice = choose(chain, machine, points, tool_axes, travel=np.arange(len(points)) == 0)
    platter, tilt = choice.joints[:, chain.rotary].T
    assert np.ptp(platter) < 1e-9
    assert tilt.min() < -0.7
    assert tilt.max() > 0.7


def test_far_from_the_pole_the_tolerance_is_not_used(machines):
    machine = machines["tilt_then_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = dome_pass(42)
    choice = choose(chain, machine, points, tool_axes, travel=np.arange(len(points)) == 0, axis_tolerance=np.radians(5))
    assert_allclose(choice.tool_axes, tool_axes, atol=1e-9)


def test_a_cradle_needs_no_tolerance(machines):
    machine = machines["cradle"]
    chain = JointChain.from_profile(machine)
    for off_deg in (0, 0.1, 1, 5):
        points, tool_axes = dome_pass(off_deg)
        choice = choose(
            chain, machine, points, tool_axes, travel=np.arange(len(points)) == 0, axis_tolerance=np.radians(5)
        )
        assert_allclose(choice.tool_axes, tool_axes, atol=1e-9)
        assert speed_ratio(machine, points, choice.joints) > 0.8


def test_the_tube_is_exactly_where_the_tool_stays_within_the_tolerance(machines):
    for name in ("tilt_then_platter", "nutating_head", "slanted", "head_and_table"):
        chain = JointChain.from_profile(machines[name])
        rng = np.random.default_rng(8)
        bearing, polar = rng.uniform(-4, 4, 200), np.radians(rng.uniform(4, 18, 200))
        w1 = chain.rotary_axes[0]
        side = np.cross(w1, [0.3, 0.7, 0.1]) / np.linalg.norm(np.cross(w1, [0.3, 0.7, 0.1]))
        across = np.cos(bearing)[:, None] * side + np.sin(bearing)[:, None] * np.cross(w1, side)
        tool_axes = np.cos(polar)[:, None] * w1 + np.sin(polar)[:, None] * across
        points = np.zeros((200, 3))
        tolerance = np.radians(5)
        for joints in chain.inverse(points, tool_axes):
            reached = np.isfinite(joints).all(axis=1)
            low, high = tube(chain, points[reached], tool_axes[reached], joints[reached], tolerance)
            for edge, outward in ((low, -1.0), (high, 1.0)):
                bounded = np.isfinite(edge)
                inside = best_lean(chain, tool_axes[reached][bounded], edge[bounded] - 1e-4 * outward)
                outside = best_lean(chain, tool_axes[reached][bounded], edge[bounded] + 0.05 * outward)
                assert (inside < 5.01).all()
                if name in ("tilt_then_platter", "head_and_table"):
                    assert (outside > 5).all()


def best_lean(chain, tool_axes, angles):
    """Least angle in degrees to tool_axes with rotary 1 at angles, rotary 2 searched."""
    least = np.full(len(angles), np.inf)
    for tilt in np.linspace(-np.pi, np.pi, 1441):
        joints = np.zeros((len(angles), 5))
        joints[:, chain.rotary[0]], joints[:, chain.rotary[1]] = angles, tilt
        least = np.minimum(least, lean_deg(chain.forward(joints)[1], tool_axes))
    return least
