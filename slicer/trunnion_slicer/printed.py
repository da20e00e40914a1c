"""How high the printed part stands so far, over a grid seen from above."""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.layers import Bead

CELL = 0.5
"""mm. Width of a cell: about a bead."""


class PrintedHeights:
    """The highest printed point of every cell; grows as beads are added, empty cells are at the bed (z = 0)."""

    def __init__(self, low: FloatArray, high: FloatArray) -> None:
        """low, high (2,) mm bound every bead, with its width."""
        self._low = np.floor(np.asarray(low, dtype=np.float64) / CELL) * CELL - CELL
        shape = np.ceil((high - self._low) / CELL).astype(np.int64) + 1
        self._height = np.zeros((int(shape[0]), int(shape[1])))

    def add(self, bead: Bead) -> None:
        """Raise every cell that the bead covers to its points: cells within half its width of the centre line."""
        from trunnion_slicer.printed_kernels import raise_cells

        raise_cells(self._height, self._low, CELL, bead.points, bead.width)

    def highest(self, start: FloatArray, end: FloatArray, radius: float) -> float:
        """The highest point printed within `radius` mm of the straight way from start to end, seen from above."""
        from trunnion_slicer.printed_kernels import highest_cell

        return float(highest_cell(self._height, self._low, CELL, start, end, radius))
