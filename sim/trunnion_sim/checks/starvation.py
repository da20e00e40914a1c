"""The planner gets lines as fast as it uses them up."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.checks.text import FRAMING
from trunnion_sim.context import Context

CODES = {
    "planner-starved": ("warning", "Lines are used up faster than the serial port carries them: the print stutters."),
}

BITS_PER_BYTE = 10
"""On the wire: one start bit, eight data bits, one stop bit."""
ANSWER = 4
"""Bytes of the firmware's `ok` with its line end, which a host that keeps one line in flight waits for."""


def check(context: Context) -> Iterator[Finding]:
    """Time on the wire against time of motion over every stretch as long as the planner's queue."""
    motion, replay = context.motion, context.replay
    blocks = max(context.rules.least_blocks, context.profile.planner.blocks)
    if len(motion) <= blocks:
        return
    size = np.where(motion.bytes > 0, motion.bytes + FRAMING + ANSWER, 0)
    wire = size * BITS_PER_BYTE / context.profile.planner.baud
    needs = np.convolve(wire, np.ones(blocks), "full")[: len(wire)]
    has = np.convolve(replay.duration + np.nan_to_num(motion.dwell), np.ones(blocks), "full")[: len(wire)]
    starved = (needs > has) & (np.arange(len(wire)) >= blocks)
    yield from context.find(
        "planner-starved",
        "warning",
        starved,
        lambda row: (
            f"{blocks} moves last {has[row] * 1000:.0f} ms, their lines need {needs[row] * 1000:.0f} ms at "
            f"{context.profile.planner.baud} baud"
        ),
        value=needs,
        limit=has,
    )
