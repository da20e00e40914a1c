"""The file is whole, and the firmware understands every line of it."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding, Severity
from trunnion_core.validation import nearest
from trunnion_sim import reader_kernel as reading
from trunnion_sim.context import Context
from trunnion_sim.motion import code_name

CODES: dict[str, tuple[Severity, str]] = {
    "torn-file": ("error", "The last line ends in the middle of a word or of a motion: the file is not whole."),
    "no-final-newline": ("warning", "The last line does not end in a newline; hosts may drop or join it."),
    "unknown-command": ("error", "A command that the firmware does not know; it would be ignored."),
    "unknown-word": ("error", "A word on a motion that is no joint of this machine."),
    "unreadable": ("error", "Bytes that are no G-code."),
    "bad-number": ("error", "A number that is malformed, or too large to be meant."),
    "bare-word": ("error", "A letter without a number on a motion."),
    "repeated-word": ("error", "The same word twice in a line; firmwares disagree about which one counts."),
    "bad-checksum": ("error", "A line whose checksum does not match; the firmware would ask for it again and again."),
    "line-too-long": ("error", "A line that the firmware's buffer cannot hold; it would lose its end."),
    "bad-arc": ("error", "An arc that cannot be drawn; the firmware would skip it."),
}

FRAMING = len("N1234567 *123")
"""Bytes that a host adds to a line."""
ENDLESS = 20
"""Findings of one kind about single lines; the last stands for the rest."""


def check(context: Context) -> Iterator[Finding]:
    """From the flags of the reader, the commands seen and the end of the file."""
    yield from _end(context)
    yield from _commands(context)
    yield from _words(context)
    flags, lines = context.oddities.flags, context.oddities.lines
    named = {
        "unreadable": (reading.BINARY | reading.JUNK | reading.NO_COMMAND, "holds what is no G-code"),
        "bad-number": (reading.HUGE | reading.MALFORMED, "has a number that is malformed or too large"),
        "repeated-word": (reading.REPEATED, "has the same word twice"),
        "bad-checksum": (reading.BAD_CHECKSUM, "has a checksum that does not match"),
    }
    for code, (bits, text) in named.items():
        yield from _each(code, lines[(flags & bits) > 0].tolist(), text)
    for reason, at in context.motion.dropped.items():
        if "arc" in reason:
            yield from _each("bad-arc", at, f"has {reason}")
    room = context.rules.max_line - FRAMING
    line, longest = context.oddities.longest
    if longest > room:
        yield Finding(
            "line-too-long",
            "error",
            f"line {line} has {longest} bytes, with number and checksum the firmware takes {room}",
            line=line,
            value=float(longest),
            limit=float(room),
        )


def _end(context: Context) -> Iterator[Finding]:
    if context.end.newline:
        return
    line = context.end.lines
    text = context.end.last_text.split(b";")[0].rstrip()
    comment = not text and b";" in context.end.last_text
    last_odd = context.oddities.flags[context.oddities.lines == line]
    cut = bool(len(last_odd) and last_odd[-1] & (reading.BARE | reading.MALFORMED | reading.OVERLONG))
    moves = len(context.motion) > 0 and int(context.motion.line[-1]) == line
    if not comment and (cut or moves or text[-1:] in (b".", b"-")):
        shown = text[-40:].decode("utf-8", "replace")
        yield Finding("torn-file", "error", f"line {line} is torn: it ends in '{shown}' without a newline", line=line)
    else:
        yield Finding("no-final-newline", "warning", f"line {line}, the last one, has no newline", line=line)


def _commands(context: Context) -> Iterator[Finding]:
    known = {code_name(letter, code) for letter, code in context.rules.commands}
    for (letter, code), line in sorted(context.motion.code_first_line.items(), key=lambda item: item[1]):
        if (letter, code) in context.rules.commands:
            continue
        count = context.motion.code_count[letter, code]
        name = code_name(letter, code)
        hint = nearest(name, known)
        more = f" ({count} times)" if count > 1 else ""
        text = f"{name} is unknown to {context.rules.name}{more}" + (f", {hint}" if hint.startswith("did") else "")
        yield Finding("unknown-command", "error", text, line=line, count=count)
    flags, lines = context.oddities.flags, context.oddities.lines
    named = [command.line for command in context.motion.commands if command.code < 0]
    strange = ((flags & reading.NAMED) > 0) & ~np.isin(lines, named)
    if context.rules.case_sensitive:
        strange |= (flags & reading.LOWER) > 0
    yield from _each("unknown-command", lines[strange].tolist(), f"is no command that {context.rules.name} knows")


def _words(context: Context) -> Iterator[Finding]:
    allowed = set(context.profile.letters) | {context.rules.filament, "F", "S"}
    if any(code in (20, 30) for letter, code in context.motion.code_count if letter == "G"):
        allowed |= set("IJKRP")
    for letter, line in sorted(context.oddities.letters.items(), key=lambda item: item[1]):
        if letter not in allowed:
            yield Finding(
                "unknown-word",
                "error",
                f"line {line} moves {letter}, the machine's joints are {', '.join(context.profile.letters)}",
                line=line,
                axis=letter,
            )
    moves = np.isin(context.oddities.lines, context.motion.line)
    bare = moves & ((context.oddities.flags & reading.BARE) > 0)
    homing = np.isin(context.oddities.lines, context.motion.line[context.homing])
    yield from _each("bare-word", context.oddities.lines[bare & ~homing].tolist(), "has a letter without a number")


def _each(code: str, lines: list[int], text: str) -> Iterator[Finding]:
    """A finding for each of the first lines, the last of them for all the rest."""
    severity = CODES[code][0]
    for line in lines[:ENDLESS]:
        yield Finding(code, severity, f"line {line} {text}", line=line)
    rest = lines[ENDLESS:]
    if rest:
        yield Finding(code, severity, f"line {rest[0]} {text}, and {len(rest) - 1} more", line=rest[0], count=len(rest))
