"""What the host asks the printer about itself, against the software machine and against answers that are wrong."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.profile import load_profile
from trunnion_host.inspection import Inspection, Question
from trunnion_host.position import Position
from trunnion_host.protocol import Sender
from trunnion_host.states import State
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine

PROFILE = load_profile("generic_ab_cradle")
STEPS = {joint.letter: joint.steps_per_unit / joint.shown(1.0) for joint in PROFILE.joints}
REPORT = re.compile(r"([XYZABE]):(-?[\d.]+)")
START = ["M302 P1", "M83", "G28", "G92 E0", "G1 X1 Y1 Z5 A0 B0 F6000"]


def drive(machine: SoftwareMachine, sender: Sender, until: float = 600.0) -> bytes:
    """Both on one clock; returns what the host wrote."""
    now, wrote = 0.0, bytearray()
    out = sender.start(now)
    while not sender.over and now < until:
        wrote += out
        machine.receive(out)
        now += 0.02
        said = machine.run_until(now)
        out = sender.receive(said, now) + sender.tick(now)
    return bytes(wrote)


numbers = st.integers(-2000, 2000).map(lambda n: n / 100)
words = st.dictionaries(st.sampled_from("XYZABE"), numbers, min_size=1)


@st.composite
def command(draw: st.DrawFn) -> str:
    name = draw(
        st.sampled_from(["G0", "G1", "G1", "G1", "G92", "G90", "G91", "M82", "M83", "M204 P500", "G4 P1", "M107"])
    )
    if name not in ("G0", "G1", "G92"):
        return name
    return name + "".join(f" {letter}{value:g}" for letter, value in draw(words).items())


@settings(max_examples=60, deadline=None)
@given(st.lists(command(), max_size=25))
def test_the_position_followed_is_the_one_that_a_firmware_reports(program: list[str]) -> None:
    machine = SoftwareMachine(PROFILE, speed=None)
    position = Position()
    for line in ["M302 P1", "M211 S0", *program, "M114"]:
        machine.receive(line.encode() + b"\n")
        heard = machine.advance(100.0)
        position.follow(line)
    said = dict(REPORT.findall(heard.decode().partition("Count")[0]))
    for letter in position.known - set("CUVW"):
        assert float(said[letter]) == pytest.approx(position.values[letter], abs=0.0051)


@pytest.mark.parametrize("line", ["G28", "G20", "T1", "M600", "G29", "G53", "G43.4"])
def test_nothing_is_claimed_of_axes_after_a_command_that_moves_by_itself(line: str) -> None:
    position = Position()
    position.follow("G1 X1 Y2 Z3 A4 B5")
    assert position.known == set("XYZAB")
    position.follow(line)
    assert not position.known & set("XYZAB")


def test_a_good_print_is_inspected_without_a_word() -> None:
    machine = SoftwareMachine(PROFILE)
    sender = Sender([*START, *(f"G1 X{i % 40} A{i % 7} E0.03 F1200" for i in range(150))], steps=STEPS)
    wrote = drive(machine, sender)
    assert sender.state is State.DONE
    assert sender.warnings == ()
    assert wrote.count(b"M503") == 1
    assert wrote.count(b"M114") >= 3


def test_a_move_left_out_at_the_end_stops_the_print_from_being_called_done() -> None:
    program = [*START, *(f"G1 X{i} Y{i} E0.03 F6000" for i in range(20))]
    good = SoftwareMachine(PROFILE)
    drive(good, Sender(program))
    last = good.executed.index(program[-1]) + 1
    machine = SoftwareMachine(PROFILE, faults=[parse_fault(f"unreachable:line={last}")])
    sender = Sender(program)
    drive(machine, sender)
    assert sender.state is State.STOPPED
    assert "stands at X18.00 Y18.00 where the program has it at X19.00 Y19.00" in sender.reason


def test_filament_left_out_is_a_warning_that_says_how_much() -> None:
    program = [*START, *(f"G1 X{i % 40} Y{i % 30} E0.03 F3000" for i in range(200))]
    machine = SoftwareMachine(PROFILE, faults=[parse_fault("unreachable:line=60")])
    sender = Sender(program)
    drive(machine, sender)
    assert sender.state is State.DONE
    (warning,) = sender.warnings
    assert "0.03 mm less filament" in warning


def test_other_steps_are_a_warning_before_the_first_line_of_the_program() -> None:
    machine = SoftwareMachine(PROFILE)
    sender = Sender(START, steps={**STEPS, "Z": STEPS["Z"] * 2, "X": STEPS["X"] * 1.005})
    wrote = drive(machine, sender)
    assert wrote.index(b"M503") < wrote.index(b"M302")
    (warning,) = sender.warnings
    assert f"Z {STEPS['Z']:g} where the profile has Z {2 * STEPS['Z']:g}" in warning


def test_firmware_of_which_no_steps_are_known_is_not_asked() -> None:
    assert b"M503" not in drive(SoftwareMachine(PROFILE), Sender(START))


def asked(*commands: str) -> Inspection:
    """An inspection that followed commands and has an open question after them, as line 9."""
    inspection = Inspection()
    for line in commands:
        inspection.follow(line)
    assert inspection.next(at_end=True) is Question.WHERE
    inspection.ask(Question.WHERE, 9)
    return inspection


def test_one_damaged_answer_is_asked_about_again_and_forgiven() -> None:
    inspection = asked("G1 X10 Y5")
    inspection.hear_position("X:70.00 Y:5.00 Z:0.00 E:0.00 Count X:800")
    assert inspection.waiting
    inspection.taken(9)
    assert inspection.next(at_end=False) is Question.WHERE
    inspection.ask(Question.WHERE, 10)
    inspection.hear_position("X:10.00 Y:5.00 Z:0.00 E:0.00 Count X:800")
    inspection.taken(10)
    assert inspection.current
    assert not inspection.reason
    assert not inspection.warnings


def test_a_doubt_that_nobody_answers_ends() -> None:
    inspection = asked("G1 X10")
    inspection.hear_position("X:70.00 Y:5.00 Z:0.00 Count")
    for number in range(9, 20):
        inspection.taken(number)
        if inspection.next(at_end=False) is None:
            break
        inspection.ask(Question.WHERE, number + 1)
    assert not inspection.doubted
    assert not inspection.reason


def test_rounding_in_the_count_of_filament_does_not_add_up() -> None:
    inspection = Inspection()
    inspection.follow("M83")
    inspection.follow("G92 E0")
    for number in range(1, 200):
        inspection.follow("G1 X1 E0.1")
        inspection.ask(Question.WHERE, number)
        inspection.hear_position(f"X:1.00 E:{0.109 * number:.2f} Count")
        inspection.taken(number)
    assert not inspection.warnings


def test_a_position_that_came_by_itself_is_no_answer() -> None:
    inspection = Inspection()
    inspection.follow("G1 X10")
    inspection.hear_position("X:70.00 Y:5.00 Z:0.00 Count")
    assert not inspection.doubted
