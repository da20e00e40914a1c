"""The judge on programs with G43.4: the tip follows its line whatever turns, at F, as on the software machine."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.context import Context
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.judge import context_of


@pytest.fixture(scope="module")
def profile() -> MachineProfile:
    return dataclasses.replace(load_profile("open5x_voron0"), firmware="marlin_tcp")


PROGRAM = ["M302 P1", "M83", "G1 X20 Y10 Z30 F3000", "G43.4", "G1 X-20 Y15 Z12 B30 C200 E2 F1800", "M400"]
PROGRAM += ["G1 B-20 C20 F3600", "G1 X0 Y0 Z20 B0 C0 F2400", "G49", "G1 X10 F3000", "M400"]


def judged(folder: Path, profile: MachineProfile, program: list[str]) -> Context:
    file = folder / "tip.gcode"
    file.write_text("\n".join(program) + "\n")
    return context_of(file, profile)


def test_a_long_turn_keeps_the_tip_on_its_line(profile: MachineProfile, tmp_path: Path) -> None:
    context = judged(tmp_path, profile, PROGRAM)
    (stretch,) = context.stretches()
    rows, points = stretch.rows, stretch.points
    line = context.motion.line[rows]
    begin, end = np.array([20.0, 10.0, 30.0]), np.array([-20.0, 15.0, 12.0])
    long = points[line == 5]
    assert len(long) > 20
    along = np.clip((long - begin) @ (end - begin) / ((end - begin) @ (end - begin)), 0, 1)
    assert np.linalg.norm(long - begin - along[:, None] * (end - begin), axis=1).max() < 0.05
    np.testing.assert_allclose(long[-1], end, atol=1e-6)
    turned = points[line == 7]
    assert np.abs(turned - end).max() < 0.05
    assert context.motion.filament.sum() == pytest.approx(2.0)


def test_machine_and_judge_agree_on_time_and_end(profile: MachineProfile, tmp_path: Path) -> None:
    context = judged(tmp_path, profile, PROGRAM)
    machine = SoftwareMachine(profile, speed=None)
    machine.take()
    for line in PROGRAM:
        machine.receive(line.encode() + b"\n")
        while b"ok" not in machine.advance(0.0):
            pass
    trace = machine.trace()
    np.testing.assert_allclose(context.points[-1], trace.points[-1], atol=0.05)
    assert machine.now == pytest.approx(context.replay.time, rel=0.05)


def test_commands_keep_their_place_among_cut_rows(profile: MachineProfile, tmp_path: Path) -> None:
    context = judged(tmp_path, profile, [*PROGRAM[:5], "M204 P500", *PROGRAM[5:]])
    (command,) = [command for command in context.motion.commands if command.name == "M204"]
    assert context.motion.line[command.row - 1] == 5
    assert context.motion.line[command.row] == 8
    assert np.isnan(context.motion.dwell).sum() == 1
    assert (context.motion.bytes > 0).sum() == len(set(context.motion.line.tolist()))


def test_a_row_within_the_chord_tolerance_stays_whole(profile: MachineProfile, tmp_path: Path) -> None:
    program = ["M302 P1", "G43.4", "G1 X20 Z10 F3000", "G1 X20.4 B0.5 C1 E1", "G1 X20.8 B1 C2 E2"]
    assert len(judged(tmp_path, profile, program).motion) == 3


def test_what_the_firmware_would_drop_is_out_of_its_limits(profile: MachineProfile, tmp_path: Path) -> None:
    from trunnion_sim.checks.joint_limits import check

    context = judged(tmp_path, profile, ["G43.4", "G1 X80 Y0 Z60 B90 F3000"])
    assert {finding.code for finding in check(context)} == {"joint-limit"}


def machine_after(profile: MachineProfile, program: list[str]) -> SoftwareMachine:
    machine = SoftwareMachine(profile, speed=None)
    machine.take()
    for line in program:
        machine.receive(line.encode() + b"\n")
        while b"ok" not in machine.advance(0.0):
            pass
    machine.finish()
    return machine


def coarse(profile: MachineProfile) -> MachineProfile:
    """The machine with 80 steps per mm, and so few per degree that pieces of 5 ms have none to speak of."""
    joints = tuple(
        dataclasses.replace(joint, steps_per_unit=joint.shown(1.0) * (200.0 if joint.rotary else 80.0))
        for joint in profile.joints
    )
    return dataclasses.replace(profile, joints=joints)


@pytest.mark.parametrize(("feed", "doubled"), [(600, True), (3600, False)])
def test_slow_turns_run_at_the_multiple_that_short_pieces_make(
    profile: MachineProfile, tmp_path: Path, feed: int, doubled: bool
) -> None:
    """Pieces of 5 ms below six steps are left to the next, which reads F over its own length alone.

    The machine is a little slower, since the first pieces are stretched while the queue fills (SLOWDOWN).
    """
    program = ["M302 P1", "M83", "G1 X20 Z10 F3000", "G43.4", "M400", f"G1 X-20 B8 F{feed}", "M400"]
    context = judged(tmp_path, coarse(profile), program)
    machine = machine_after(coarse(profile), program)
    assert 0.0 < machine.now - context.replay.time < 0.08
    asked = 40.0 / feed * 60
    rows = context.motion.line == 6
    took = context.replay.end[rows].max() - context.replay.begin[rows].min()
    assert took == pytest.approx(asked / 2 if doubled else asked, rel=0.05)


def test_m665_in_the_program_makes_judge_and_machine_move_other_joints(profile: MachineProfile, tmp_path: Path) -> None:
    program = ["M302 P1", "G43.4", "G1 X20 Y10 Z30 B10 F3000", "M665 K-14 S100", "G1 X15 B30 C40", "M400"]
    context = judged(tmp_path, profile, program)
    machine = machine_after(profile, program)
    np.testing.assert_allclose(context.points[-1], machine.trace().points[-1], atol=0.03)
    plain = judged(tmp_path, profile, [line for line in program if not line.startswith("M665")])
    assert np.linalg.norm(context.points[-1] - plain.points[-1]) > 0.5
    assert machine.now == pytest.approx(context.replay.time, rel=0.03)
