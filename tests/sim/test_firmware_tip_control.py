"""G43.4, arcs and M410 on the software machine: the tip goes where the words say at the speed of F, or not at all."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.chain import forward
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.tip_control import TipControl, tip_control_of

CRADLE = load_profile("generic_ab_cradle")


def head_over_table() -> MachineProfile:
    """The cradle's joints rearranged: B tilts the head 60 mm above the tip, the table turns about a vertical A."""
    *linear, a, b = CRADLE.joints
    head = dataclasses.replace(b, side="tool", point=np.array([0.0, 0.0, 60.0]))
    table = dataclasses.replace(a, axis=np.array([0.0, 0.0, 1.0]), point=np.array([3.0, -2.0, 0.0]))
    return dataclasses.replace(CRADLE, joints=(*linear, head, table), origin=np.array([1.0, 2.0, 3.0]))


MACHINES = {
    "cradle": CRADLE,
    "voron": load_profile("open5x_voron0"),
    "prusa": load_profile("open5x_prusa_i3"),
    "head-table": head_over_table(),
}


class Talk:
    """A machine that takes no time between lines."""

    def __init__(self, profile: MachineProfile) -> None:
        self.machine = SoftwareMachine(profile, speed=None)
        self.machine.take()
        self.ask("M302 P1")

    def ask(self, *lines: str) -> str:
        said = ""
        for line in lines:
            self.machine.receive(line.encode() + b"\n")
            answer = b""
            while b"ok\n" not in answer:
                answer += self.machine.advance(0.0)
            said += answer.decode()
        return said

    def position(self) -> dict[str, float]:
        words = self.ask("M114").split(" Count")[0].split()
        return {word[0]: float(word[2:]) for word in words}


def control(profile: MachineProfile) -> TipControl:
    found = tip_control_of(profile)
    assert found is not None
    return found


@pytest.mark.parametrize("name", MACHINES)
@given(values=st.lists(st.floats(-50.0, 50.0), min_size=5, max_size=5))
@settings(max_examples=40, deadline=None)
def test_tip_words_and_joints_undo_each_other_and_agree_with_the_chain(name: str, values: list[float]) -> None:
    profile = MACHINES[name]
    tip = control(profile)
    joints = np.array(values)
    native = tip.native(joints)
    points, _ = forward(profile, (joints / profile.to_shown)[None])
    upright = native / profile.to_shown
    upright[list(profile.rotary)] = 0.0
    as_if, _ = forward(profile, upright[None])
    np.testing.assert_allclose(as_if, points, atol=1e-9)
    np.testing.assert_allclose(tip.joints(native)[0], joints, atol=1e-9)


@pytest.mark.parametrize("name", ["cradle", "head-table"])
def test_the_tip_follows_a_straight_line_at_f_while_the_part_turns(name: str) -> None:
    profile = MACHINES[name]
    talk = Talk(profile)
    talk.ask("G43.4", "G1 X20 Y-10 Z30 F3000", "M400")
    machine = talk.machine
    begun, blocks = machine.now, len(machine.trace())
    talk.ask("G1 X-30 Y25 Z40 A25 B-20 F1800", "M400")
    trace = machine.trace()
    points = trace.points[blocks:]
    shift = profile.tip - profile.origin
    begin, end = np.array([20.0, -10.0, 30.0]) + shift, np.array([-30.0, 25.0, 40.0]) + shift
    length = float(np.linalg.norm(end - begin))
    along = (points - begin) @ (end - begin) / length
    off = np.linalg.norm(points - begin - along[:, None] * (end - begin) / length, axis=1)
    assert off.max() < 0.05
    np.testing.assert_allclose(points[-1], end, atol=0.05)
    assert len(points) == pytest.approx(200 * length / 30.0, rel=0.02)
    assert machine.now - begun == pytest.approx(length / 30.0 + 0.1, abs=0.1)
    speed = np.diff(along) / np.diff(trace.time[blocks:])
    assert np.median(speed) == pytest.approx(30.0, rel=0.02)
    shown = talk.position()
    assert (shown["X"], shown["Y"], shown["Z"], shown["A"], shown["B"]) == (-30.0, 25.0, 40.0, 25.0, -20.0)


def test_the_tip_stays_where_it_is_while_only_rotaries_turn_and_f_is_in_degrees() -> None:
    talk = Talk(CRADLE)
    talk.ask("G43.4", "G1 X30 Y20 Z10 F6000", "M400")
    machine = talk.machine
    begun, blocks = machine.now, len(machine.trace())
    talk.ask("G1 A30 B40 F600", "M400")
    trace = machine.trace()
    step = 0.03
    assert np.abs(trace.points[blocks:] - [30.0, 20.0, 10.0]).max() < step
    assert machine.now - begun == pytest.approx(50.0 / 10.0, abs=0.25)


