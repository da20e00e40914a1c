"""Lines of a G-code file become the commands that go over the wire: no comments, no blanks, no numbers of their own."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from trunnion_core.errors import StreamError

MAX_LINE = 95
"""Bytes of a line with number and checksum, without its newline: one below Marlin's MAX_CMD_SIZE."""
NUMBERED = re.compile(r"^N\d+\s*")
CHECKSUM = re.compile(r"\s*\*\d+$")


@dataclass(frozen=True)
class Commands:
    """Command i stands in line `source[i]` (from 1) of the file."""

    text: tuple[str, ...]
    source: tuple[int, ...]


def commands(lines: Iterable[str]) -> Commands:
    """Strip every line. StreamError names a line that the wire cannot carry safely.

    A line that is too long is truncated by the firmware, loses its checksum and is asked for again for ever; a line
    that holds M110 changes the numbering that everything rests on.
    """
    text: list[str] = []
    source: list[int] = []
    for index, line in enumerate(lines, 1):
        command = line.partition(";")[0].strip()
        if command[:1] == "N":
            command = CHECKSUM.sub("", NUMBERED.sub("", command))
        if not command:
            continue
        text.append(command)
        source.append(index)
    digits = len(str(2 * len(text) + 100))
    room = MAX_LINE - len("N *255") - digits
    for index, command in zip(source, text, strict=True):
        if len(command) > room:
            raise StreamError(f"line {index}: {len(command)} characters, the firmware takes {room}: {command[:40]}...")
        if not (command.isascii() and command.isprintable()):
            raise StreamError(f"line {index}: '{command[:40]}' is not plain ASCII, which firmware needs")
        if "M110" in command:
            raise StreamError(f"line {index}: M110 changes the line numbers of the stream; take it out of the file")
        if "*" in command:
            raise StreamError(f"line {index}: '*' begins a checksum and cannot stand in '{command[:40]}'")
    return Commands(tuple(text), tuple(source))
