"""Put a slab of a bead, or the disc that closes the outside of a corner, onto the grid, and measure what it added."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_sim.surface.section_kernel import SAME_LAYER, Section, drop

_F = NDArray[np.float64]
_G = NDArray[np.float32]

DEEPER = 1.05
"""Of the height: what is deeper beside a bead is a slit in the air, which a web closes."""
SEAM = 1e-6
"""mm by which slabs overlap, so that rounding leaves no cell between them."""


class Grid(NamedTuple):
    """What is there, in cells over X and Y; arrays are (ny, nx), heights and lengths in mm."""

    x: float
    """Centre of cell [0, 0]."""
    y: float
    cell: float
    material: _G
    """Upper surface of the plastic: what later beads lie on."""
    surface: _G
    """The same with the grooves between round beads open: what is compared with the model."""
    before: _G
    """`material` before the bead that is being laid came by."""
    pores: _G
    """Pore under the round edge of the topmost bead, which a neighbour can fill."""
    bulge: _G
    """How much of the surface rose behind the nozzle."""
    stamp: NDArray[np.int32]
    """The step that came by last."""


class Frame(NamedTuple):
    """Where a piece goes: `along` the path, `across` it and level with the nozzle's end; nz, the Z of their normal."""

    tx: float
    ty: float
    tz: float
    bx: float
    by: float
    bz: float
    nz: float


@njit(cache=True)
def draw(
    grid: Grid,
    x: float,
    y: float,
    z: float,
    frame: Frame,
    along: float,
    mitre_start: float,
    mitre_end: float,
    disc: bool,
    bead: Section,
    step: int,
    own: int,
) -> tuple[float, bool]:
    """Lay a slab of half length `along` about a point of the path; mm³ added, and whether the field cuts it off.

    A mitre is the tangent of half the angle by which the path turns at that end, positive for a turn to the left: the
    slab ends on the bisector, so that neighbours neither overlap nor leave a wedge. Cells that steps after `own` came
    by hold this very bead. A `disc` is as wide as the narrower side of the bead.
    """
    ny, nx = grid.material.shape
    cell = grid.cell
    widest = max(bead.front_right, bead.front_left, bead.web_right, bead.web_left)
    radius = min(bead.round_right, bead.round_left)
    reach = along + max(abs(mitre_start), abs(mitre_end)) * widest
    reach_x = SEAM + (radius if disc else abs(frame.tx) * reach + abs(frame.bx) * widest)
    reach_y = SEAM + (radius if disc else abs(frame.ty) * reach + abs(frame.by) * widest)
    i0, i1 = math.ceil((x - reach_x - grid.x) / cell), math.floor((x + reach_x - grid.x) / cell)
    j0, j1 = math.ceil((y - reach_y - grid.y) / cell), math.floor((y + reach_y - grid.y) / cell)
    cut = i0 < 0 or j0 < 0 or i1 >= nx or j1 >= ny
    added = 0.0
    nz = frame.nz
    lift = 0.0 if disc else bead.lift
    for j in range(max(j0, 0), min(j1, ny - 1) + 1):
        dy = grid.y + j * cell - y
        for i in range(max(i0, 0), min(i1, nx - 1) + 1):
            dx = grid.x + i * cell - x
            # (dx, dy) = v along + u across in projection
            v = (dx * frame.by - dy * frame.bx) / nz
            u = (frame.tx * dy - frame.ty * dx) / nz
            far = math.sqrt(u * u + v * v) if disc else abs(u)
            if disc:
                front = edge = throat = web = radius
                height = (bead.height_right + bead.height_left) / 2
            else:
                if v < -along - SEAM + mitre_start * u or v > along + SEAM - mitre_end * u:
                    continue
                if u < 0:
                    front, edge, height, throat, web = (
                        bead.front_right,
                        bead.round_right,
                        bead.height_right,
                        bead.throat_right,
                        bead.web_right,
                    )
                else:
                    front, edge, height, throat, web = (
                        bead.front_left,
                        bead.round_left,
                        bead.height_left,
                        bead.throat_left,
                        bead.web_left,
                    )
            rises = lift > 0 and far < edge
            plane = z + v * frame.tz + u * frame.bz + bead.shift / nz
            if far >= min(front, throat) and not rises:
                if far < web and (plane - grid.material[j, i]) * nz > height * DEEPER:
                    grid.material[j, i] = grid.surface[j, i] = plane - height / 2 / nz
                continue
            r = min(height / 2, front)
            d = drop(far - front + r, r)
            d = d if far < min(front, throat) else 0.0
            upper = plane + ((lift if rises else 0.0) - d) / nz
            mine = grid.stamp[j, i] > own
            there = grid.material[j, i]
            if not mine:
                grid.before[j, i] = there
            grid.stamp[j, i] = step
            gap = (plane - there) * nz
            shoulder = gap < SAME_LAYER * height
            if upper > there:
                added += upper - there
                grid.material[j, i] = upper
                grid.bulge[j, i] = lift / nz if rises else 0.0
                if not mine:
                    depth = min(gap, height - d) if gap <= height else min(gap, bead.thread) - d
                    hole = max(0.0, gap - depth) / nz
                    added -= hole
                    if not shoulder:
                        grid.pores[j, i] = min(hole, d / nz)
            if shoulder and not mine:
                filled = max(0.0, grid.pores[j, i] - d / nz)
                added += filled
                grid.pores[j, i] -= filled
            if far < edge:
                r = min(height / 2, edge)
                upper = plane + (lift - drop(far - edge + r, r)) / nz
                grid.surface[j, i] = max(grid.surface[j, i], upper)
            elif (plane - grid.surface[j, i]) * nz > height / 2:  # an open floor, no neighbour's shoulder
                grid.surface[j, i] = max(grid.surface[j, i], upper)
    return added * cell * cell, cut
