"""From bytes to command lines: comments, truncation, line numbers, checksums (Marlin 2.1 `queue.cpp`).

A `LineReader` holds one unfinished line of at most 95 bytes, whatever arrives. `feed` takes bytes up to one line end
and answers with the command to queue, a `LineError` to report, or None (an empty line, a comment, a duplicate).
"""

import re
from dataclasses import dataclass
from functools import reduce
from operator import xor

MAX_LINE = 95
"""Bytes kept of a line: MAX_CMD_SIZE less the terminator."""
ANY_SPECIAL = re.compile(rb"[;\\\x08]")
NUMBER = re.compile(rb" *([-+]?\d+)")
LINE_NUMBER = "Line Number is not Last Line Number+1, Last Line: "
CHECKSUM = "checksum mismatch, Last Line: "
NO_CHECKSUM = "No Checksum with line number, Last Line: "


@dataclass(frozen=True)
class LineError:
    """A line that is to be sent again; `text` is what the firmware says of it."""

    text: str


class LineReader:
    """Assembles lines and checks their numbers."""

    def __init__(self) -> None:
        self.last = 0
        """Number of the last line accepted."""
        self._line = bytearray()
        self._comment = False
        self._escaped = False

    def feed(self, data: bytes) -> bytes | LineError | None:
        """Take bytes of which at most the last ends a line."""
        ended = data[-1:] in (b"\n", b"\r")
        body = data[:-1] if ended else data
        if not self._line and not self._comment and not self._escaped and not ANY_SPECIAL.search(body):
            kept: bytes = body[:MAX_LINE]
            if not ended:
                self._line += kept
                self._comment = len(kept) == MAX_LINE
                return None
        else:
            self._take(body)
            if not ended:
                return None
            kept = bytes(self._line)
            self.forget()
        return self._check(kept) if kept else None

    def forget(self) -> None:
        """Drop the unfinished line."""
        self._line.clear()
        self._comment = False
        self._escaped = False

    def _take(self, body: bytes) -> None:
        line = self._line
        for byte in body:
            if self._comment:
                return
            if self._escaped:
                self._escaped = False
            elif byte == 0x5C:
                self._escaped = True
                continue
            elif byte == 0x3B:
                self._comment = True
                continue
            if byte == 0x08:
                del line[-1:]
                continue
            line.append(byte)
            if len(line) >= MAX_LINE:
                self._comment = True

    def _check(self, line: bytes) -> bytes | LineError | None:
        line = line.split(b"\0", 1)[0]
        command = line.lstrip(b" ")
        if not command.startswith(b"N"):
            return line
        sets_number = b"M110" in command
        place = command.find(b"N", 4) if sets_number else 0
        number = _number(command[max(place, 0) + 1 :])
        if number != self.last + 1 and not sets_number:
            if self.last - 1 <= number <= self.last:
                return None
            return LineError(LINE_NUMBER)
        star = command.rfind(b"*")
        if star < 0:
            return LineError(NO_CHECKSUM)
        if _number(command[star + 1 :]) != reduce(xor, command[:star], 0):
            return LineError(CHECKSUM)
        self.last = number
        return line


def _number(text: bytes) -> int:
    found = NUMBER.match(text)
    return int(found[1]) if found else 0
