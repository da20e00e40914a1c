"""Short dialogues with the software machine, byte for byte as upstream Marlin 2.1 holds them."""

from functools import reduce
from operator import xor
from typing import Any

import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.firmware.machine import SoftwareMachine


@pytest.fixture(scope="module")
def profile() -> MachineProfile:
    return load_profile("generic_ab_cradle")


def numbered(n: int, text: str) -> str:
    head = f"N{n} {text}"
    return f"{head}*{reduce(xor, head.encode(), 0)}\n"


class Wire:
    """A machine whose banner has been read."""

    def __init__(self, profile: MachineProfile, **options: Any) -> None:
        self.machine = SoftwareMachine(profile, **options)
        self.banner = self.machine.take().decode()

    def ask(self, text: str, seconds: float = 0.0) -> str:
        self.machine.receive(text.encode("latin-1"))
        return self.machine.run_until(self.machine.now + seconds).decode("latin-1")


@pytest.fixture
def wire(profile: MachineProfile) -> Wire:
    return Wire(profile)


def test_banner_begins_with_start_and_names_marlin(wire: Wire) -> None:
    lines = wire.banner.splitlines()
    assert lines[0] == "start"
    assert "PowerUp" in lines
    assert any(line.startswith("Marlin 2.1") for line in lines)
    assert any(line.startswith("echo: Last Updated: ") for line in lines)
    assert any(line.startswith("echo: Compiled: ") for line in lines)
    assert any(line.startswith("echo: Free Memory: ") for line in lines)


@pytest.mark.parametrize(
    ("sent", "answer"),
    [
        ("N0 M110 N0*125\n", "ok\n"),
        ("N-1 M110 N-1*125\n", "ok\n"),
        ("M110 N200\nM110\n", "ok\nLine: 200\nok\n"),
        (numbered(40, "M110"), "Line: 40\nok\n"),
        ("g92\n", 'echo:Unknown command: "g92"\nok\n'),
        ("   \n", 'echo:Unknown command: ""\nok\n'),
        ("\n; a comment\n\r\n", ""),
        ("M400\r\n", "ok\n"),
        ("G4*12\n", "//action:notification Sleep...\nok\n"),
        ("M118 E1 hello\n", "echo:hello\nok\n"),
        ("M118 A1 action:cancel\n", "//action:cancel\nok\n"),
        ("M117 at work\n", "//action:notification at work\nok\n"),
        ("M220\n", "FR:100%\nok\n"),
        ("M221 S90\nM221\n", "ok\necho:E0 Flow: 90%\nok\n"),
        ("G92 X10 Y5 Z1 A30 B-45\n", "X:10.00 Y:5.00 Z:1.00 A:30.00 B:-45.00 E:0.00 Count X:0 Y:0 Z:0 A:0 B:0\nok\n"),
        ("M73 P10 R5\nM107\nM17\n", "ok\nok\nok\n"),
    ],
)
def test_short_answers(wire: Wire, sent: str, answer: str) -> None:
    assert wire.ask(sent) == answer


def test_temperature_report_is_its_own_ok(wire: Wire) -> None:
    answer = wire.ask("M105\n")
    assert answer.count("\n") == 1
    assert answer.startswith("ok T:2")
    assert answer.endswith("@:0 B@:0\n")
    assert " /0.00 B:2" in answer


def test_advanced_ok_names_line_and_room(profile: MachineProfile) -> None:
    wire = Wire(profile, advanced_ok=True)
    assert wire.ask(numbered(1, "M107")) == "ok N1 P15 B3\n"


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        ("N2 G1 X1*98\n", "checksum mismatch"),
        ("N2 G1 X1 ; a comment eats the checksum*17\n", "No Checksum with line number"),
        (numbered(5, "G1 X1"), "Line Number is not Last Line Number+1"),
        (numbered(-3, "G1 X1"), "Line Number is not Last Line Number+1"),
    ],
)
def test_a_bad_line_is_asked_for_again(wire: Wire, bad: str, reason: str) -> None:
    assert wire.ask(numbered(1, "M107")) == "ok\n"
    assert wire.ask(bad) == f"Error:{reason}, Last Line: 1\nResend: 2\nok\n"
    assert wire.ask(numbered(2, "M107")) == "ok\n"
    assert wire.machine.executed == ["M107", "M107"]


def test_lines_numbered_last_and_last_but_one_get_no_answer(wire: Wire) -> None:
    for n in (1, 2, 3):
        wire.ask(numbered(n, f"M106 S{n}"))
    assert wire.ask(numbered(3, "M106 S3")) == ""
    assert wire.ask(numbered(2, "M106 S2")) == ""
    assert wire.ask(numbered(1, "M106 S1")).startswith("Error:Line Number")
    assert wire.machine.executed == ["M106 S1", "M106 S2", "M106 S3"]


