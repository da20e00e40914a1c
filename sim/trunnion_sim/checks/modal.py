"""Modes that were surely not meant: relative words in a print, zeros that move, an extruder mode that G90 undid."""

from collections.abc import Iterator
from itertools import zip_longest

import numpy as np

from trunnion_core.findings import Finding, Severity
from trunnion_sim.context import Context

CODES = {
    "relative-printing": ("error", "Beads are laid while G91 makes axis words relative: probably left on by mistake."),
    "rotary-reset": ("error", "G92 gives a rotary another zero: poses no longer mean what the profile says."),
    "offset": ("warning", "G92 shifts a linear axis: positions no longer are those of the machine."),
    "extruder-mode-undone": (
        "warning",
        "G90 or G91 after M82 or M83 also sets the extruder's mode in this firmware, and nothing sets it again.",
    ),
    "inverse-time-unknown": ("error", "G93 is used, but the firmware has no inverse time."),
}


def check(context: Context) -> Iterator[Finding]:
    """Look at the modes of rows and at the commands that change them."""
    motion = context.motion
    yield from context.find(
        "relative-printing",
        "error",
        motion.relative & context.feeds,
        lambda row: "a bead is laid with relative axis words (G91)",
    )
    if motion.inverse.any() and not context.rules.inverse_time:
        row = int(np.argmax(motion.inverse))
        text = f"F is read as inverse time (G93), which {context.rules.name} does not know"
        yield Finding("inverse-time-unknown", "error", text, line=int(motion.line[row]), row=row)
    yield from _offsets(context)
    if context.rules.g90_resets_e:
        yield from _undone(context)


def _offsets(context: Context) -> Iterator[Finding]:
    """One finding for every joint that G92 gives another zero, with how often it does."""
    commands = [command for command in context.motion.commands if command.name == "G92"]
    for joint in context.profile.joints:
        here = [command for command in commands if command.get(joint.letter) is not None]
        if not here:
            continue
        value = here[0].get(joint.letter)
        code, unit = ("rotary-reset", "degrees") if joint.rotary else ("offset", "mm")
        severity: Severity = "error" if joint.rotary else "warning"
        text = f"G92 calls the present {joint.letter} {value:g} {unit}"
        if len(here) > 1:
            text += f" ({len(here)} times, the first of them here)"
        yield Finding(code, severity, text, line=here[0].line, axis=joint.letter, value=value, count=len(here))


def _undone(context: Context) -> Iterator[Finding]:
    """The first G90 or G91 that undoes the mode that M82 or M83 set, and after which plastic is fed all the same."""
    modes = [command for command in context.motion.commands if command.name in ("G90", "G91", "M82", "M83")]
    mode = None
    for command, later in zip_longest(modes, modes[1:]):
        if command.name in ("M82", "M83"):
            mode = command.name
        elif mode is not None and mode != ("M82" if command.name == "G90" else "M83"):
            end = len(context.feeds) if later is None else later.row
            if context.feeds[command.row : end].any():
                fed = "absolutely" if mode == "M83" else "relatively"
                text = f"{command.name} undoes {mode}: plastic is now fed {fed}"
                yield Finding("extruder-mode-undone", "warning", text, line=command.line, row=command.row)
                return
