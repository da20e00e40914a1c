"""Faults on command: read from text, seeded, and survivable by a host that follows the protocol."""

import re
from functools import reduce
from operator import xor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.firmware.faults import KINDS, FaultError, parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine

PROFILE = load_profile("generic_ab_cradle")
SILENCE = 3.0
"""Simulated seconds without a word after which the host acts."""


@pytest.fixture(scope="module")
def profile() -> MachineProfile:
    return PROFILE


def numbered(n: int, text: str) -> bytes:
    head = f"N{n} {text}".encode()
    return head + b"*%d\n" % reduce(xor, head)


class Stubborn:
    """A host for tests: one line in flight, believes only numbers that make sense, never gives up on silence."""

    def __init__(self, machine: SoftwareMachine) -> None:
        self.machine = machine
        self.heard = b""
        self.unread = b""

    def lines(self, seconds: float) -> list[bytes]:
        self.unread += self.machine.run_until(self.machine.now + seconds)
        *whole, self.unread = self.unread.split(b"\n")
        return whole

    def stream(self, program: list[str], patience: int = 20000) -> None:
        n = 1
        silent = 0.0
        repeated = False
        self.machine.receive(b"\n" + numbered(n, program[0]))
        for _ in range(patience):
            lines = self.lines(0.25)
            silent = 0.0 if lines else silent + 0.25
            wanted = n
            for place, line in enumerate(lines):
                found = re.fullmatch(rb"Resend: (\d+)", line)
                if found and max(1, n - 30) <= int(found[1]) <= n + 1:
                    wanted, answered = int(found[1]), True
                    break
                answered = line.strip() == b"ok" and not (place and lines[place - 1].startswith(b"Resend"))
                if answered:
                    wanted = n + 1
                    break
            else:
                if silent < SILENCE:
                    continue
                if repeated:
                    wanted = n + 1
                self.unread = b""
                repeated, silent = not repeated, 0.0
                answered = False
            if answered:
                repeated = False
                self.lines(0.5)
                silent = 0.0
            n = wanted
            if n > len(program):
                if self.confirmed(len(program)):
                    return
                n = len(program)
            self.machine.receive(b"\n" + numbered(n, program[n - 1]))
        raise AssertionError("the host ran out of patience")

    def confirmed(self, last: int) -> bool:
        return self.machine.reader.last == last


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("flop-up", "no such fault; did you mean 'flip-up'?"),
        ("flip-up:p", "'p' should be key=value"),
        ("flip-up:p=often", "p is 'often', should be a number"),
        ("flip-up:p=-1", "p is '-1', should be a number of 0 or more"),
        ("flip-up:p=nan", "should be a number"),
        ("flip-up:p=2", "p is 2, should be at most 1"),
        ("reset:bytes=100", "needs a fault of a wire"),
        ("late-ok:second=1", "unknown key; did you mean 'seconds'?"),
        ("runaway:heater=chamber", "heater is chamber, should be nozzle or bed"),
        ("", "no such fault"),
    ],
)
def test_a_bad_spec_is_one_clear_error(spec: str, message: str) -> None:
    with pytest.raises(FaultError, match=re.escape(message)):
        parse_fault(spec)


def test_every_kind_can_be_asked_for_and_strikes_without_harm_to_the_simulator(profile: MachineProfile) -> None:
    for kind in KINDS:
        machine = SoftwareMachine(profile, faults=[parse_fault(f"{kind}:line=2")])
        for n in range(1, 6):
            machine.receive(numbered(n, f"G1 X{n} F6000"))
            machine.run_until(machine.now + 10.0)
        machine.run_until(machine.now + 300.0)


PROGRAM = [f"G1 X{n % 9} A{n % 5} F6000" for n in range(1, 61)]


