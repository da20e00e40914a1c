"""A line from the firmware becomes what it means; what means nothing is noise.

Texts are those of Marlin 2.1, with the older spellings that hosts still meet (`rs 12`, `Resend:12`) and Klipper's `!!`.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, auto


class Kind(Enum):
    """What a line from the firmware means to the stream."""

    OK = auto()
    OK_REPORT = auto()
    """An ok that carries temperatures: the answer to M105 and to nothing else."""
    RESEND = auto()
    BUSY = auto()
    REPORT = auto()
    """Temperatures that came by themselves, or while heating is waited for."""
    POSITION = auto()
    START = auto()
    LINE_ERROR = auto()
    """The firmware did not take a line; its Resend follows."""
    FATAL = auto()
    ACTION = auto()
    TALK = auto()
    """Something for people."""
    NOISE = auto()


@dataclass(frozen=True)
class Reply:
    """One line; `number` of an ok or Resend where it has one, `count` of oks that ran together."""

    kind: Kind
    text: str = ""
    number: int | None = None
    count: int = 1


LONGEST = 4096
"""Bytes without a newline beyond this are noise."""
OK = Reply(Kind.OK)
RESEND = re.compile(r"^(?:Resend:|rs)\s*N?(\d+)\s*$")
OK_LINE = re.compile(r"^(?:ok)+(?=\s|$)")
OK_NUMBER = re.compile(r"^ok N(\d+)\b")
TEMPERATURE = re.compile(r"\b([TB]\d?):\s*(-?\d+(?:\.\d+)?)(?:\s*/\s*(-?\d+(?:\.\d+)?))?")
LAST_LINE = re.compile(r"Last Line:\s*(\d+)\s*$")
FATAL = re.compile(
    r"kill\(\)|halted|thermal runaway|max ?temp|min ?temp|heating failed|system stopped|M112 shutdown|^!!|"
    r"shutdown|emergency stop",
    re.IGNORECASE,
)
LINE_ERROR = re.compile(r"checksum|line number", re.IGNORECASE)
TALK = re.compile(r"^(?:echo:|Error|FIRMWARE_NAME:|Cap:|PowerUp|wait$|Unknown)")
START = re.compile(r"^(?:start$|(?:echo:\s*)?Marlin \d)")
BUSY = re.compile(r"^(?:echo:)?\s*busy:")


class Reader:
    """Bytes in pieces of any size become replies."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def take(self, data: bytes) -> Iterator[Reply]:
        """The replies that these bytes complete."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest if len(rest) < LONGEST else bytearray()
        return (parse(bytes(line.rstrip(b"\r"))) for line in lines)


def parse(line: bytes) -> Reply:
    """The meaning of one line without its newline. Never raises: any bytes may come."""
    if line == b"ok":
        return OK
    text = line.decode("ascii", "replace").strip()
    if not text:
        return Reply(Kind.TALK)
    found = OK_LINE.match(text)
    if found:
        number = OK_NUMBER.match(text)
        kind = Kind.OK_REPORT if TEMPERATURE.search(text) else Kind.OK
        return Reply(kind, text, int(number[1]) if number else None, len(found[0]) // 2)
    found = RESEND.match(text)
    if found:
        return Reply(Kind.RESEND, text, int(found[1]))
    if BUSY.match(text):
        return Reply(Kind.BUSY, text)
    if START.match(text):
        return Reply(Kind.START, text)
    if text.startswith("//"):
        return Reply(Kind.ACTION, text.removeprefix("//").strip())
    if LINE_ERROR.search(text) and "rror" in text[:8]:
        last = LAST_LINE.search(text)
        return Reply(Kind.LINE_ERROR, text, int(last[1]) if last else None)
    if FATAL.search(text) and not text.startswith(("Cap:", "echo:  M")):
        return Reply(Kind.FATAL, text)
    if text.startswith("X:"):
        return Reply(Kind.POSITION, text)
    if TEMPERATURE.match(text):
        return Reply(Kind.REPORT, text)
    return Reply(Kind.TALK if TALK.match(text) else Kind.NOISE, text)


def temperatures(text: str) -> dict[str, tuple[float, float | None]]:
    """Every heater in a report: actual and, where given, target °C."""
    return {
        match[1]: (float(match[2]), float(match[3]) if match[3] is not None else None)
        for match in TEMPERATURE.finditer(text)
    }