def test_an_error_in_a_burst_is_answered_first_and_flushes_what_follows(wire: Wire) -> None:
    burst = numbered(1, "M107") + "N2 M107*1\n" + numbered(3, "M107") + numbered(4, "M107")
    assert wire.ask(burst) == "Error:checksum mismatch, Last Line: 1\nResend: 2\nok\nok\n"
    assert wire.machine.executed == ["M107"]


def test_a_line_past_95_characters_is_cut_and_asked_for(wire: Wire) -> None:
    text = "M118 " + "x" * 88
    assert len(numbered(1, text)) > 96
    assert wire.ask(numbered(1, text)) == "Error:No Checksum with line number, Last Line: 0\nResend: 1\nok\n"


def test_bytes_beyond_queue_and_ring_are_lost(wire: Wire) -> None:
    lines = [numbered(n, f"M106 S{n:03}") for n in range(1, 40)]
    said = wire.ask("G4 P100\n" + "".join(lines), 0.2)
    ring = 128 // len(lines[0])
    assert wire.machine.executed == ["G4 P100"] + [f"M106 S{n:03}" for n in range(1, 4 + ring)]
    assert said.count("ok\n") == 4 + ring
    assert wire.machine.ring.lost > 0
    assert wire.ask(lines[20]).startswith("Error:")


def test_moves_are_acknowledged_until_the_planner_is_full(wire: Wire) -> None:
    assert wire.ask("G91\n") == "ok\n"
    oks = sum(wire.ask("G1 X1 F60\n").count("ok") for _ in range(20))
    assert oks == 15
    assert wire.ask("", 0.9).count("ok") == 0
    assert wire.ask("", 0.2).count("ok") == 1


def test_commanded_end_of_queue_and_motors_now_are_told_apart(wire: Wire) -> None:
    wire.ask("G1 X10 A20 F600\n")
    assert wire.ask("M114\n").startswith("X:10.00 Y:0.00 Z:0.00 A:20.00 B:0.00 E:0.00 Count X:0 Y:0")
    wire.ask("", 0.1 + 0.5)
    half = wire.ask("M114\n")
    assert half.startswith("X:10.00")
    assert 350 < int(half.split("Count X:")[1].split()[0]) < 450
    wire.ask("M400\n", 2.0)
    assert "Count X:800 Y:0 Z:0 A:889 B:0" in wire.ask("M114\n")


def test_dwell_says_busy_every_two_seconds(wire: Wire) -> None:
    assert wire.ask("G4 P5000\n", 1.9) == "//action:notification Sleep...\n"
    assert wire.ask("", 0.2) == "echo:busy: processing\n"
    assert wire.ask("", 2.0) == "echo:busy: processing\n"
    assert wire.ask("", 1.0) == "ok\n"
    wire.ask("M113 S0\n")
    assert wire.ask("G4 S3\n", 4.0) == "//action:notification Sleep...\nok\n"


@pytest.mark.parametrize("way_out", ["M108\n", "M876 S0\n"])
def test_stop_command_prompts_until_a_person_answers(wire: Wire, way_out: str) -> None:
    prompt = (
        "//action:prompt_end\n//action:prompt_begin M0 Stop\n//action:prompt_button Continue\n//action:prompt_show\n"
    )
    assert wire.ask("M0\n", 2.5) == prompt + "echo:busy: paused for user\n"
    said = wire.ask(way_out)
    assert said.endswith("ok\nok\n")
    assert ("M876 Responding PROMPT_" in said) == way_out.startswith("M876")


def test_stop_command_repeats_its_text_and_ends_by_itself_when_told_so(wire: Wire) -> None:
    said = wire.ask("M0 P1500 Clip the part\n", 1.4)
    assert said.startswith("echo:Clip the part\n//action:prompt_end\n//action:prompt_begin M0 Stop\n")
    assert wire.ask("", 0.2) == "ok\n"


def test_emergency_stop_does_not_queue(wire: Wire) -> None:
    wire.ask("G4 S60\nG4 S60\nM107\nM107\nM107\n")
    assert wire.ask("M112\n") == "echo:M112 Shutdown\nError:Printer halted. kill() called!\n//action:poweroff\n"
    assert wire.ask("M105\n", 10.0) == ""
    assert wire.machine.halted


def test_emergency_commands_are_found_behind_a_line_number_only(wire: Wire) -> None:
    assert "Shutdown" not in wire.ask("M118 never say M112\n")
    assert "Shutdown" in wire.ask(numbered(1, "M112"))