def test_a_move_at_fixed_angles_is_one_block() -> None:
    talk = Talk(CRADLE)
    talk.ask("G43.4", "G1 A30 F3000", "M400")
    blocks = len(talk.machine.trace())
    talk.ask("G1 X10 Y5 Z8 E1 F1200", "M400")
    trace = talk.machine.trace()
    assert len(trace) == blocks + 1
    np.testing.assert_allclose(trace.points[-1], [10.0, 5.0, 8.0], atol=0.03)


@pytest.mark.parametrize("words", ["X161 A10", "Y-160.1 B3"])
def test_a_turn_whose_end_is_out_of_reach_is_dropped_with_an_ok(words: str) -> None:
    """DerAndere1/Marlin `motion.cpp`: `position_is_reachable` of a move that turns; before homing nothing limits it."""
    talk = Talk(CRADLE)
    talk.ask("G43.4", "G1 X10 Y10 Z10 A5 F3000", "M400")
    before, blocks = talk.ask("M114"), len(talk.machine.trace())
    assert talk.ask(f"G1 {words} E3") == "ok\n"
    talk.ask("M400")
    assert talk.ask("M114") == before
    assert len(talk.machine.trace()) == blocks
    talk.ask("G1 X11", "M400")
    assert talk.position()["X"] == 11.0


def test_after_homing_words_are_cut_to_the_limits_of_their_letters_and_joints_to_none() -> None:
    """`apply_motion_limits` sees the words; the joints behind them are not looked at and leave their travel."""
    talk = Talk(CRADLE)
    talk.ask("G28", "G43.4", "G1 X10 Y10 Z10 F6000", "G1 A70 X500", "M400")
    shown = talk.position()
    assert (shown["X"], shown["A"]) == (160.0, 60.0)
    talk.ask("G1 X150 Y150 Z150 A60 B60", "M400")
    joints = talk.machine.trace().joints[-1] * CRADLE.to_shown
    over = np.maximum(joints - [160, 160, 220, 60, 60], [-160, -160, -80, -60, -60] - joints)
    assert over.max() > 10.0


def test_switching_with_the_table_level_changes_nothing() -> None:
    talk = Talk(CRADLE)
    talk.ask("G1 X10 Y20 Z30 F6000", "M400")
    before = talk.ask("M114")
    assert talk.ask("G43.4") == "ok\n"
    assert talk.ask("M114") == before
    talk.ask("G49")
    assert talk.ask("M114") == before


def test_switching_with_the_table_tilted_keeps_the_words_and_loses_the_joints() -> None:
    """`GcodeSuite::G43` ends in `sync_plan_position`: the counts become what the words mean now; nothing moves."""
    talk = Talk(CRADLE)
    talk.ask("G1 X10 Y20 Z30 A30 F6000", "M400")
    words, blocks = talk.position(), len(talk.machine.trace())
    stood = talk.machine.trace().joints[-1]
    talk.ask("G43.4")
    assert talk.position() == words
    believed = control(CRADLE).joints(np.array([10.0, 20.0, 30.0, 30.0, 0.0]))[0]
    counts = talk.ask("M114").split("Count ")[1].split()
    assert int(counts[1][2:]) == round(believed[1] * 80)
    assert len(talk.machine.trace()) == blocks
    talk.ask("G1 A0", "M400")
    moved = talk.machine.trace().joints[-1] - stood
    np.testing.assert_allclose((moved * CRADLE.to_shown)[1:4], [20 - believed[1], 30 - believed[2], -30], atol=0.03)


def test_homing_with_tip_control_on_ends_at_the_endstops() -> None:
    talk = Talk(CRADLE)
    talk.ask("G43.4", "G1 X10 Y20 Z30 A30 B10 F6000", "G28", "G49")
    shown = talk.position()
    assert [shown[joint.letter] for joint in CRADLE.joints] == [joint.shown(joint.home) for joint in CRADLE.joints]


@pytest.mark.parametrize("name", ["rep5x_ender3", "generic_3axis"])
@pytest.mark.parametrize("code", ["G43.4", "G49", "M665"])
def test_machines_the_fork_does_not_know_have_no_tip_control(name: str, code: str) -> None:
    assert Talk(load_profile(name)).ask(code) == f'echo:Unknown command: "{code}"\nok\n'


