"""Nothing moves to a place before the machine knows where it is."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.context import Context

CODES = {
    "motion-before-homing": ("error", "A joint is sent to a position before it was homed."),
    "relative-before-homing": ("note", "A joint moves by some amount (G91) before it was homed."),
}


def check(context: Context) -> Iterator[Finding]:
    """Compare the joints that move on a row with those that are homed by then."""
    motion = context.motion
    bits = 1 << np.arange(len(context.profile.joints))
    moves = np.abs(motion.joints - motion.before) > 1e-9
    blind = (moves & ((motion.homed[:, None] & bits) == 0)).any(axis=1) & ~context.homing

    def message(row: int) -> str:
        unknown = moves[row] & ((motion.homed[row] & bits) == 0)
        letters = ", ".join(letter for letter, is_so in zip(context.profile.letters, unknown, strict=True) if is_so)
        return f"{letters} moves without having been homed (G28)"

    yield from context.find("motion-before-homing", "error", blind & ~motion.relative, message)
    yield from context.find("relative-before-homing", "note", blind & motion.relative, message)
