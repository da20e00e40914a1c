"""For each firmware the tip moves as planned: the written file, replayed under that firmware's own rules."""

import dataclasses
import re

import numpy as np
import pytest

from trunnion.agreement import agreement, on_firmware
from trunnion_core.errors import ProfileError
from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_gcode.moves import make_moves
from trunnion_gcode.write import write_program
from trunnion_motion.plan import plan_motion
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.judge import context_of
from trunnion_sim.rules import firmware_names

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
MACHINES = ("generic_ab_cradle", "open5x_prusa_i3", "rep5x_ender3")
FIRMWARES = sorted(set(dialect_names()) & set(firmware_names()))
TIP_FIRMWARES = ("linuxcnc_tcp", "marlin_tcp")
PAIRS = [(firmware, machine) for firmware in FIRMWARES if firmware not in TIP_FIRMWARES for machine in MACHINES]
PAIRS += [(firmware, "open5x_voron0") for firmware in FIRMWARES]


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
@pytest.mark.parametrize(("firmware", "machine"), PAIRS)
def test_the_tip_moves_as_planned(firmware, machine, shape):
    profile = on_firmware(load_profile(machine), firmware)
    found = agreement(plan_motion(TOOLPATHS[shape], profile, SETTINGS), profile, SETTINGS)
    assert found.share_within(0.02) >= 0.99
    assert found.time_ratio == pytest.approx(1.0, abs=0.01)
    assert found.joint_speed.max() <= 1.005


def test_every_dialect_can_be_replayed():
    assert set(dialect_names()) == set(firmware_names())


@pytest.mark.parametrize("firmware", TIP_FIRMWARES)
@pytest.mark.parametrize(
    ("machine", "why"), [("generic_ab_cradle", "rotary joints are A and B"), ("generic_3axis", "none")]
)
def test_machines_without_tip_control_are_refused(firmware, machine, why):
    profile = on_firmware(load_profile(machine), firmware)
    flat = dataclasses.replace(TOOLPATHS["dome"], tool_axes=np.tile([0.0, 0.0, 1.0], (len(TOOLPATHS["dome"]), 1)))
    with pytest.raises(ProfileError, match=why):
        plan_motion(flat, profile, SETTINGS)


def moved_table(tip_x=3.0):
    """A table whose axes do not meet, a tip and an origin off zero: every offset counts."""
    voron = load_profile("open5x_voron0")
    points = {"B": np.array([4.0, 0.0, -7.0]), "C": np.array([1.5, -2.0, 0.0])}
    joints = tuple(dataclasses.replace(j, point=points[j.letter]) if j.rotary else j for j in voron.joints)
    tip, origin = np.array([tip_x, -1.0, 2.0]), np.array([2.0, 1.0, 0.5])
    return dataclasses.replace(voron, joints=joints, tip=tip, origin=origin)


def test_world_words_are_those_of_linuxcncs_kinematics(tmp_path):
    """trtfuncs.c with the pins that the header names turns the words back into the joints."""
    profile = on_firmware(moved_table(), "linuxcnc_tcp")
    program = plan_motion(TOOLPATHS["dome"], profile, SETTINGS).program
    file = tmp_path / "dome.ngc"
    write_program(program, profile, SETTINGS, title="dome", out=file)
    lines = file.read_text().splitlines()
    pin = {m[1]: float(m[2]) for m in (re.match(r"; setp xyzbc-trt-kins\.(\S+) (\S+)", line) for line in lines) if m}
    moves = make_moves(program, profile, find_dialect(profile.firmware))
    words = moves.joint_ticks / 10.0**4
    world = np.stack([words[:, profile.letters.index(letter)] for letter in "XYZ"], axis=1)
    b, c = (np.radians(words[:, profile.letters.index(letter)]) for letter in "BC")
    around = np.array([pin["x-rot-point"], pin["y-rot-point"], pin["z-rot-point"]])
    offset = np.array([pin["x-offset"], 0.0, pin["z-offset"]])
    p = world - around
    p = np.stack(
        [np.cos(c) * p[:, 0] - np.sin(c) * p[:, 1], np.sin(c) * p[:, 0] + np.cos(c) * p[:, 1], p[:, 2]], axis=1
    )
    p -= offset
    p = np.stack(
        [np.cos(b) * p[:, 0] + np.sin(b) * p[:, 2], p[:, 1], np.cos(b) * p[:, 2] - np.sin(b) * p[:, 0]], axis=1
    )
    reached = p + offset + around
    linear = [profile.letters.index(letter) for letter in "XYZ"]
    assert np.abs(np.degrees(b)).max() > 5
    assert np.ptp(np.degrees(c)) > 90
    np.testing.assert_allclose(reached, program.joints[moves.row][:, linear], atol=5e-4)
    assert pin["conventional-directions"] == 0


@pytest.mark.parametrize("firmware", TIP_FIRMWARES)
def test_the_judge_finds_the_joints_of_tip_words(firmware, tmp_path):
    profile = on_firmware(moved_table(), firmware)
    program = plan_motion(TOOLPATHS["dome"], profile, SETTINGS).program
    file = tmp_path / "dome.gcode"
    write_program(program, profile, SETTINGS, title="dome", out=file)
    context = context_of(file, profile)
    rows = make_moves(program, profile, find_dialect(firmware)).row
    executed = context.motion.joints[~context.homing][: len(rows)]
    np.testing.assert_allclose(executed, program.joints[rows], atol=5e-4)
    np.testing.assert_allclose(context.points[~context.homing][: len(rows)], program.tip[rows + 1], atol=2e-4)


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


@pytest.mark.parametrize("machine", ["generic_ab_cradle", "rep5x_ender3"])
def test_the_software_machine_takes_the_planned_time(machine, tmp_path):
    """A third road: Marlin's planner in whole steps, fed line by line over its wire."""
    profile = load_profile(machine)
    program = plan_motion(TOOLPATHS["propeller"], profile, SETTINGS).program
    file = tmp_path / "propeller.gcode"
    write_program(program, profile, SETTINGS, title="propeller", out=file)
    lines = [line.partition(";")[0].strip() for line in file.read_text().splitlines()]
    firmware = SoftwareMachine(profile, speed=None)
    firmware.take()

    def send(commands):
        for command in commands:
            firmware.receive(command.encode() + b"\n")
            while b"ok" not in firmware.advance(0.0):
                pass

    send(["M302 P1", "G21", "G90", "M83", "G28", "M400"])
    began = firmware.now
    send([line for line in lines if line.startswith(("G0 ", "G1 "))] + ["M400"])
    assert firmware.now - began == pytest.approx(program.duration.sum(), rel=0.03)


@pytest.mark.parametrize("firmware", TIP_FIRMWARES)
def test_turns_with_the_tip_held_take_their_time(firmware):
    """The words of X, Y and Z stand while the joints behind them move: the planner sees the words."""
    profile = on_firmware(load_profile("open5x_voron0"), firmware)
    flat = TOOLPATHS["dome"]
    few = dataclasses.replace(
        flat, **{field.name: getattr(flat, field.name)[:40] for field in dataclasses.fields(flat)}
    )
    found = agreement(plan_motion(few, profile, SETTINGS), profile, SETTINGS)
    assert found.time_ratio == pytest.approx(1.0, abs=2e-3)
