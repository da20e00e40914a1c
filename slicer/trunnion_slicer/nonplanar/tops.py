"""Planar beads under a patch become a map of how high they stand, as stadiums: flat on top, round at both edges.

What the lowest non-planar layer has to fill is not the space over ideal stairs but over these beads: with grooves
between them, round edges at the steps, and holes where the lines of infill turn back.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray, freeze
from trunnion_core.bead import bead_area, bead_width
from trunnion_core.layers import Layer

CELLS_ACROSS = 6.0
"""Cells of the map across a bead."""

MOST_CELLS = 4_000_000
"""Cells of the map; beyond that it is made coarser."""


@dataclass(frozen=True, eq=False)
class Tops:
    """Heights over X and Y."""

    low: FloatArray
    """(2,) mm, centre of cell [0, 0]."""
    cell: float
    """mm."""
    height: FloatArray
    """(nx, ny) mm: the upper side of the highest bead; 0 where there is none."""

    def __post_init__(self) -> None:
        freeze(self.low, self.height)

    @property
    def centres(self) -> FloatArray:
        """(nx * ny, 2) mm, in the order of `height.ravel()`."""
        nx, ny = self.height.shape
        places = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1).reshape(-1, 2)
        return np.asarray(self.low + self.cell * places)


def bead_tops(layers: Sequence[Layer], low: FloatArray, high: FloatArray, width: float, groove: float) -> Tops:
    """The map of upright beads over the rectangle `low` to `high` (mm, X and Y), fine enough for beads of `width` mm.

    Of the layers only those are looked at whose plane lies between low[2] and high[2]. Beads also fill the grooves of
    the layer below, `groove` mm deep on average, and are that much higher and narrower than planned.
    """
    extent = np.maximum(high[:2] - low[:2], width)
    cell = max(width / CELLS_ACROSS, float(np.sqrt(np.prod(extent) / MOST_CELLS)))
    shape = np.ceil(extent / cell).astype(np.int64) + 1
    height = np.zeros((int(shape[0]), int(shape[1])))
    for layer in layers:
        if low[2] <= layer.z <= high[2]:
            for bead in layer.beads:
                deep = bead.height + groove
                wide = bead_width(bead_area(bead.width, bead.height), deep)
                _raise(height, low[0], low[1], cell, bead.points, wide, deep)
    return Tops(np.array(low[:2], dtype=np.float64), cell, height)


@njit(cache=True)
def _raise(
    top: FloatArray, x0: float, y0: float, cell: float, points: FloatArray, width: FloatArray, height: FloatArray
) -> None:
    """Raise the cells within half a width of the polyline to the bead's upper side."""
    nx, ny = top.shape
    for i in range(1, len(points)):
        ax, ay = points[i - 1, 0], points[i - 1, 1]
        dx, dy = points[i, 0] - ax, points[i, 1] - ay
        square = dx * dx + dy * dy
        reach, z = width[i] / 2, points[i, 2]
        edge = min(height[i] / 2, reach)
        i0 = max(0, int(np.ceil((min(ax, ax + dx) - reach - x0) / cell)))
        i1 = min(nx - 1, int(np.floor((max(ax, ax + dx) + reach - x0) / cell)))
        j0 = max(0, int(np.ceil((min(ay, ay + dy) - reach - y0) / cell)))
        j1 = min(ny - 1, int(np.floor((max(ay, ay + dy) + reach - y0) / cell)))
        for a in range(i0, i1 + 1):
            px = x0 + a * cell - ax
            for b in range(j0, j1 + 1):
                if top[a, b] >= z:
                    continue
                py = y0 + b * cell - ay
                t = min(max((px * dx + py * dy) / square, 0.0), 1.0) if square > 0 else 0.0
                inside = reach - np.sqrt((px - t * dx) ** 2 + (py - t * dy) ** 2)
                if inside <= 0:
                    continue
                drop = 0.0
                if inside < edge:
                    drop = edge - np.sqrt(edge * edge - (edge - inside) ** 2)
                top[a, b] = max(top[a, b], z - drop)