def test_quick_stop_leaves_the_position_where_it_stopped(wire: Wire) -> None:
    wire.ask("G1 X100 F600\nG1 X0\n", 1.1)
    assert wire.ask("M410\n", 1.1) == "ok\n"
    stopped = wire.ask("M114\n")
    x = float(stopped.split()[0][2:])
    assert 8 < x < 11
    assert f"Count X:{round(x * 80)}" in stopped
    assert wire.ask("", 5.0) == ""
    assert wire.ask("M114\n") == stopped


def test_cold_filament_does_not_move_but_counts_as_moved(wire: Wire) -> None:
    assert wire.ask("G1 E5 F300\n") == "echo: cold extrusion prevented\nok\n"
    assert " E:5.00 " in wire.ask("M114\n")
    wire.ask("M302 P1\nG1 E6\n", 1.0)
    assert wire.machine.trace().volume.sum() == pytest.approx(wire.machine.profile.filament_area)


def test_soft_limits_hold_once_homed(wire: Wire) -> None:
    wire.ask("G1 X500 A500 F100000\nM400\n", 60.0)
    assert "X:500.00" in wire.ask("M114\n")
    homed = wire.ask("G28 X A\n", 60.0)
    assert homed.endswith("ok\n")
    assert "X:0.00" in homed
    wire.ask("G1 X500 A500 B500 F100000\nM400\n", 60.0)
    assert wire.ask("M114\n").startswith("X:160.00 Y:0.00 Z:0.00 A:60.00 B:500.00")
    wire.ask("M211 S0\nG1 X170\n", 5.0)
    assert wire.ask("M114\n").startswith("X:170.00")


def test_offsets_of_g92_move_no_joint(wire: Wire) -> None:
    wire.ask("G28\n", 60.0)
    wire.ask("G92 X50\nG1 X60 F3000\nM400\n", 5.0)
    assert "X:60.00" in wire.ask("M114\n")
    assert wire.machine.trace().joints[-1, 0] == pytest.approx(10.0)


def test_relative_modes(wire: Wire) -> None:
    wire.ask("M302 P1\nM83\nG1 E2\nG1 E2 X3\nG90\nG1 E3\nG91\nG1 X-1 E1\n", 30.0)
    assert "X:2.00" in wire.ask("M114\n")
    assert " E:4.00 " in wire.ask("M114\n")


def test_automatic_reports_come_between_anything(wire: Wire) -> None:
    wire.ask("M155 S2\n")
    said = wire.ask("M154 S3\n")
    assert said.startswith("X:0.00")
    said = wire.ask("", 6.5)
    assert said.count(" T:") == 3
    assert said.count("Count X:") == 2
    wire.ask("M155 S0\nM154 S0\n")
    assert wire.ask("", 10.0) == ""


def test_information_lists_what_the_machine_can(wire: Wire) -> None:
    lines = wire.ask("M115\n").splitlines()
    assert lines[0].startswith("FIRMWARE_NAME:Marlin 2.1")
    assert "EXTRUDER_COUNT:1" in lines[0]
    assert "Cap:EMERGENCY_PARSER:1" in lines
    assert "Cap:AUTOREPORT_TEMP:1" in lines
    assert lines[-1] == "ok"


def test_stored_settings_are_those_of_the_profile(wire: Wire) -> None:
    said = wire.ask("M503\n")
    assert "echo:  M92 X80.00 Y80.00 Z400.00 A44.44 B44.44 E400.00\n" in said
    assert "echo:  M203 X200.00 Y200.00 Z40.00 A180.00 B180.00 E60.00\n" in said
    wire.ask("M203 A50\n")
    assert " A50.00 " in wire.ask("M503\n")


def test_realtime_position(wire: Wire) -> None:
    assert wire.ask("S000\n").startswith("X:0.00")


@pytest.mark.parametrize("speed", [0.1, 1.0, 7.0, None])
def test_order_does_not_depend_on_the_speed_of_time(profile: MachineProfile, speed: float | None) -> None:
    """The same lines, one in flight: the same answers in the same order, whatever the speed."""

    def talk(speed: float | None) -> tuple[str, list[str], list[float]]:
        machine = SoftwareMachine(profile, speed=speed)
        said = ""
        for n in range(60):
            machine.receive(numbered(n + 1, f"G1 X{n % 7} A{n % 5} F3000").encode())
            while not said.endswith(f"ok\n{n}\n"):
                said += machine.advance(0.01).decode()
                if said.endswith("ok\n"):
                    said += f"{n}\n"
        machine.receive(b"G4 P2500\n")
        machine.finish()
        return said, machine.executed, machine.trace().joints.tolist()

    assert talk(speed) == talk(1.0)
