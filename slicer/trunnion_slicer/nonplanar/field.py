"""The normals of a surface become an even field of tool axes over it, the same for every line that is drawn on it.

Normals are looked up at the nodes of a square lattice over the surface seen from above, so that the field does not
depend on where the tessellator put its triangles. Sought are the axes of least bending energy of a thin plate, held to
their normals by springs so soft that they are heard REACH away, each within a cone about its normal. Plates end at
creases. The cones are met by the alternating direction method of multipliers (Boyd et al. 2011): one factorisation of
the plate's matrix, then rounds of a solve and a step into the cones.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_slicer.nonplanar.grid import Grid
from trunnion_slicer.nonplanar.orient import CREASE_DEG
from trunnion_slicer.nonplanar.smooth import into_cone

CELL = 0.5
"""mm between nodes: about a bead."""
REACH = 3.0
"""mm over which the field evens out its normals: some facets of a mesh that is meant to be round."""
SHARE = 0.6
"""Share of the cone that the field uses; what is left is for the paths, to turn at creases and near the vertical."""
PENALTY = 20.0
"""Of leaving the cone while it is sought, in springs of the normals."""
ROUNDS = 15
"""Solves; after that many the field is a few thousandths of a radian from what more would make it."""
BEYOND = 1e-3
"""Weight of the nearest normal at nodes beside the surface, where the field only goes on."""
ON_SURFACE = 1e-6
"""mm. A point nearer than this to a triangle is over it."""
STENCILS = (
    ((-1, 0, 1.0), (0, 0, -2.0), (1, 0, 1.0)),
    ((0, -1, 1.0), (0, 0, -2.0), (0, 1, 1.0)),
    ((0, 0, np.sqrt(2)), (1, 0, -np.sqrt(2)), (0, 1, -np.sqrt(2)), (1, 1, np.sqrt(2))),
)
"""Second differences along X, along Y and across, as steps and weights; the sum of their squares bends no way more."""


def even_axes(points: FloatArray, grid: Grid, corner_normals: FloatArray, tolerance: float) -> FloatArray:
    """Axes (n, 3) unit at points (n, 3) mm on the surface of `grid`, about SHARE of `tolerance` rad from its normals.

    corner_normals (m, 3, 3) unit belong to the corners of the grid's triangles. At creases, and where the surface
    bends too much to be even within the cone, an axis may be farther from its normal: `into_cone` is the caller's.
    Costs about 10 us a node, of which there are four to a mm².
    """
    if not len(points):
        return np.zeros((0, 3))
    place = points[:, :2] / CELL
    low = np.floor(place.min(axis=0)).astype(np.int64) - 1
    cell = np.floor(place).astype(np.int64) - low
    node = _nodes(cell)
    normals, over = normals_at((np.argwhere(node >= 0) + low) * CELL, grid, corner_normals)
    axes = _plate(node, normals, over, SHARE * tolerance)
    share = place - low - cell
    result = np.zeros((len(points), 3))
    for i, along_x in ((0, 1 - share[:, 0]), (1, share[:, 0])):
        for j, along_y in ((0, 1 - share[:, 1]), (1, share[:, 1])):
            result += (along_x * along_y)[:, None] * axes[node[cell[:, 0] + i, cell[:, 1] + j]]
    return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True))


def normals_at(points: FloatArray, grid: Grid, corner_normals: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Normals (n, 3) unit, interpolated over the facet under each point (n, 2), and whether there is one (n,).

    Beside the surface the normal is the nearest one.
    """
    triangle, weights = grid.locate(points)
    there = np.einsum("nk,nkd->nd", weights, grid.triangles[triangle][:, :, :2])
    over = np.linalg.norm(there - points, axis=1) < ON_SURFACE
    normals = np.einsum("nk,nkd->nd", weights, corner_normals[triangle])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True), over


def _nodes(cell: IntArray) -> IntArray:
    """Numbers of the lattice's nodes in or next to the cells (n, 2), all counted from 1; -1 elsewhere."""
    there = np.zeros(cell.max(axis=0) + 3, np.bool_)
    for i in (-1, 0, 1, 2):
        for j in (-1, 0, 1, 2):
            there[cell[:, 0] + i, cell[:, 1] + j] = True
    node = np.full(there.shape, -1, np.int64)
    node[there] = np.arange(there.sum())
    return node


def _plate(node: IntArray, normals: FloatArray, over: BoolArray, tolerance: float) -> FloatArray:
    """Axes (n, 3) unit of the plate's nodes."""
    held = np.where(over, 1.0, BEYOND)
    penalty = np.where(over, PENALTY, 0.0)
    matrix = _bending(node, normals) + diags_array(held + penalty)
    solver = splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    axes = inside = normals
    surplus = np.zeros_like(normals)
    for _ in range(ROUNDS):
        axes = solver.solve(held[:, None] * normals + penalty[:, None] * (inside - surplus))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        inside = axes + surplus
        inside = into_cone(inside / np.linalg.norm(inside, axis=1, keepdims=True), normals, tolerance)
        surplus = surplus + axes - inside
    return axes


def _bending(node: IntArray, normals: FloatArray) -> csr_array:
    """(n, n) the plate's bending energy, in springs; without stencils across creases."""
    count = len(normals)
    total = csr_array((count, count))
    padded = np.pad(node, 1, constant_values=-1)
    wide, high = node.shape
    here: NDArray[np.bool_] = node >= 0
    for stencil in STENCILS:
        columns = np.stack([padded[1 + i : 1 + i + wide, 1 + j : 1 + j + high][here] for i, j, _ in stencil], axis=1)
        columns = columns[(columns >= 0).all(axis=1)]
        alike = np.einsum("nid,njd->nij", normals[columns], normals[columns]).min(axis=(1, 2), initial=1.0)
        columns = columns[alike > np.cos(np.radians(CREASE_DEG))]
        values = np.tile([(REACH / CELL) ** 2 * weight for _, _, weight in stencil], len(columns))
        rows = np.repeat(np.arange(len(columns)), len(stencil))
        difference = csr_array((values, (rows, columns.ravel())), shape=(len(columns), count))
        total = total + difference.T @ difference
    return total
