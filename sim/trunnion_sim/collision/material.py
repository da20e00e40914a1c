"""What stands on the bed at one moment: a height over every cell, with the highest of every block and tile.

A bead raises the cells under it to its upper surface, a stadium's: flat over width minus height, round at the edges.
"""

import math
from typing import Any

from numba import njit

from trunnion_sim.collision.field import BLOCK, CELL


@njit(cache=True)
def raise_bead(field: Any, start: Any, end: Any, axis: Any, width: Any, height: Any) -> Any:
    """Lay one bead from start to end (tip positions, `part`), as wide and high as told; updates the three grids."""
    cells, blocks, tiles, corner = field.cells, field.blocks, field.tiles, field.corner
    cell, block = CELL, BLOCK
    ux, uy, uz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    if length < 1e-9 or width <= 0.0:
        return
    # side = direction x axis, both unit; the bead's upper plane is start + along*direction + across*side
    sx, sy, sz = uy * axis[2] - uz * axis[1], uz * axis[0] - ux * axis[2], ux * axis[1] - uy * axis[0]
    long = math.sqrt(sx * sx + sy * sy + sz * sz)
    if long < 1e-9:
        return
    sx, sy, sz = sx / long, sy / long, sz / long
    ux, uy, uz = ux / length, uy / length, uz / length
    determinant = ux * sy - uy * sx
    if abs(determinant) < 0.05:
        return
    half = width / 2.0
    flat = max(half - height / 2.0, 0.0)
    reach = half
    low_x, high_x = min(start[0], end[0]) - reach, max(start[0], end[0]) + reach
    low_y, high_y = min(start[1], end[1]) - reach, max(start[1], end[1]) + reach
    nx, ny = cells.shape
    first_x = max(math.ceil((low_x - corner[0]) / cell), 0)
    last_x = min(math.floor((high_x - corner[0]) / cell), nx - 1)
    first_y = max(math.ceil((low_y - corner[1]) / cell), 0)
    last_y = min(math.floor((high_y - corner[1]) / cell), ny - 1)
    for i in range(first_x, last_x + 1):
        x = corner[0] + i * cell - start[0]
        for j in range(first_y, last_y + 1):
            y = corner[1] + j * cell - start[1]
            along = (x * sy - y * sx) / determinant
            across = (ux * y - uy * x) / determinant
            beyond = max(-along, along - length, 0.0)
            off = math.sqrt(across * across + beyond * beyond)
            if off > half:
                continue
            drop = 0.0
            if off > flat and height > 0.0:
                radius = height / 2.0
                drop = radius - math.sqrt(max(radius * radius - (off - flat) ** 2, 0.0))
            inside = min(max(along, 0.0), length)
            z = start[2] + inside * uz + across * sz - drop
            if z > cells[i, j]:
                cells[i, j] = z
                bi, bj = i // block, j // block
                if z > blocks[bi, bj]:
                    blocks[bi, bj] = z
                    ti, tj = bi // block, bj // block
                    if z > tiles[ti, tj]:
                        tiles[ti, tj] = z
