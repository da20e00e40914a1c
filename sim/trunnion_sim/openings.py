"""How wide the openings are that beads hang in which touch nothing."""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_sim.context import Context

SECTORS = 12
"""Directions, each with its opposite, in which something may stand."""
BEFORE = 100_000
"""Rows before a bead among which what stands around it is looked for: a layer or two."""
MOST = 500
"""Beads that are looked at; a program with more in the air is wrong anyway, and the rest counts as open."""
BELOW, ABOVE = 1.5, 0.5
"""Layer heights: what ends between here and there stands at the height of the bead."""


def openings(context: Context, bead: IntArray, hangs: BoolArray, without: BoolArray, widest: float) -> FloatArray:
    """(n,) mm between what stands on either side of a row's bead, in the direction where that is least.

    Of rows that hang (n,) only; infinite elsewhere, where nothing stands on two opposite sides, and for beads that
    reach over more than `widest` mm themselves. `bead` (n,) numbers the beads, rising; rows `without` (n,) are no
    support.
    """
    across = np.full(len(bead), np.inf)
    rows = np.flatnonzero(hangs)
    if not rows.size:
        return across
    firsts = np.flatnonzero(np.diff(bead[rows], prepend=-1))
    lasts = np.append(firsts[1:], len(rows))
    for first, last in zip(firsts[:MOST].tolist(), lasts[:MOST].tolist(), strict=True):
        across[rows[first:last]] = _across(context, rows[first:last], without, widest)
    return across


def _across(context: Context, of_bead: IntArray, without: BoolArray, widest: float) -> float:
    ends = np.concatenate([context.tips[of_bead], context.tips[of_bead + 1]])
    low, high = ends.min(axis=0), ends.max(axis=0)
    if np.linalg.norm(high[:2] - low[:2]) > widest:
        return np.inf
    first = max(0, int(of_bead[0]) - BEFORE)
    begin, end = context.tips[first : of_bead[0]], context.tips[first + 1 : of_bead[0] + 1]
    lowest, highest = low[2] - BELOW * context.layer_height, high[2] + ABOVE * context.layer_height
    top = np.maximum(begin[:, 2], end[:, 2])
    stands = ~without[first : of_bead[0]] & (lowest <= top) & (top <= highest)
    begin, way = begin[stands, :2], end[stands, :2] - begin[stands, :2]
    middle = (low[:2] + high[:2]) / 2
    length = np.maximum((way**2).sum(axis=1), 1e-12)
    share = np.clip(((middle - begin) * way).sum(axis=1) / length, 0.0, 1.0)
    to = begin + share[:, None] * way - middle
    sector = np.floor(np.arctan2(to[:, 1], to[:, 0]) / (2 * np.pi) * SECTORS).astype(np.int64) % SECTORS
    nearest = np.full(SECTORS, np.inf)
    np.minimum.at(nearest, sector, np.linalg.norm(to, axis=1))
    return float((nearest + np.roll(nearest, SECTORS // 2)).min())
