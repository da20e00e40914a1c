"""Nothing moves to a place before the machine knows where it is."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.arrays import BoolArray
from trunnion_core.findings import Finding
from trunnion_sim.context import Context
from trunnion_sim.motion import Motion

CODES = {
    "motion-before-homing": ("error", "A joint is sent to a position before it was homed."),
    "relative-before-homing": ("note", "A joint moves by some amount (G91) before it was homed."),
}


def check(context: Context) -> Iterator[Finding]:
    """Compare the joints that move on a row with those that are homed by then."""
    motion = context.motion
    letters = context.profile.letters
    unknown = {letter: _moves(motion, k) & ((motion.homed >> k) & 1 == 0) for k, letter in enumerate(letters)}
    blind = np.any(list(unknown.values()), axis=0) & ~context.homing

    def message(row: int) -> str:
        return (
            f"{', '.join(letter for letter in letters if unknown[letter][row])} moves without having been homed (G28)"
        )

    yield from context.find("motion-before-homing", "error", blind & ~motion.relative, message)
    yield from context.find("relative-before-homing", "note", blind & motion.relative, message)


def _moves(motion: Motion, column: int) -> BoolArray:
    """(n,) whether one joint moves."""
    return np.asarray(np.abs(np.diff(motion.path[:, column])) > 1e-9)
