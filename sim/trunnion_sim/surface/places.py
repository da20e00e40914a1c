"""Whose place is taken: how much of the place that each bead was meant for, another bead was meant for before.

This is geometry of the program alone. A bead's place is its area / height wide, the pitch at which beads fill a layer
(`core.bead`), so that beads laid side by side share nothing, whatever plastic earlier layers had too much. Places are
marked on a height field by the plane of the nozzle's end; a bead shares the place of every other that is marked above
its own plane, or below it by less than TAKEN of its height. A bead does not share with itself, unless it comes back.
"""

import math
from collections.abc import Iterable

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_sim.surface import places_kernel
from trunnion_sim.surface.deposit import MOST_CELLS, Pieces, turned

TAKEN = 0.35
"""Of a bead's height: less room than this below its plane counts as none."""


def shared(
    stretches: Iterable[Pieces], pitch: FloatArray, height: FloatArray, low: FloatArray, high: FloatArray, cell: float
) -> FloatArray:
    """(n,) share of each row's place, over its way and across it, that was another bead's; 0 where nothing is laid.

    `pitch` (n,) and `height` (n,) in mm of each row's bead; the pieces of `stretches` name those rows. Only what lies
    over the rectangle `low` to `high` (mm, X and Y) is looked at, in cells of `cell` mm, larger ones where the
    rectangle would need more than MOST_CELLS.
    """
    corners = turned(np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = np.maximum(high - low, cell)
    cell = max(cell, math.sqrt(float(size[0] * size[1]) / MOST_CELLS))
    nx, ny = (math.ceil(float(extent) / cell) + 1 for extent in size)
    marks = np.full((ny, nx), places_kernel.NOTHING, np.float32)
    pending, state = np.zeros((places_kernel.PENDING, 12)), np.zeros(2, np.int64)
    taken, way = np.zeros(len(pitch)), np.zeros(len(pitch))
    for stretch in stretches:
        places_kernel.run(
            marks,
            float(low[0]),
            float(low[1]),
            cell,
            turned(stretch.start),
            turned(stretch.end),
            turned(stretch.tool_axes),
            (stretch.volume > 0) & stretch.present,
            stretch.row,
            pitch / 2,
            TAKEN * height,
            pending,
            state,
            taken,
            way,
        )
    return np.divide(taken, way, out=np.zeros(len(pitch)), where=way > 0)
