"""Modes that were surely not meant: relative words in a print, zeros that move, an extruder mode that G90 undid."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
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
    motion, profile = context.motion, context.profile
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
    undone = None
    mode = None
    for command in motion.commands:
        if command.name in ("M82", "M83"):
            mode, undone = command.name, None
        elif command.name in ("G90", "G91") and context.rules.g90_resets_e and mode is not None:
            sets = "M82" if command.name == "G90" else "M83"
            undone = command if sets != mode else None
        elif command.name == "G92":
            for joint in profile.joints:
                value = command.get(joint.letter)
                if value is None:
                    continue
                code = "rotary-reset" if joint.rotary else "offset"
                if joint.rotary:
                    yield Finding(
                        code, "error", f"G92 calls the present {joint.letter} {value:g} degrees",
                        line=command.line, axis=joint.letter, value=value,
                    )  # fmt: skip
                else:
                    yield Finding(
                        code, "warning", f"G92 calls the present {joint.letter} {value:g} mm",
                        line=command.line, axis=joint.letter, value=value,
                    )  # fmt: skip
        if undone is not None and command is undone and context.feeds[command.row :].any():
            text = f"{command.name} undoes {mode}: plastic is now fed {'absolutely' if mode == 'M83' else 'relatively'}"
            later = [other for other in motion.commands if other.line > command.line and other.name in ("M82", "M83")]
            fed = np.flatnonzero(context.feeds[command.row :])[0] + command.row
            if not later or later[0].row > fed:
                yield Finding("extruder-mode-undone", "warning", text, line=command.line, row=command.row)
