"""For each firmware the tip moves as planned: the written file, replayed under that firmware's own rules."""

import dataclasses

import numpy as np
import pytest
from trunnion.agreement import agreement, on_firmware
from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.dialect import dialect_names
from trunnion_motion.plan import plan_motion
from trunnion_sim.rules import firmware_names

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
MACHINES = ("generic_ab_cradle", "open5x_prusa_i3", "rep5x_ender3")
FIRMWARES = sorted(set(dialect_names()) & set(firmware_names()))


def dome():
    """Zig-zag over a spherical cap, tool along its normals, in two layers at a right angle."""
    return _over(lambda x, y: np.sqrt(40.0**2 - x**2 - y**2) - 34.0, half=12.0)


def propeller():
    """Zig-zag over a blade that twists from one side of the axis to the other."""
    return _over(lambda x, y: 6.0 + 0.02 * x * y + 0.004 * x**2, half=14.0)


def _over(height, half, step=0.45):
    across, along = np.arange(-half, half + 0.1, 1.3), np.arange(-half, half + 0.1, step)
    points, starts = [], []
    for layer in range(2):
        for k, a in enumerate(across):
            b = along if k % 2 == 0 else along[::-1]
            b = b + 0.15 * np.sin(3.1 * b + k)
            x, y = (np.full_like(b, a), b) if layer == 0 else (b, np.full_like(b, a))
            points.append(np.column_stack([x, y, height(x, y) + 0.3 * layer]))
            starts.append(np.arange(len(b)) == 0 if k % 5 == 0 else np.zeros(len(b), dtype=bool))
    points, travel = np.concatenate(points), np.concatenate(starts)
    x, y, e = points[:, 0], points[:, 1], 1e-4
    slope_x = (height(x + e, y) - height(x - e, y)) / (2 * e)
    slope_y = (height(x, y + e) - height(x, y - e)) / (2 * e)
    axes = np.column_stack([-slope_x, -slope_y, np.ones(len(x))])
    return Toolpath(
        points=points,
        tool_axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        width=np.where(travel, 0.0, 0.4),
        height=np.where(travel, 0.0, 0.3),
        role=np.where(travel, int(Role.TRAVEL), int(Role.NONPLANAR_INFILL)),
        layer=np.repeat([0, 1], len(x) // 2),
        speed=np.where(travel, 150.0, 40.0),
    )


TOOLPATHS = {"dome": dome(), "propeller": propeller()}


@pytest.mark.parametrize("shape", TOOLPATHS)
@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_tip_moves_as_planned(firmware, machine, shape):
    profile = on_firmware(load_profile(machine), firmware)
    found = agreement(plan_motion(TOOLPATHS[shape], profile, SETTINGS), profile, SETTINGS)
    assert found.share_within(0.02) >= 0.99
    assert found.time_ratio == pytest.approx(1.0, abs=0.01)
    assert found.joint_speed.max() <= 1.005


def test_every_dialect_can_be_replayed():
    assert set(dialect_names()) == set(firmware_names())


def test_feed_from_durations_is_noticed():
    profile = load_profile("generic_ab_cradle")
    plan = plan_motion(TOOLPATHS["dome"], profile, SETTINGS)
    averaged = dataclasses.replace(plan.program, cruise=np.zeros(0))
    found = agreement(dataclasses.replace(plan, program=averaged), profile, SETTINGS)
    assert found.share_within(0.02) < 0.9
    assert found.time_ratio > 1.01


def test_another_firmware_is_noticed():
    """A plan for one firmware is not what another does with the same machine."""
    profile = load_profile("generic_ab_cradle")
    plan = plan_motion(TOOLPATHS["propeller"], on_firmware(profile, "klipper"), SETTINGS)
    found = agreement(plan, profile, SETTINGS)
    assert found.share_within(0.02) < 0.99


@pytest.mark.parametrize("machine", MACHINES)
def test_joints_bend_no_faster_than_they_accelerate(machine):
    """On runs of short moves, which are curves, the jumps at corners add up to an acceleration."""
    profile = load_profile(machine)
    plan = plan_motion(TOOLPATHS["dome"], profile, SETTINGS)
    program, law = plan.program, plan.law
    steps = np.diff(program.joints, axis=0, prepend=program.start[None])
    bead = np.flatnonzero((program.width[1:] > 0) & (program.width[:-1] > 0)) + 1
    alike = np.maximum(law.length[bead], law.length[bead - 1]) < 2 * np.minimum(law.length[bead], law.length[bead - 1])
    bead = bead[alike]
    rate = steps / law.length[:, None]
    jump = np.abs(rate[bead] * law.entry[bead, None] - rate[bead - 1] * law.leave[bead - 1, None])
    between = 0.5 * (law.length[bead] / law.entry[bead] + law.length[bead - 1] / law.leave[bead - 1])
    assert (jump / between[:, None] / profile.array("acceleration")).max() < 1.05
