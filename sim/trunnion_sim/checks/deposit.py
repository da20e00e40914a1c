"""Beads lie on something and in a place of their own, and travels go around what is printed."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.bead import bead_area
from trunnion_core.findings import Finding
from trunnion_sim.context import Context
from trunnion_sim.openings import openings

CODES = {
    "bead-in-air": ("error", "A whole bead has nothing below it and nothing beside it."),
    "hanging-bead": ("warning", "A short bead touches nothing, within an opening of what is printed; it droops."),
    "long-bridge": ("warning", "A long stretch of a bead hangs in the air."),
    "bead-over-bead": ("error", "A bead is laid where there is a bead already."),
    "crowded-bead": ("warning", "A bead has less than half the room that it was meant for."),
    "travel-through-print": ("error", "The tip travels through what is printed."),
}

Floats = NDArray[np.floating[Any]]

SHORTEST = 2.0
"""mm of bead that is worth a finding."""
OPENING = 6.0
"""mm between what stands on either side: a thread no longer than this that drops there is caught by one of them, as in
the openings of sparse infill over which slicers start their solid layers."""
BRIDGE = 20.0
"""mm that ordinary filament bridges with ease."""
LONGEST_DOUBLE = 10.0
"""mm: seams, corners and the joints of infill along a wall overlap for shorter stretches in every slicer's programs."""
OVER, CROWDED = 0.6, 0.5
"""Share of a bead's place that another bead was laid in before; of thin beads, which slicers lay on purpose where there
is little room, the less the thinner they are."""
DIP = 0.4
"""Of a layer height: how far a travel may dip into the round top of a bead that stands a little proud."""


def check(context: Context) -> Iterator[Finding]:
    """Read what the deposit noted on every row."""
    deposit = context.deposit
    if deposit is None:
        return
    bead: IntArray = np.cumsum(~context.feeds, dtype=np.int64)
    meant = context.feeds & ~context.priming
    laid, rests = _sum(bead, deposit.laid), _sum(bead, deposit.laid - deposit.unsupported)
    # a bridge rests on something with half a bead's width at either end at least; nothing rests on hardly anything
    whole = ((rests < context.bead_width) | ((rests < 0.05 * laid) & (laid > 2 * BRIDGE))) & (laid > SHORTEST)
    in_air = whole[bead] & meant & (deposit.laid > 0)
    across = openings(context, bead, in_air, in_air | (deposit.laid == 0), OPENING)
    inside = across <= OPENING
    yield from context.find(
        "hanging-bead",
        "warning",
        inside,
        lambda row: f"{laid[bead[row]]:.3g} mm of bead touch nothing in an opening {across[row]:.2g} mm across",
        value=across,
        limit=OPENING,
    )
    yield from context.find(
        "bead-in-air",
        "error",
        in_air & ~inside,
        lambda row: f"a bead of {laid[bead[row]]:.3g} mm has nothing below it ({deposit.gap[row]:.2f} mm) or beside it",
        value=np.nan_to_num(deposit.gap),
        limit=context.layer_height,
    )
    loose = (deposit.unsupported > 0.9 * deposit.laid) & (deposit.laid > 0) & meant
    span = _run_length(loose, deposit.laid)
    yield from context.find(
        "long-bridge",
        "warning",
        loose & (span > BRIDGE) & ~in_air,
        lambda row: f"{span[row]:.3g} mm of bead hang in the air",
        value=span,
        limit=BRIDGE,
    )
    volume = context.laid * context.profile.filament_area
    share = np.where(meant, context.shared_places(), 0.0) * _thickness(context, volume)
    double = _run_length(share > OVER, deposit.laid) > LONGEST_DOUBLE

    def message(row: int) -> str:
        return f"{min(share[row], 1):.0%} of the bead's place is taken by another bead"

    yield from context.find("bead-over-bead", "error", double, message, value=share, limit=OVER)
    crowded = (_run_length(share > CROWDED, deposit.laid) > SHORTEST) & ~double
    yield from context.find("crowded-bead", "warning", crowded, message, value=share, limit=CROWDED)
    deep = deposit.depth > DIP * context.layer_height
    yield from context.find(
        "travel-through-print",
        "error",
        deep,
        lambda row: (
            f"a travel dips {deposit.depth[row]:.3f} mm into what is printed at X{{:.2f}} Y{{:.2f}} Z{{:.2f}}".format(
                *deposit.depth_point[row]
            )
        ),
        value=deposit.depth,
        limit=DIP * context.layer_height,
    )


def _thickness(context: Context, volume: FloatArray) -> FloatArray:
    """(n,) section of each row's bead over that of the program's ordinary ones, at most 1."""
    ordinary = bead_area(np.array(context.bead_width), np.array(context.layer_height))
    whole = ordinary * context.tip_length
    return np.asarray(np.clip(np.divide(volume, whole, out=np.ones(len(whole)), where=whole > 0), 0.0, 1.0))


def _sum(group: IntArray, values: Floats) -> FloatArray:
    return np.asarray(np.bincount(group, weights=values), dtype=np.float64)


def _run_length(mask: BoolArray, length: Floats) -> FloatArray:
    """(n,) summed `length` of the run of true rows that each true row belongs to; 0 elsewhere."""
    run: IntArray = np.cumsum(np.diff(mask, prepend=False), dtype=np.int64)
    return np.where(mask, _sum(run, length)[run] if len(run) else 0.0, 0.0)
