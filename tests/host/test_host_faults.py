"""Every fault of the wire and the firmware, injected by the software machine; the host is driven in its own time."""

import pytest

from trunnion_core.profile import load_profile
from trunnion_host.protocol import HEATERS_OFF, Sender
from trunnion_host.states import State
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine

PROFILE = load_profile("generic_ab_cradle")
PROGRAM = ["G28", *(f"G1 X{i % 50} Y{i % 7}.25 A{i % 9} B-{i % 11}.5 F6000" for i in range(400)), "M107"]
RECOVERY = 3.0
"""s of protocol time in which any single fault is over."""


def stream(*faults: str, program: list[str] = PROGRAM, limit: float = 300.0) -> tuple[SoftwareMachine, Sender, float]:
    """Stream to a machine that takes no time of its own; what time passes is waiting. Returns with seconds waited."""
    machine = SoftwareMachine(PROFILE, speed=None, faults=[parse_fault(fault) for fault in faults], seed=3)
    sender = Sender(program)
    now = 0.0
    out = sender.start(now)
    while not sender.over and now < limit:
        machine.receive(out)
        said = machine.advance(0.0)
        if not said:
            now += sender.patience / 2
            said = machine.advance(sender.patience / 2)
        out = sender.receive(said, now) + sender.tick(now)
    machine.receive(out)
    machine.finish()
    return machine, sender, now


def executed(machine: SoftwareMachine) -> list[str]:
    """What the firmware ran of the program: without the host's own questions."""
    return [line for line in machine.executed if not line.startswith(("M105", "M110", "M114", "M400", "M503"))]


@pytest.mark.parametrize(
    "fault",
    [
        "drop-up:line=100",
        "flip-up:line=100",
        "newline-up:line=100",
        "lose-up:line=100",
        "cut-up:line=100",
        "noise-up:line=100",
        "flip-down:line=100",
        "drop-down:line=100",
        "lose-down:line=100",
        "cut-down:line=100",
        "noise-down:line=100",
        "lose-ok:line=100",
        "lose-ok:line=100,times=4",
        "double-ok:line=100",
        "merge-ok:line=100",
        "split-ok:line=100",
        "late-ok:line=100",
        "resend-old:line=100",
        "resend-old:line=100,back=1",
        "resend-old:line=100,back=60",
        "resend-future:line=100",
        "resend-next:line=100",
        "slow-busy:line=100",
        "slow-silent:line=100",
    ],
)
def test_one_fault_is_over_quickly_and_nothing_runs_twice_or_never(fault: str) -> None:
    machine, sender, waited = stream(fault)
    assert sender.state is State.DONE, sender.reason
    assert executed(machine) == PROGRAM
    assert sender.executed == len(PROGRAM)
    assert waited < RECOVERY


@pytest.mark.parametrize("last", [len(PROGRAM) + 2, len(PROGRAM) + 3, len(PROGRAM) + 4, len(PROGRAM) + 5])
@pytest.mark.parametrize("kind", ["lose-up", "newline-up", "flip-up"])
def test_a_fault_in_the_last_lines_is_noticed(kind: str, last: int) -> None:
    machine, sender, waited = stream(f"{kind}:line={last}")
    assert sender.state is State.DONE, sender.reason
    assert executed(machine) == PROGRAM
    assert waited < RECOVERY


@pytest.mark.parametrize("line", range(1, 6))
@pytest.mark.parametrize("kind", ["lose-up", "flip-up", "drop-up", "newline-up", "lose-down", "flip-down"])
def test_a_fault_while_numbers_are_agreed_on_is_noticed(kind: str, line: int) -> None:
    machine, sender, waited = stream(f"{kind}:line={line}")
    assert sender.state is State.DONE, sender.reason
    assert executed(machine) == PROGRAM
    assert waited < 2 * RECOVERY


@pytest.mark.parametrize(
    "faults",
    [
        ("flip-up:p=0.05", "drop-up:p=0.05"),
        ("lose-up:p=0.02", "newline-up:p=0.02", "noise-up:p=0.02"),
        ("flip-down:p=0.05", "drop-down:p=0.05"),
        ("flip-up:p=0.02", "flip-down:p=0.02", "lose-ok:p=0.02", "double-ok:p=0.02", "merge-ok:p=0.02"),
        ("resend-no-ok:line=20", "flip-up:p=0.05"),
        ("resend-late-ok:line=20", "flip-up:p=0.02"),
        ("resend-old:p=0.03", "resend-next:p=0.03", "resend-future:p=0.03", "flip-up:p=0.02"),
    ],
    ids=lambda faults: "+".join(fault.partition(":")[0] for fault in faults),
)
def test_many_faults_at_once_leave_the_program_exact(faults: tuple[str, ...]) -> None:
    machine, sender, _ = stream(*faults)
    assert sender.state is State.DONE, sender.reason
    assert executed(machine) == PROGRAM


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("resend-forever:line=100", "times in a row for the line 'G1"),
        ("reset:line=100", "restarted: it sent its start banner"),
        ("reset-silent:line=100", "restarted: it asks for line number 1"),
        ("reset-silent:line=6", "restarted: it asks for line number 1"),
        ("kill:line=100", "kill()"),
        ("cancel:line=100", "cancelled at the printer"),
    ],
)
def test_what_must_stop_stops_with_its_reason(fault: str, reason: str) -> None:
    machine, sender, waited = stream(fault)
    assert sender.state is State.STOPPED
    assert reason in sender.reason
    assert waited < 3 * RECOVERY
    ran = executed(machine)
    program_part = [line for line in ran if line in set(PROGRAM) - set(HEATERS_OFF)]
    assert program_part == PROGRAM[: len(program_part)]
    assert len(program_part) < len(PROGRAM) - 1
    assert abs(sender.executed - len(program_part)) <= 5


