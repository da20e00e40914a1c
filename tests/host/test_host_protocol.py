"""The protocol against scripted wires: firmware of other kinds, garbage, silence, clocks that jump."""

from functools import reduce
from operator import xor
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.errors import StreamError
from trunnion_host.limits import Limits
from trunnion_host.prepare import MAX_LINE, commands
from trunnion_host.protocol import Sender
from trunnion_host.replies import Kind, parse, temperatures
from trunnion_host.states import LEGAL, State
from trunnion_host.wire import numbered

PROGRAM = [f"G1 X{i}.5 Y{i % 7} F3000" for i in range(60)]


class Firmware:
    """The least that numbers lines: takes N only as the successor of the last, and says so in one of several styles."""

    def __init__(self, *, resend: str = "Resend: {n}", ok_after_resend: bool = True, silent_duplicates: bool = True):
        self.resend = resend
        self.ok_after_resend = ok_after_resend
        self.silent_duplicates = silent_duplicates
        self.last = 7
        self.taken: list[str] = []
        self.buffer = b""

    def receive(self, data: bytes) -> bytes:
        *lines, self.buffer = (self.buffer + data).split(b"\n")
        return b"".join(self._line(line) for line in lines if line)

    def _line(self, line: bytes) -> bytes:
        body, star, check = line.rpartition(b"*")
        if line[:1] != b"N":
            return b"ok\n"
        try:
            fits = bool(star) and int(check) == reduce(xor, body)
            number = int(body[1:].split()[0])
        except (ValueError, IndexError):
            fits, number = False, 0
        if not fits:
            return self._again("checksum mismatch")
        text = body.split(b" ", 1)[1].decode()
        if "M110" in text:
            self.last = number
            return b"ok\n"
        if number != self.last + 1:
            if self.silent_duplicates and number in (self.last, self.last - 1):
                return b""
            return self._again("Line Number is not Last Line Number+1")
        self.last = number
        self.taken.append(text)
        return b"ok T:20.0 /0.0\n" if text == "M105" else b"ok\n"

    def _again(self, why: str) -> bytes:
        said = f"Error:{why}, Last Line: {self.last}\n{self.resend.format(n=self.last + 1)}\n"
        return (said + ("ok\n" if self.ok_after_resend else "")).encode()


def program_of(firmware: Firmware) -> list[str]:
    return [text for text in firmware.taken if text not in ("M105", "M114", "M400")]


@pytest.mark.parametrize("resend", ["Resend: {n}", "Resend:{n}", "rs {n}", "rs N{n}"])
@pytest.mark.parametrize("ok_after_resend", [True, False])
@pytest.mark.parametrize("silent_duplicates", [True, False])
def test_every_spelling_of_a_resend_is_served(resend: str, ok_after_resend: bool, silent_duplicates: bool) -> None:
    firmware = Firmware(resend=resend, ok_after_resend=ok_after_resend, silent_duplicates=silent_duplicates)
    sender = Sender(PROGRAM)
    now = 0.0
    out = sender.start(now)
    writes = 0
    while not sender.over and now < 60:
        writes += bool(out)
        if writes % 9 == 5 and len(out) > 8:
            out = out[:6] + bytes([out[6] ^ 4]) + out[7:]
            writes += 1
        said = firmware.receive(out)
        now += 0.01
        out = sender.receive(said, now) + sender.tick(now)
    assert sender.state is State.DONE, sender.reason
    assert program_of(firmware) == PROGRAM
    assert sender.resends > 3


@settings(max_examples=25, deadline=None)
@given(silent=st.booleans(), seed=st.integers(0, 10**6), rate=st.sampled_from([0.0, 0.001, 0.004]))
def test_whatever_the_wire_does_what_is_taken_is_a_prefix_of_the_program(silent: bool, seed: int, rate: float) -> None:
    firmware = Firmware(silent_duplicates=silent)
    random = Random(seed)

    def hurt(line: bytes) -> bytes:
        """At most one fault a line: two can cancel in a checksum of eight bits."""
        if not line or random.random() > rate * len(line):
            return line
        at = random.randrange(len(line))
        flipped = line[:at] + bytes([line[at] ^ (1 << random.randrange(8))]) + line[at + 1 :]
        return random.choice([line[:at] + line[at + 1 :], flipped, b""])

    def hurt_all(data: bytes) -> bytes:
        return b"".join(hurt(line) for line in data.splitlines(True))

    sender = Sender(PROGRAM)
    now = 0.0
    out = sender.start(now)
    down = b""
    while not sender.over and now < 60:
        down += hurt_all(firmware.receive(hurt_all(out)))
        cut = random.randrange(len(down) + 1)
        piece, down = down[:cut], down[cut:]
        now += 0.05
        out = sender.receive(piece, now) + sender.tick(now)
    taken = program_of(firmware)
    assert taken == PROGRAM[: len(taken)]
    if sender.state is State.DONE:
        assert program_of(firmware) == PROGRAM
    assert rate or sender.state is State.DONE


