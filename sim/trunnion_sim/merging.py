"""Rows too short to be stepped: Marlin leaves a move of fewer than six steps on every axis to the next one.

`Planner::_populate_block` drops such a move without moving the planned position, so the next block makes both. Rows
that share a block share its trapezoid. What is left at the end is never made.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_sim.toolhead_kernel import Law


@dataclass(frozen=True, eq=False)
class Blocks:
    """Which rows are made together."""

    of_row: IntArray
    """(n,) block that makes the row; the number of blocks where none does."""
    first: IntArray
    """(m,) first row of every block."""
    last: IntArray
    """(m,) row that completes it."""

    @property
    def merged(self) -> bool:
        """Whether there are fewer blocks than rows."""
        return len(self.last) < len(self.of_row)

    @property
    def shared(self) -> BoolArray:
        """(n,) rows that are not a block of their own."""
        return np.append(self.first < self.last, True)[self.of_row]

    def sums(self, values: FloatArray) -> FloatArray:
        """(m, ...) sums over the rows of every block."""
        total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
        return np.asarray(total[self.last + 1] - total[self.first])

    def any(self, values: BoolArray) -> BoolArray:
        """(m,) whether it is true of any row of the block."""
        return np.asarray(self.sums(values.astype(np.float64)) > 0)


def blocks_of(counts: FloatArray, alone: BoolArray, least: float) -> Blocks:
    """Blocks of at least `least` steps on some axis out of rows of `counts` (n, c) steps; rows `alone` (n,) are one."""
    of_row, first, last = _blocks(counts, alone, least)
    return Blocks(of_row, first, last)


def laws_of_rows(law: Law, blocks: Blocks, way: FloatArray) -> Law:
    """The law of the rows from that of their blocks; `way` (n,) says how a block's length is shared out."""
    length, asked, entry, cruise, leave, acceleration, _ = (np.append(value, 0.0) for value in law)
    acceleration[-1] = 1.0
    block = blocks.of_row
    whole = np.append(blocks.sums(way), 0.0)[block]
    done = np.cumsum(way)
    before = np.concatenate([[0.0], done])[np.append(blocks.first, 0)][block]
    alone = np.append(blocks.last == blocks.first, False)[block]
    part = np.where(whole > 0, whole, 1.0)
    begin = np.where(alone, 0.0, np.clip((done - way - before) / part, 0.0, 1.0))
    end = np.where(alone, 1.0, np.clip((done - before) / part, 0.0, 1.0))
    d, a = length[block], acceleration[block]

    def speed(fraction: FloatArray) -> FloatArray:
        rising = np.sqrt(entry[block] ** 2 + 2 * a * fraction * d)
        falling = np.sqrt(leave[block] ** 2 + 2 * a * (1 - fraction) * d)
        return np.asarray(np.minimum(np.minimum(rising, falling), cruise[block]))

    v0, v1 = speed(begin), speed(end)
    mine = (end - begin) * d
    top = np.minimum(cruise[block], np.sqrt(np.maximum((2 * a * mine + v0**2 + v1**2) / 2, 0.0)))
    top = np.maximum(top, np.maximum(v0, v1))
    flat = np.maximum(mine - (2 * top**2 - v0**2 - v1**2) / (2 * a), 0.0)
    duration = np.where(mine > 0, (2 * top - v0 - v1) / a + flat / np.where(top > 0, top, 1.0), 0.0)
    return mine, asked[block], v0, top, v1, a, duration


@njit(cache=True)
def _blocks(
    counts: NDArray[np.float64], alone: NDArray[np.bool_], least: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    n, columns = counts.shape
    of_row = np.empty(n, np.int64)
    first = np.empty(n, np.int64)
    last = np.empty(n, np.int64)
    carried = np.zeros(columns)
    made = 0
    pending = 0
    for i in range(n):
        if alone[i]:
            of_row[pending:i] = -1
            carried[:] = 0.0
            pending = i
        else:
            carried += counts[i]
        if alone[i] or np.abs(carried).max() >= least:
            of_row[pending : i + 1] = made
            first[made], last[made] = pending, i
            made += 1
            pending = i + 1
            carried[:] = 0.0
    of_row[pending:] = -1
    of_row[of_row < 0] = made
    return of_row, first[:made].copy(), last[:made].copy()
