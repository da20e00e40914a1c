"""The tip stays above the bed, and beads stay on it."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.findings import Finding
from trunnion_core.profile_file import BedTable
from trunnion_sim.context import Context

CODES = {
    "nozzle-below-bed": ("error", "The tip goes below the bed's surface, within its area, at a point or on the way."),
    "bead-off-bed": ("error", "A bead of the first layer lies beside the bed."),
}

DEPTH_SLACK = 0.01
"""mm: rounding of the words, and the arc height between two looks."""
EDGE_SLACK = 0.01
"""mm."""


def check(context: Context) -> Iterator[Finding]:
    """Look along every motion, arcs that rotary joints draw included."""
    lowest = np.full(len(context.motion), np.inf)
    for stretch in context.stretches():
        over = on_bed(context.profile.bed, stretch.points[:, :2])
        np.minimum.at(lowest, stretch.rows[over], stretch.points[over, 2])
    known = ~context.homing & (context.homed | ~context.homing.any())
    yield from context.find(
        "nozzle-below-bed",
        "error",
        known & (lowest < -DEPTH_SLACK),
        lambda row: f"the tip is {-lowest[row]:.3f} mm below the bed",
        value=np.where(np.isfinite(lowest), lowest, 0.0),
        limit=0.0,
    )
    reach = 1.5 * context.layer_height
    low = context.feeds & known & (context.points[:, 2] < reach)
    off = low & ~on_bed(context.profile.bed, context.points[:, :2], EDGE_SLACK)
    yield from context.find(
        "bead-off-bed",
        "error",
        off,
        lambda row: "a bead of the first layer ends at X{:.2f} Y{:.2f} mm, beside the bed".format(*context.point(row)),
    )


def on_bed(bed: BedTable, xy: FloatArray, slack: float = 0.0) -> BoolArray:
    """(n,) whether points (n, 2) mm in `part` lie over the bed's area."""
    if bed.shape == "circle" and bed.diameter is not None:
        return np.asarray(np.hypot(xy[:, 0], xy[:, 1]) <= bed.diameter / 2 + slack)
    if bed.min is None or bed.max is None:
        raise ValueError("a rectangular bed without corners passed the profile's validation")
    return np.asarray(((xy >= np.array(bed.min) - slack) & (xy <= np.array(bed.max) + slack)).all(axis=1))
