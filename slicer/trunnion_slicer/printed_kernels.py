"""Loops over the cells under a path: raising them, and finding the highest."""

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray


@njit(cache=True)
def raise_cells(height: FloatArray, low: FloatArray, cell: float, points: FloatArray, width: FloatArray) -> None:
    """Raise the cells within width / 2 of the polyline to its height there; samples half a cell apart."""
    for i in range(1, points.shape[0]):
        dx, dy = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        steps = int(np.ceil(np.hypot(dx, dy) / (cell / 2))) + 1
        reach = width[i] / 2
        top = max(points[i, 2], points[i - 1, 2])
        bottom = min(points[i, 2], points[i - 1, 2])
        for k in range(steps + 1):
            share = k / steps
            x, y = points[i - 1, 0] + share * dx, points[i - 1, 1] + share * dy
            z = min(top, points[i - 1, 2] + share * (points[i, 2] - points[i - 1, 2]) + (top - bottom) / steps)
            a0, a1 = _cells(x - reach, x + reach, low[0], cell, height.shape[0])
            b0, b1 = _cells(y - reach, y + reach, low[1], cell, height.shape[1])
            for a in range(a0, a1):
                for b in range(b0, b1):
                    height[a, b] = max(height[a, b], z)


@njit(cache=True)
def highest_cell(
    height: FloatArray, low: FloatArray, cell: float, start: FloatArray, end: FloatArray, radius: float
) -> float:
    """The highest of the cells within `radius` of the segment; 0 beside the grid."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    steps = int(np.ceil(np.hypot(dx, dy) / (cell / 2))) + 1
    found = 0.0
    for k in range(steps + 1):
        x, y = start[0] + k / steps * dx, start[1] + k / steps * dy
        a0, a1 = _cells(x - radius, x + radius, low[0], cell, height.shape[0])
        b0, b1 = _cells(y - radius, y + radius, low[1], cell, height.shape[1])
        for a in range(a0, a1):
            for b in range(b0, b1):
                found = max(found, height[a, b])
    return found


@njit(cache=True)
def _cells(start: float, end: float, low: float, cell: float, count: int) -> tuple[int, int]:
    """The range of cells from start to end that are on the grid."""
    return max(int(np.floor((start - low) / cell)), 0), min(int(np.floor((end - low) / cell)) + 1, count)