def test_the_reported_geometry_is_the_profile_s_and_m665_moves_it() -> None:
    talk = Talk(MACHINES["voron"])
    assert talk.ask("M665") == "  M665 S200.00 X0.00 Y0.00 Z0.00 I0.00 J0.00 K-12.00\nok\n"
    assert "  M665 S200.00 X0.00" in talk.ask("M503")
    talk.ask("G43.4", "G1 X5 Y5 Z20 B20 F3000", "M400")
    right = talk.machine.trace().points[-1]
    talk.ask("G1 B0", "M665 K-13.5 S100", "G1 B20", "G1 X5 Y5 Z20", "M400")
    wrong = talk.machine.trace().points[-1]
    moved = 2 * 1.5 * math.sin(math.radians(10))
    assert np.linalg.norm(wrong - right) == pytest.approx(moved, abs=0.05)
    assert talk.ask("M665").startswith("  M665 S100.00")


def test_the_head_s_arm_is_what_m665_z_says() -> None:
    talk = Talk(MACHINES["head-table"])
    assert talk.ask("M665") == "  M665 S200.00 Z60.00\nok\n"
    talk.ask("M665 Z61", "G43.4", "G1 B30 F1200", "M400")
    off = talk.machine.trace().points[-1] - talk.machine.trace().points[0]
    assert np.linalg.norm(off) == pytest.approx(2 * math.sin(math.radians(15)), abs=0.05)


@pytest.mark.parametrize(
    ("lines", "length", "end"),
    [
        (["G1 X10 Y0 F3000", "G3 X-10 Y0 I-10 E1"], math.pi * 10, (-10.0, 0.0)),
        (["G1 X10 Y0 F3000", "G2 X0 Y10 I-10 E1"], 1.5 * math.pi * 10, (0.0, 10.0)),
        (["G1 X10 Y0 F3000", "G3 X10 Y0 I-10 E1"], 2 * math.pi * 10, (10.0, 0.0)),
        (["G1 X10 Y0 F3000", "G3 X10 Y0 I-10 P1 E1"], 4 * math.pi * 10, (10.0, 0.0)),
        (["G1 X10 Y0 F3000", "G3 X0 Y10 R10 E1"], 0.5 * math.pi * 10, (0.0, 10.0)),
        (["G1 X10 Y0 F3000", "G3 X0 Y10 R-10 E1"], 1.5 * math.pi * 10, (0.0, 10.0)),
        (["G91", "G1 X10 F3000", "G2 X-10 Y-10 I-10 E1"], 0.5 * math.pi * 10, (0.0, -10.0)),
    ],
)
def test_arcs_become_chords_of_their_circle(lines: list[str], length: float, end: tuple[float, float]) -> None:
    talk = Talk(CRADLE)
    talk.ask("M83", lines[0], *lines[1:-1], "M400")
    start, first = talk.machine.trace().points[-1].copy(), len(talk.machine.trace())
    said = talk.ask(lines[-1], "M400")
    assert said.replace("echo:busy: processing\n", "") == "ok\nok\n"
    trace = talk.machine.trace()
    points = np.vstack([start, trace.points[first:]])
    way = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    assert way.sum() == pytest.approx(length, rel=2e-3)
    assert way.max() < 1.001
    np.testing.assert_allclose(points[-1, :2], end, atol=0.01)
    assert trace.volume[first:].sum() == pytest.approx(CRADLE.filament_area, rel=1e-2)


def test_an_arc_without_a_centre_is_an_error_and_an_ok() -> None:
    assert Talk(CRADLE).ask("G2 X10 Y10") == "Error:G2/G3 bad parameters\nok\n"


def test_after_a_quick_stop_nothing_runs_for_a_second() -> None:
    machine = SoftwareMachine(CRADLE)
    machine.take()
    machine.receive(b"G1 X100 F600\nG1 X0\n")
    machine.run_until(2.0)
    machine.receive(b"M410\nG1 Y5 F6000\n")
    assert machine.run_until(2.9) == b""
    stood = machine.planner.steps_now(machine.now)[1]
    assert machine.run_until(3.5) == b"ok\nok\n"
    assert stood == 0
    assert machine.planner.steps_now(machine.now)[1] > 0


def test_slow_tip_moves_run_too_fast_since_pieces_below_six_steps_are_left_to_the_next() -> None:
    """MarlinFirmware/Marlin issues 18107 and 3691 report it of deltas: the piece's length is what F is read over."""
    talk = Talk(CRADLE)
    talk.ask("G43.4", "G1 X20 F3000", "M400")
    begun = talk.machine.now
    talk.ask("G1 X-20 A10 F600", "M400")
    assert talk.machine.now - begun == pytest.approx(40 / 10 / 2 + 0.1, abs=0.1)
    begun = talk.machine.now
    talk.ask("M665 S20", "G1 X20 A0 F600", "M400")
    assert talk.machine.now - begun == pytest.approx(40 / 10 + 0.1, abs=0.1)