def greeted(sender: Sender) -> float:
    """Agree on numbers with a well-behaved firmware; returns the time."""
    sender.start(0.0)
    sender.receive(b"ok\n", 0.1)
    sender.receive(b"ok T:20.0 /0.0\n", 0.2)
    assert sender.state is State.STREAMING
    return 0.2


def test_the_first_lines_agree_on_numbers() -> None:
    sender = Sender(["G28"])
    assert sender.start(0.0) == b"\nN0 M110 N0*125\n"
    assert sender.receive(b"ok\n", 0.1) == b"N1 M105*38\n"
    assert sender.receive(b"ok T:20.0 /0.0\n", 0.2).startswith(b"N2 G28*")


def test_no_more_is_under_way_than_lines_and_bytes_allow() -> None:
    for size, lines in ((4, 4), (30, 3), (50, 2), (80, 1)):
        sender = Sender(["G1 " + "X" * size] * 50)
        sender.start(0.0)
        sender.receive(b"ok\n", 0.1)
        out = sender.receive(b"ok T:20.0 /0.0\n", 0.2)
        assert out.count(b"\n") == lines
        assert len(out) <= 128


def test_an_ok_too_many_does_not_widen_the_window_for_good() -> None:
    sender = Sender(["G1 X1"] * 50)
    now = greeted(sender)
    out = sender.receive(b"okok\nok\n", now)
    question = [line for line in out.splitlines() if b"M105" in line]
    for _ in range(6):
        out = sender.receive(b"ok\n", now)
        question += [line for line in out.splitlines() if b"M105" in line]
    sender.receive(b"ok\n" * 20, now)
    assert question or sender.questions > 0


@pytest.mark.parametrize("garbage", [b"Resend: 99999\n", b"Resend: 3x\n", b"\xff\xfe\x80\n", b"Rezend: 2\n", b"o\n"])
def test_garbage_from_the_wire_makes_the_host_ask_and_nothing_else(garbage: bytes) -> None:
    sender = Sender(PROGRAM)
    now = greeted(sender)
    before = sender.sent
    out = sender.receive(garbage, now + 0.01)
    assert sender.state is State.STREAMING
    assert b"G1" not in out
    assert sender.sent == before
    assert b"M105" in sender.receive(b"ok\nok\nok\n", now + 0.02)


def test_a_resend_for_the_next_number_means_nothing_to_do() -> None:
    sender = Sender(PROGRAM)
    now = greeted(sender)
    out = sender.receive(b"Resend: %d\n" % (2 + sender.sent), now)
    assert out == b""
    assert sender.state is State.STREAMING


def test_a_number_always_carries_the_same_text() -> None:
    sender = Sender(PROGRAM)
    now = greeted(sender)
    seen: dict[bytes, bytes] = {}
    out = b""
    for i in range(200):
        now += 0.05
        said = b"ok\n" * (i % 3) + (b"Resend: %d\n" % (i % 23) if i % 5 == 0 else b"")
        out = sender.receive(said, now) + sender.tick(now)
        for line in out.splitlines():
            if line.startswith(b"N"):
                assert seen.setdefault(line.split()[0], line) == line


def test_a_host_that_slept_does_not_take_the_printer_for_dead() -> None:
    sender = Sender(PROGRAM)
    now = greeted(sender)
    out = sender.tick(now + 3600.0)
    assert sender.state is State.STREAMING
    assert out.count(b"\n") <= 1


def test_silence_is_borne_while_the_printer_says_busy_and_not_for_ever_without() -> None:
    sender = Sender(PROGRAM, Limits(silence=30.0))
    now = greeted(sender)
    for _ in range(200):
        now += 2.0
        sender.receive(b"echo:busy: processing\n", now)
        sender.tick(now)
    assert sender.state is State.STREAMING
    for _ in range(40):
        now += 1.0
        sender.tick(now)
    assert sender.state is State.STOPPED
    assert "silent for 30 s" in sender.reason


def test_silence_after_the_last_line_is_asked_about_with_few_questions() -> None:
    sender = Sender(PROGRAM)
    now = greeted(sender)
    out = b""
    for _ in range(1000):
        now += 0.1
        out += sender.tick(now)
        if sender.over:
            break
    assert out.count(b"M105") == Limits().asks
    assert len(out) <= 128
    assert b"G1" not in out


def test_nobody_there_is_said() -> None:
    sender = Sender(PROGRAM)
    sender.start(0.0)
    now = 0.0
    while not sender.over:
        now += 0.5
        sender.tick(now)
    assert "nothing that speaks G-code answered" in sender.reason
    assert not sender.greeted


@pytest.mark.parametrize(
    "text",
    [
        "Error:Thermal Runaway, system stopped! Heater_ID: bed",
        "Error:MAXTEMP triggered, system stopped! Heater_ID: E0",
        "Error:Printer halted. kill() called!",
        "!! Heater extruder not heating at expected rate",
        "Error:Heating failed, system stopped! Heater_ID: E0",
    ],
)
def test_what_the_firmware_cannot_survive_stops_at_once_and_says_which(text: str) -> None:
    sender = Sender(PROGRAM)
    now = greeted(sender)
    assert sender.receive(text.encode() + b"\nok\nok\n", now) == b""
    assert sender.state is State.STOPPED
    assert text in sender.reason


