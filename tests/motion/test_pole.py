"""Passes over a dome's top on a machine whose platter is singular there."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_kinematics.chain import JointChain
from trunnion_motion.plan import plan

RADIUS = 40.0


def passing(offset_deg):
    """A straight pass over a dome, so many degrees beside its top."""
    y = RADIUS * np.sin(np.radians(offset_deg))
    x = np.linspace(-14, 14, 141)
    normals = np.stack([x, np.full_like(x, y), np.sqrt(RADIUS**2 - x**2 - y**2)], axis=1) / RADIUS
    beads = np.arange(len(x)) > 0
    return Toolpath(
        points=RADIUS * normals - [0, 0, 20],
        tool_axes=normals,
        width=np.where(beads, 0.4, 0.0),
        height=np.where(beads, 0.3, 0.0),
        role=np.where(beads, int(Role.NONPLANAR_INFILL), int(Role.TRAVEL)),
        layer=np.zeros(len(x), dtype=np.int64),
        speed=np.where(beads, 30.0, 120.0),
    )


@pytest.mark.parametrize("offset_deg", [0, 0.1, 1, 2, 3.5, 5])
@pytest.mark.parametrize("machine", ["open5x_voron0", "open5x_prusa_i3", "rep5x_ender3"])
def test_with_tolerance_the_tip_keeps_its_speed_past_the_pole(machine, offset_deg):
    profile = load_profile(machine)
    toolpath = passing(offset_deg)
    program = plan(toolpath, profile, PrintSettings(nonplanar_axis_tolerance=5.0))
    beads = program.width > 0
    along = np.cumsum(program.tip_length[beads])
    steps = np.abs(np.diff(program.joints, axis=0, prepend=program.start[None]))[beads]
    ratio = program.tip_length[beads] / program.duration[beads] / 30.0
    assert (ratio[(along > 1.5) & (along < along[-1] - 1.5)] >= 0.8).all()
    assert (steps / program.cruise[beads][:, None] <= profile.array("speed") * (1 + 1e-9)).all()
    ends = np.flatnonzero(beads)[np.append(np.diff(program.source[beads]) != 0, True)]
    points, axes = JointChain.from_profile(profile).forward(program.joints[ends])
    assert_allclose(points, toolpath.points[1:], rtol=0, atol=1e-6)
    lean = np.degrees(2 * np.arcsin(np.linalg.norm(axes - toolpath.tool_axes[1:], axis=1) / 2))
    assert lean.max() <= 5.0 + 1e-6


def test_without_tolerance_the_platter_sets_the_pace_and_the_tool_stays_true():
    profile = load_profile("open5x_voron0")
    program = plan(passing(0.1), profile, PrintSettings())
    beads = program.width > 0
    assert (program.tip_length[beads] / program.cruise[beads]).min() < 1.0
    ends = np.flatnonzero(beads)[np.append(np.diff(program.source[beads]) != 0, True)]
    _, axes = JointChain.from_profile(profile).forward(program.joints[ends])
    assert_allclose(axes, passing(0.1).tool_axes[1:], rtol=0, atol=1e-9)
