"""The tip moves over the part as fast as wanted: never faster, seldom much slower."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.context import Context

CODES = {
    "tip-too-fast": ("error", "The tip moves over the part faster than wanted while printing."),
    "tip-too-slow": ("warning", "A large part of the printing time passes at less than half the wanted tip speed."),
}

FAST = 1.1
"""Ratio of tip speed to wanted speed that is too fast: flow and cooling follow it."""
FAST_BY = 1.0
"""mm/s on top, for slow moves whose F is rounded."""
SLOW = 0.5
SLOW_SHARE = 0.3
"""Share of the printing time below SLOW that is worth a word: corners alone stay below it."""


def check(context: Context) -> Iterator[Finding]:
    """Tip speed from the replayed time law against the wanted speed that the comments name, each row by itself.

    Nothing is averaged over neighbours: words of any length have an F that gives the tip its speed.
    """
    wanted = context.rows.speed
    rows = context.feeds & np.isfinite(wanted) & (wanted > 0) & (context.replay.length > 0)
    if not rows.any():
        return
    length = context.driven_length
    per_length = length / np.where(context.replay.length > 0, context.replay.length, 1.0)
    fastest = per_length * context.replay.cruise
    limit = wanted * FAST + FAST_BY
    yield from context.find(
        "tip-too-fast",
        "error",
        rows & (fastest > limit),
        lambda row: f"the tip moves at {fastest[row]:.4g} mm/s over the part, wanted were {wanted[row]:g}",
        value=fastest,
        limit=np.where(rows, wanted, 0.0),
    )
    duration = context.replay.duration
    mean = np.divide(context.tip_length, duration, out=np.zeros(len(duration)), where=duration > 0)
    slow = rows & (mean < SLOW * wanted)
    share = float(duration[slow].sum() / max(duration[rows].sum(), 1e-9))
    if share > SLOW_SHARE:
        worst = int(np.flatnonzero(slow)[np.argmin((mean / np.where(rows, wanted, 1.0))[slow])])
        yield Finding(
            "tip-too-slow",
            "warning",
            f"{share:.0%} of the printing time passes at less than half the wanted tip speed; slowest is "
            f"{mean[worst]:.3g} mm/s where {wanted[worst]:g} were wanted",
            line=int(context.motion.line[worst]),
            row=worst,
            layer=context.layer(worst),
            value=share,
            limit=SLOW_SHARE,
            point=context.point(worst),
            count=int(slow.sum()),
        )
