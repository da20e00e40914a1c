"""Plastic comes where the tip moves, and only there."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.context import Context

CODES = {
    "extrusion-at-rest": ("error", "Plastic is pushed out while the tip stands still over the part."),
    "purge-at-rest": ("note", "Plastic is pushed out at rest before the first bead."),
    "bead-without-plastic": ("error", "The program says a bead is laid, but nothing is extruded."),
    "extruding-travel": ("error", "The program says a travel, but plastic is extruded."),
}

SPILL = 0.05
"""mm of filament beyond what was retracted: rounding of retractions, and what some slicers add on purpose."""
SHORT = 0.5
"""mm of tip travel without plastic that a bead may have: words of E are rounded."""


def check(context: Context) -> Iterator[Finding]:
    """Follow how much is retracted, and compare motion, plastic and roles."""
    motion = context.motion
    total = np.cumsum(motion.filament)
    before = total - motion.filament
    peak = np.maximum.accumulate(np.maximum(before, 0.0)) if len(before) else before
    retracted = np.maximum(peak - before, 0.0)
    still = (context.tip_length < 1e-6) & ~context.homing
    spilled = np.where(still, motion.filament - retracted, 0.0)
    first = int(np.argmax(context.feeds)) if context.feeds.any() else len(total)
    early = np.arange(len(total)) < first
    yield from context.find(
        "extrusion-at-rest",
        "error",
        (spilled > SPILL) & ~early,
        lambda row: f"{spilled[row]:.3g} mm of filament are extruded at rest, beyond what was retracted",
        value=spilled,
        limit=0.0,
    )
    yield from context.find(
        "purge-at-rest",
        "note",
        (spilled > SPILL) & early,
        lambda row: f"{spilled[row]:.3g} mm of filament are extruded at rest before the first bead",
        value=spilled,
        limit=0.0,
    )
    if not context.rows.own_roles:
        return
    dry = context.rows.bead & context.moved & ~context.homing & (context.laid <= 0)
    yield from context.find(
        "bead-without-plastic",
        "error",
        dry & (context.tip_length > SHORT),
        lambda row: f"a bead of {context.tip_length[row]:.3g} mm ({context.role_text(row)}) has no plastic",
    )
    stringing = (context.rows.role >= 0) & ~context.rows.bead & context.feeds & (context.tip_length > SHORT)
    yield from context.find(
        "extruding-travel",
        "error",
        stringing,
        lambda row: f"{motion.filament[row]:.3g} mm of filament are extruded on a {context.role_text(row)}",
        value=motion.filament,
        limit=0.0,
    )