@pytest.mark.parametrize(
    "spec",
    [
        "flip-up:p=0.1",
        "drop-up:p=0.1",
        "flip-up:bytes=300",
        "newline-up:p=0.05",
        "lose-up:p=0.1",
        "cut-up:p=0.05",
        "noise-up:p=0.1",
        "flip-down:p=0.1",
        "drop-down:p=0.1",
        "lose-down:p=0.1",
        "cut-down:p=0.1",
        "noise-down:p=0.1",
        "lose-ok:p=0.1",
        "double-ok:p=0.1",
        "merge-ok:p=0.1",
        "split-ok:p=0.1,seconds=0.1",
        "late-ok:p=0.1,seconds=0.4",
        "resend-old:line=20",
        "resend-future:line=20",
        "resend-next:line=20",
        "resend-no-ok",
        "resend-late-ok",
        "pause:p=0.1",
        "slow-busy:line=9,seconds=30",
        "slow-silent:line=9,seconds=2",
        "ring:size=4",
    ],
)
def test_a_host_by_the_book_prints_exactly_through(profile: MachineProfile, spec: str) -> None:
    machine = SoftwareMachine(profile, faults=[parse_fault(spec), parse_fault("flip-up:p=0.03")], seed=3)
    Stubborn(machine).stream(PROGRAM)
    machine.finish()
    assert [line for line in machine.executed if line.startswith("G1")] == PROGRAM


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    kinds=st.lists(
        st.sampled_from([kind for kind in KINDS if KINDS[kind].where in ("up", "down")]), min_size=1, max_size=3
    ),
)
def test_nothing_is_executed_twice_or_left_out_under_mixed_faults(seed: int, kinds: list[str]) -> None:
    machine = SoftwareMachine(PROFILE, faults=[parse_fault(f"{kind}:p=0.05") for kind in kinds], seed=seed)
    Stubborn(machine).stream(PROGRAM[:25])
    machine.finish()
    assert [line for line in machine.executed if line.startswith("G1")] == PROGRAM[:25]


@pytest.mark.parametrize("cut", [1, 7, 1000])
def test_the_same_seed_does_the_same_damage_however_the_bytes_are_cut(profile: MachineProfile, cut: int) -> None:
    specs = ["flip-up:bytes=60", "drop-up:p=0.2", "flip-down:p=0.3", "lose-ok:p=0.3"]

    def said(cut: int, seed: int = 5) -> bytes:
        machine = SoftwareMachine(profile, faults=[parse_fault(spec) for spec in specs], seed=seed)
        data = b"".join(b"M118 line %d\n" % n for n in range(50))
        out = b""
        for line in data.splitlines(keepends=True):
            for start in range(0, len(line), cut):
                machine.receive(line[start : start + cut])
            out += machine.run_until(machine.now + 1.0)
        return out

    assert said(cut) == said(3)
    assert said(cut) != said(3, seed=6)


def test_a_fault_strikes_as_often_as_asked(profile: MachineProfile) -> None:
    def oks(spec: str) -> int:
        machine = SoftwareMachine(profile, faults=[parse_fault(spec)])
        out = b""
        for _ in range(400):
            machine.receive(b"M107\n")
            out += machine.run_until(machine.now + 0.01)
        return out.count(b"ok\n")

    assert oks("lose-ok:line=7") == 399
    assert oks("lose-ok:line=7,times=5") == 395
    assert oks("lose-ok:time=1") == 399
    assert 340 < oks("lose-ok:p=0.1") < 380


def test_a_reset_forgets_everything_and_says_so(profile: MachineProfile) -> None:
    for kind, banner in (("reset", True), ("reset-silent", False)):
        machine = SoftwareMachine(profile, faults=[parse_fault(f"{kind}:time=30")])
        machine.take()
        machine.receive(b"M104 S100\nG28\nG1 X10 F600\n")
        machine.run_until(29.0)
        machine.take()
        machine.receive(b"M110 N40\nG4 S10\n")
        said = machine.run_until(31.0)
        assert (b"\nstart\n" in said or said.startswith(b"start\n")) == banner
        machine.receive(numbered(1, "M114") + b"M105\n")
        said = machine.run_until(31.0)
        assert b"X:0.00 Y:0.00 Z:0.00" in said
        assert b"/0.00 B:" in said