def test_states_only_move_as_written_down() -> None:
    assert set(LEGAL) == set(State)
    assert all(not LEGAL[state] for state in (State.DONE, State.STOPPED))
    sender = Sender(PROGRAM)
    with pytest.raises(RuntimeError, match="GREETING cannot become DONE"):
        sender._to(State.DONE)


def test_a_firmware_without_thermometers_gets_its_program_too() -> None:
    sender = Sender(PROGRAM)
    out = sender.start(0.0)
    lines = []
    now = 0.0
    while not sender.over and now < 10:
        now += 0.01
        new = [line for line in out.splitlines() if line]
        lines += new
        out = sender.receive(b"ok\n" * len(new), now) + sender.tick(now)
    assert sender.state is State.DONE
    assert [text for text in PROGRAM if not any(text.encode() in line for line in lines)] == []


@given(number=st.integers(0, 10**7), text=st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=60))
def test_the_checksum_is_the_exclusive_or_of_what_stands_before_it(number: int, text: str) -> None:
    line = numbered(number, text)
    body, _, check = line.rstrip(b"\n").rpartition(b"*")
    total = 0
    for byte in body:
        total ^= byte
    assert int(check) == total
    assert line.endswith(b"\n")


def test_lines_are_stripped_to_what_the_wire_carries() -> None:
    prepared = commands(["; header", "", "  G28  ; home", "   ", "N12 G1 X1*57", "M104 S210"])
    assert prepared.text == ("G28", "G1 X1", "M104 S210")
    assert prepared.source == (3, 5, 6)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("G1 X" + "1" * 100, "line 2: 104 characters"),
        ("M110 N5", "line 2: M110 changes the line numbers"),
        ("M117 five * six", "line 2: '\\*' begins a checksum"),
        ("M117 größer", "line 2: .* is not plain ASCII"),
    ],
)
def test_lines_the_wire_cannot_carry_are_refused_before_anything_moves(line: str, words: str) -> None:
    with pytest.raises(StreamError, match=words):
        commands(["G28", line])


def test_the_longest_line_allowed_fits_the_firmware() -> None:
    text = "G1 " + "X" * 76
    while True:
        try:
            commands([text + "X"] + ["G28"] * 3)
        except StreamError:
            break
        text += "X"
    assert len(numbered(109, text).rstrip(b"\n")) <= MAX_LINE


@pytest.mark.parametrize(
    ("line", "kind", "number"),
    [
        (b"ok", Kind.OK, None),
        (b"ok P15 B3", Kind.OK, None),
        (b"ok N12 P15 B3", Kind.OK, 12),
        (b"ok T:21.0 /0.0 B:22.0 /0.0 @:0 B@:0", Kind.OK_REPORT, None),
        (b"ok T0:26.4 /0.0", Kind.OK_REPORT, None),
        (b"Resend: 12", Kind.RESEND, 12),
        (b"rs 12", Kind.RESEND, 12),
        (b"Resend:12", Kind.RESEND, 12),
        (b"echo:busy: processing", Kind.BUSY, None),
        (b"start", Kind.START, None),
        (b" T:19.38 /0.00 B:19.38 /0.00 @:0 B@:0", Kind.REPORT, None),
        (b"T:19.38 /210.00 W:?", Kind.REPORT, None),
        (b"X:10.00 Y:5.00 Z:1.00 A:30.00 B:-45.00 E:0.00 Count X:800", Kind.POSITION, None),
        (b"Error:checksum mismatch, Last Line: 4", Kind.LINE_ERROR, 4),
        (b"Error:No Checksum with line number, Last Line: 4", Kind.LINE_ERROR, 4),
        (b"Error:Printer halted. kill() called!", Kind.FATAL, None),
        (b"//action:cancel", Kind.ACTION, None),
        (b'echo:Unknown command: "smoke"', Kind.TALK, None),
        (b"Cap:EMERGENCY_PARSER:1", Kind.TALK, None),
        (b"books", Kind.NOISE, None),
        (b"\x80\xff", Kind.NOISE, None),
    ],
)
def test_replies_mean_what_firmware_means(line: bytes, kind: Kind, number: int | None) -> None:
    reply = parse(line)
    assert reply.kind is kind
    assert reply.number == number


def test_temperatures_are_not_read_from_positions() -> None:
    position = parse(b"X:10.00 Y:5.00 Z:1.00 A:30.00 B:-45.00 E:0.00 Count X:800")
    assert position.kind is Kind.POSITION
    assert temperatures(" T:19.38 /0.00 B:20.00 /60.00 @:0") == {"T": (19.38, 0.0), "B": (20.0, 60.0)}