def test_no_motion_is_sent_after_a_reset() -> None:
    machine, sender, _ = stream("reset:line=100")
    assert machine.executed[-3:] == list(HEATERS_OFF)
    assert len(machine.executed) <= 100 + len(HEATERS_OFF)
    assert sender.executed < 100


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("runaway:line=4,heater=nozzle", ("Heater_ID: E0",)),
        ("maxtemp:line=4,heater=bed", ("Heater_ID: bed",)),
        ("sensor-open:line=4", ("Heater_ID: E0",)),
    ],
)
def test_a_heater_that_fails_stops_the_print_and_is_named(fault: str, words: tuple[str, ...]) -> None:
    heat = ["M140 S60", "M104 S210", "M190 S60", "M109 S210", *PROGRAM, "G4 S600", *PROGRAM]
    _, sender, _ = stream(fault, program=heat, limit=2000.0)
    assert sender.state is State.STOPPED
    for word in words:
        assert word in sender.reason


def test_heating_is_waited_for_and_reported() -> None:
    machine, sender, _ = stream(program=["M140 S60", "M104 S210", "M190 S60", "M109 S210", "G28", "G1 X5 F600"])
    assert sender.state is State.DONE, sender.reason
    assert executed(machine)[-1] == "G1 X5 F600"
    assert sender.heaters["T"][1] == 210.0
    assert sender.heaters["T"][0] > 200.0
    assert sender.heaters["B"][1] == 60.0


def test_a_pause_asked_for_at_the_printer_holds_the_stream_until_it_resumes() -> None:
    _, held, _ = stream("pause:line=100", limit=30.0)
    assert held.state is State.STREAMING
    assert held.executed < 110
    machine, sender, _ = stream("pause:line=100", "resume:time=20")
    assert sender.state is State.DONE
    assert executed(machine) == PROGRAM


def test_a_smaller_receive_ring_makes_the_window_smaller() -> None:
    hold = ["G28", *(["G4 P100", *PROGRAM[1:6]] * 40)]
    machine, sender, _ = stream("ring:line=5,size=16", program=hold)
    assert sender.state is State.DONE, sender.reason
    assert executed(machine) == hold


def test_a_stop_on_request_ends_motion_and_heat_and_lifts() -> None:
    machine = SoftwareMachine(PROFILE, speed=None, seed=3)
    sender = Sender(["M104 S210", "M109 S210", *PROGRAM])
    now = 0.0
    out = sender.start(now)
    asked = False
    while not sender.over and now < 60:
        machine.receive(out)
        said = machine.advance(0.0)
        if not said:
            now += 0.01
            said = machine.advance(0.01)
        out = sender.receive(said, now) + sender.tick(now)
        if sender.executed > 50 and not asked:
            asked = True
            out += sender.stop(now, "stopped on request")
    assert sender.state is State.STOPPED
    assert sender.reason == "stopped on request"
    assert all(heater.target == 0 for heater in machine.heaters)
    ran = machine.executed
    assert "M410" in ran
    assert ran.index("G91") > ran.index("M104 S0") > ran.index("M410")
    assert PROGRAM[70] not in ran[60:] or ran.count("G28") == 1
    assert sender.executed < 70


def test_an_advanced_ok_with_numbers_is_understood() -> None:
    machine = SoftwareMachine(PROFILE, speed=None, seed=3, advanced_ok=True, faults=[parse_fault("lose-ok:p=0.05")])
    sender = Sender(PROGRAM)
    now = 0.0
    out = sender.start(now)
    while not sender.over and now < 60:
        machine.receive(out)
        said = machine.advance(0.0)
        if not said:
            now += 0.01
            said = machine.advance(0.01)
        out = sender.receive(said, now) + sender.tick(now)
    assert sender.state is State.DONE, sender.reason
    assert executed(machine) == PROGRAM
    assert now < RECOVERY  # numbers make up for every lost ok but the last
