"""The loop that marks the places of beads and counts what of them is marked already: see `places`.

A bead is followed in steps. A step counts the marks across its place and marks its own only when the tip has gone on
by OWN half widths, or when the bead ends: until then its marks wait in a ring.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_sim.surface.deposit_kernel import STEEPEST, frame_of
from trunnion_sim.surface.draw_kernel import Frame

_F = NDArray[np.float64]
_G = NDArray[np.float32]
_I = NDArray[np.int64]

NOTHING = -1e9
"""mm: height of a cell that is nobody's place."""
OWN = 3.0
"""Half widths behind the tip in which a bead does not meet itself."""
PENDING = 256
"""Steps that wait at most."""
STEP = 0.7
"""Cells a step; samples across it are STEP cells apart too, so that none is left out."""


@njit(cache=True)
def run(
    marks: _G,
    x0: float,
    y0: float,
    cell: float,
    starts: _F,
    ends: _F,
    axes: _F,
    lays: NDArray[np.bool_],
    rows: _I,
    half: _F,
    near: _F,
    pending: _F,
    state: _I,
    taken: _F,
    way: _F,
) -> None:
    """Follow pieces; adds to taken (n,) and way (n,) share x length and length of every row.

    `half` and `near` (n,) are half widths of the rows' places and the room below their plane that counts as none.
    `pending` (PENDING, 12) holds steps not marked yet, from number state[0] to state[1] - 1.
    """
    for m in range(len(rows)):
        length, frame = frame_of(starts[m], ends[m], axes[m])
        row = rows[m]
        goes_on = m == 0 or (
            lays[m - 1]
            and abs(starts[m, 0] - ends[m - 1, 0])
            + abs(starts[m, 1] - ends[m - 1, 1])
            + abs(starts[m, 2] - ends[m - 1, 2])
            < 1e-6
        )
        if not (lays[m] and goes_on):
            _mark_until(marks, x0, y0, cell, pending, state, state[1])
        if not lays[m] or length < 1e-9 or frame.nz < STEEPEST or half[row] <= 0:
            continue
        count = math.ceil(length / (STEP * cell))
        size = length / count
        wait = min(PENDING - 1, math.ceil(OWN * half[row] / size))
        for s in range(count):
            at = (s + 0.5) * size
            x, y, z = starts[m, 0] + at * frame.tx, starts[m, 1] + at * frame.ty, starts[m, 2] + at * frame.tz
            _mark_until(marks, x0, y0, cell, pending, state, state[1] - wait)
            taken[row] += size * _count(marks, x0, y0, cell, x, y, z, frame, half[row], near[row])
            way[row] += size
            slot = pending[state[1] % PENDING]
            slot[0], slot[1], slot[2], slot[3], slot[4] = x, y, z, size / 2, half[row]
            slot[5], slot[6], slot[7] = frame.tx, frame.ty, frame.tz
            slot[8], slot[9], slot[10], slot[11] = frame.bx, frame.by, frame.bz, frame.nz
            state[1] += 1


@njit(cache=True)
def _count(
    marks: _G, x0: float, y0: float, cell: float, x: float, y: float, z: float, frame: Frame, half: float, near: float
) -> float:
    """Share of the places across the path at a point that is marked; outside the field nothing is."""
    ny, nx = marks.shape
    samples = math.ceil(2 * half / (STEP * cell))
    hits = 0
    for k in range(samples):
        u = (2 * (k + 0.5) / samples - 1) * half
        i, j = round((x + u * frame.bx - x0) / cell), round((y + u * frame.by - y0) / cell)
        if 0 <= i < nx and 0 <= j < ny:
            dx, dy = x0 + i * cell - x, y0 + j * cell - y
            v, u = (dx * frame.by - dy * frame.bx) / frame.nz, (frame.tx * dy - frame.ty * dx) / frame.nz
            hits += (z + v * frame.tz + u * frame.bz - marks[j, i]) * frame.nz < near
    return hits / samples


@njit(cache=True)
def _mark_until(marks: _G, x0: float, y0: float, cell: float, pending: _F, state: _I, until: int) -> None:
    """Mark the steps that wait, up to number `until`: cells whose centre lies in their slab."""
    ny, nx = marks.shape
    while state[0] < until:
        x, y, z, along, half, tx, ty, tz, bx, by, bz, nz = pending[state[0] % PENDING]
        state[0] += 1
        wide = half + cell
        reach_x, reach_y = abs(tx) * along + abs(bx) * wide, abs(ty) * along + abs(by) * wide
        for j in range(
            max(0, math.ceil((y - reach_y - y0) / cell)), min(ny - 1, math.floor((y + reach_y - y0) / cell)) + 1
        ):
            dy = y0 + j * cell - y
            for i in range(
                max(0, math.ceil((x - reach_x - x0) / cell)), min(nx - 1, math.floor((x + reach_x - x0) / cell)) + 1
            ):
                dx = x0 + i * cell - x
                v, u = (dx * by - dy * bx) / nz, (tx * dy - ty * dx) / nz
                if abs(u) < half and abs(v) <= along + 1e-6:
                    marks[j, i] = max(marks[j, i], z + v * tz + u * bz)