def test_an_endless_resend_and_a_kill_never_execute(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, faults=[parse_fault("resend-forever:line=2")])
    machine.take()
    machine.receive(numbered(1, "M107"))
    machine.run_until(1.0)
    machine.receive(numbered(2, "M107"))
    machine.run_until(2.0)
    for _ in range(5):
        machine.receive(numbered(3, "M106 S9"))
        assert machine.run_until(machine.now + 1.0) == b"Error:checksum mismatch, Last Line: 2\nResend: 3\nok\n"
    assert machine.executed == ["M107", "M107"]
    killed = SoftwareMachine(profile, faults=[parse_fault("kill:line=2")])
    killed.receive(numbered(1, "M107") + numbered(2, "M107") + numbered(3, "M107"))
    assert killed.run_until(1.0).endswith(b"ok\nError:Printer halted. kill() called!\n//action:poweroff\n")
    assert killed.executed == ["M107"]


def test_wrong_steps_show_in_settings_and_in_where_the_joint_goes(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, faults=[parse_fault("steps:axis=A,factor=0.5")])
    machine.receive(b"G28\n")
    machine.run_until(60.0)
    machine.take()
    machine.receive(b"M503\nG1 A20 F6000\nM400\n")
    assert b" A22.22 " in machine.run_until(65.0)
    assert machine.trace().joints[-1, 3] * 57.29578 == pytest.approx(10.0, abs=0.05)


def test_a_dropped_move_gets_its_ok(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, faults=[parse_fault("unreachable:line=2")])
    machine.take()
    machine.receive(b"G1 X1\nG1 X2\nM114\n")
    said = machine.run_until(3.0)
    assert said.count(b"ok\n") == 3
    assert b"X:1.00" in said


@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=200), max_size=20))
def test_junk_neither_crashes_nor_hangs(chunks: list[bytes]) -> None:
    machine = SoftwareMachine(PROFILE, speed=None)
    for chunk in chunks:
        machine.receive(chunk)
        for _ in range(50):
            if not machine.advance(0.0):
                break
    machine.run_until(machine.now + 1.0)


WORDS = st.sampled_from(["G0", "G1", "G28", "G92", "M104", "M109", "M0", "M155", "M204", "M205", "M92", "M220", "G4"])
VALUES = st.sampled_from(["0", "-1", "1e9", "99999999999999999999999999", ".", "", "nan", "-0.0000001", "1.2.3", "+5"])


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(WORDS, st.lists(st.tuples(st.sampled_from("XYZABEFSPRTJ"), VALUES), max_size=5)), max_size=8))
def test_absurd_numbers_neither_crash_nor_hang(commands: list[tuple[str, list[tuple[str, str]]]]) -> None:
    machine = SoftwareMachine(PROFILE, speed=None)
    for code, words in commands:
        machine.receive((" ".join([code, *(letter + value for letter, value in words)]) + "\n").encode())
        for _ in range(50):
            if b"ok" in machine.advance(0.0):
                break
        machine.receive(b"M108\n")
        machine.advance(0.0)
    machine.run_until(machine.now + 1.0)


def test_an_endless_line_takes_no_memory(profile: MachineProfile) -> None:
    for specs in ((), ("flip-up:p=0.5",)):
        machine = SoftwareMachine(profile, speed=None, faults=[parse_fault(spec) for spec in specs])
        chunk = b"x" * (1 << 20)
        for _ in range(64):
            machine.receive(chunk)
            machine.advance(0.0)
        held = len(machine.reader._line) + len(machine.emergency._line) + len(machine.ring)
        assert held < 400
        machine.receive(b"\n")
        assert b"ok" in machine.advance(0.0)
