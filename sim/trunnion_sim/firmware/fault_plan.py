"""Faults at work: decides, line by line, which strike, and damages the bytes of both wires.

Every fault has its own random numbers, seeded by the machine's seed and its place in the list, and counts lines of its
own wire, so a run with the same seed and the same bytes is damaged the same way, however the bytes are cut up.
"""

import random
from collections.abc import Iterator, Sequence

from trunnion_sim.firmware.faults import Fault

DELAYS = ("slow-busy", "slow-silent", "prompt", "unreachable")
"""Firmware faults that need a command to strike."""
LONGEST_LINE = 4096
"""Bytes after which an endless line to the firmware is passed on in pieces."""


class _Strike:
    """One fault with its memory."""

    def __init__(self, fault: Fault, seed: int, place: int) -> None:
        self.fault = fault
        self.random = random.Random(f"{seed} {place} {fault.kind}")
        self.count = 0
        self.left = fault.times

    def falls(self, now: float, size: int = 0) -> bool:
        """Whether the fault strikes this line, of `size` bytes."""
        fault = self.fault
        self.count += 1
        if fault.when == "line":
            hit = self.count >= fault.at
        elif fault.when == "time":
            hit = now >= fault.at
        elif fault.when == "p":
            hit = self.random.random() < fault.at
        else:
            hit = self.random.random() < 1.0 - (1.0 - 1.0 / fault.at) ** size
        if not hit or self.left <= 0:
            return False
        self.left -= 1
        return True


class FaultPlan:
    """All faults of one machine."""

    def __init__(self, faults: Sequence[Fault], seed: int) -> None:
        strikes = [_Strike(fault, seed, place) for place, fault in enumerate(faults)]
        self._up = [s for s in strikes if s.fault.where == "up"]
        self._down = [s for s in strikes if s.fault.where == "down"]
        self._ok = [s for s in strikes if s.fault.where == "ok"]
        firmware = [s for s in strikes if s.fault.where == "firmware"]
        self._firmware = [s for s in firmware if not _by_itself(s.fault)]
        timed = [s.fault for s in firmware if _by_itself(s.fault)]
        self.timed = sorted(timed, key=lambda fault: fault.at)
        """Firmware faults that strike at a time, whether a command comes or not."""
        self._line = bytearray()

    def up(self, data: bytes, now: float) -> bytes:
        """What of `data` reaches the firmware; an unfinished line is held back until it ends."""
        if not self._up:
            return data
        self._line += data
        arrived = bytearray()
        while True:
            stop = self._line.find(b"\n") + 1
            if not stop:
                if len(self._line) < LONGEST_LINE:
                    return bytes(arrived)
                stop = LONGEST_LINE
            line = bytes(self._line[:stop])
            del self._line[:stop]
            for strike in self._up:
                if strike.falls(now, len(line)):
                    line = _damaged(line, strike)
            arrived += line

    def down(self, line: bytes, now: float) -> Iterator[tuple[bytes, float]]:
        """Pieces of one line of answer, each with the seconds to hold it back first."""
        for strike in self._down:
            if strike.falls(now, len(line)):
                line = _damaged(line, strike)
        if line.startswith(b"ok"):
            for strike in self._ok:
                if strike.falls(now):
                    yield from _ok_pieces(line, strike.fault)
                    return
        yield line, 0.0

    @property
    def touches_down(self) -> bool:
        """Whether any fault is about answers."""
        return bool(self._down or self._ok)

    def on_command(self, now: float) -> list[Fault]:
        """Firmware faults that strike before the command that begins now."""
        return [strike.fault for strike in self._firmware if strike.falls(now)]


def _by_itself(fault: Fault) -> bool:
    return fault.when == "time" and fault.kind not in DELAYS


def _damaged(line: bytes, strike: _Strike) -> bytes:
    kind = strike.fault.kind.rpartition("-")[0]
    chance = strike.random
    if kind == "lose" or not line:
        return b""
    if kind == "noise":
        size = int(strike.fault.number("size"))
        return bytes(chance.randrange(0x80, 0x100) for _ in range(size)) + line
    if kind == "newline":
        return line.rstrip(b"\r\n")
    if kind == "cut":
        return line[: len(line) // 2]
    body = len(line.rstrip(b"\r\n"))
    place = chance.randrange(max(body, 1))
    if kind == "drop":
        return line[:place] + line[place + 1 :]
    return line[:place] + bytes([line[place] ^ (1 << chance.randrange(8))]) + line[place + 1 :]


def _ok_pieces(line: bytes, fault: Fault) -> Iterator[tuple[bytes, float]]:
    if fault.kind == "double-ok":
        yield line, 0.0
        yield line, 0.0
    elif fault.kind == "merge-ok":
        yield line.rstrip(b"\r\n"), 0.0
    elif fault.kind == "split-ok":
        yield line[:1], 0.0
        yield line[1:], fault.number("seconds")
    elif fault.kind == "late-ok":
        yield line, fault.number("seconds")
