"""Flat paths become beads' paths on a surface: cut at the triangles' edges, lifted, turned, thinned out.

Section 2.11 of Shahid 2024: a path bends only where it crosses an edge, so points there (and nowhere else) follow
the surface exactly. Each piece between two points lies in one triangle and takes height, tool axis and thickness
from it; at a point, both pieces have a say. Points that do not matter are then dropped.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray, freeze
from trunnion_slicer.nonplanar.grid import Grid
from trunnion_slicer.nonplanar.orient import spread_jumps
from trunnion_slicer.nonplanar.thin_kernel import thinned

CHORD = 0.003
"""mm. How far a point may lie off the line between its neighbours and still be dropped."""

AXIS_CHORD = 0.009
"""Half a degree: how far its tool axis may be off the interpolated one."""

DENSITY_CHORD = 0.05
"""Share by which the layer's thickness at it may be off the interpolated one."""

DENSITY_STEP = 0.15
"""mm. How closely a thickness that changes within triangles is looked up."""

SHORTEST = 0.05
"""mm. Of points nearer than this to each other one is enough: less than the nozzle's flat can follow."""


@dataclass(frozen=True, eq=False)
class Lifted:
    """Paths on a surface: path i is rows starts[i] : starts[i + 1]."""

    points: FloatArray
    """(n, 3) mm."""
    axes: FloatArray
    """(n, 3) unit, the averaged normals."""
    volume: FloatArray
    """(n,) mm³ per mm of share of the piece that ends at the row, 0 in the first row of a path."""
    run: FloatArray
    """(n,) mm of path, seen from above, of that piece; a little more than from row to row where a bend was dropped."""
    starts: IntArray
    """(paths + 1,)"""

    def __post_init__(self) -> None:
        freeze(self.points, self.axes, self.volume, self.run, self.starts)


def lift(
    lines: Sequence[FloatArray],
    grid: Grid,
    corner_normals: FloatArray,
    corner_density: FloatArray,
    blend: float,
    density_at: Callable[[FloatArray, FloatArray], FloatArray] | None = None,
) -> Lifted:
    """Polylines (n, 2) mm on the surface of `grid`.

    corner_normals (m, 3, 3) unit and corner_density (m, 3) mm belong to the corners of the grid's triangles. Where
    the normal jumps at an edge, the tool turns over `blend` mm before and behind it. `density_at` (points, normals)
    replaces the corners' densities by ones that change within a triangle, looked up every DENSITY_STEP.
    """
    if not lines:
        return Lifted(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(1, np.int64))
    flat = np.concatenate(lines)
    starts = np.concatenate([[0], np.cumsum([len(line) for line in lines])]).astype(np.int64)
    flat, starts = grid.cut(flat, starts)
    points, axes, density, starts = _evaluate(flat, starts, grid, corner_normals, corner_density, blend)
    if density_at is not None:
        points, axes, starts = _divided(points, axes, starts)
        density = density_at(points, axes)
    run = np.zeros(len(points))
    run[1:] = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    run[starts[:-1]] = 0.0
    volume = run.copy()
    volume[1:] *= (density[1:] + density[:-1]) / 2
    keep = thinned(points, axes, density, starts, CHORD, AXIS_CHORD, DENSITY_CHORD, SHORTEST)
    rows = np.flatnonzero(keep)
    volume, run = (np.diff(np.cumsum(value)[rows], prepend=0.0) for value in (volume, run))
    return Lifted(points[rows], axes[rows], volume, run, np.searchsorted(rows, starts))


def _divided(points: FloatArray, axes: FloatArray, starts: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Paths with rows at most DENSITY_STEP apart."""
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    parts = np.ones(len(points), np.int64)
    parts[:-1] = np.maximum(np.ceil(length / DENSITY_STEP).astype(np.int64), 1)
    parts[starts[1:] - 1] = 1
    row = np.repeat(np.arange(len(points)), parts)
    nth = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    t = (nth / parts[row])[:, None]
    following = np.minimum(row + 1, len(points) - 1)
    between = np.where(t > 0, (1 - t) * axes[row] + t * axes[following], axes[row])
    between /= np.linalg.norm(between, axis=1, keepdims=True)
    divided = np.where(t > 0, (1 - t) * points[row] + t * points[following], points[row])
    return divided, between, np.concatenate([[0], np.cumsum(parts)])[starts]


def _evaluate(
    flat: FloatArray,
    starts: IntArray,
    grid: Grid,
    corner_normals: FloatArray,
    corner_density: FloatArray,
    blend: float,
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Points, axes, densities and starts of paths whose pieces each lie over one triangle."""
    count = len(flat)
    into = np.ones(count, np.bool_)  # whether a piece ends at the row
    into[starts[:-1]] = False
    end = np.flatnonzero(into)
    triangle, _ = grid.locate((flat[end] + flat[end - 1]) / 2)
    height, thickness, says = np.zeros(count), np.zeros(count), np.zeros(count)
    leaving, arriving = np.zeros((count, 3)), np.zeros((count, 3))
    for row, axis in ((end - 1, leaving), (end, arriving)):
        weights = _weights(flat[row], grid.triangles[triangle])
        height[row] += (weights * grid.triangles[triangle][:, :, 2]).sum(axis=1)
        thickness[row] += (weights * corner_density[triangle]).sum(axis=1)
        says[row] += 1
        normal = np.einsum("nk,nkd->nd", weights, corner_normals[triangle])
        axis[row] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    # A closed path arrives at its first row from its last piece; an open one starts and ends as it goes on.
    first, last = starts[:-1], starts[1:] - 1
    closed = (flat[first] == flat[last]).all(axis=1)
    arriving[first] = np.where(closed[:, None], arriving[last], leaving[first])
    leaving[last] = np.where(closed[:, None], leaving[first], arriving[last])
    for value in (height, thickness, says):
        value[first[closed]] = value[last[closed]] = value[first[closed]] + value[last[closed]]
    says = np.maximum(says, 1.0)
    points = np.column_stack([flat, height / says])
    return spread_jumps(points, arriving, leaving, thickness / says, starts, blend)


def _weights(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of points (n, 2) in triangles (n, 3, 3), not far beyond them."""
    a = triangles[:, 1, :2] - triangles[:, 0, :2]
    b = triangles[:, 2, :2] - triangles[:, 0, :2]
    q = points - triangles[:, 0, :2]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    safe = np.where(np.abs(area) > 1e-14, area, 1.0)
    v = (q[:, 0] * b[:, 1] - q[:, 1] * b[:, 0]) / safe
    w = (a[:, 0] * q[:, 1] - a[:, 1] * q[:, 0]) / safe
    weights = np.clip(np.stack([1 - v - w, v, w], axis=1), -0.2, 1.2)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
