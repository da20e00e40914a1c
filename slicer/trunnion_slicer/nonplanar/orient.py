"""Averaged normals become the directions that the tool takes along paths.

On a smooth surface the averaged normals, interpolated over each facet, are the tool axis. At a crease they are not: on
a large flat facet they would lean towards the crease all over it. So a corner's normal averages only the facets that
are nearly parallel to its own, and along a path that crosses the crease the tool turns over a short way.
"""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.mesh import Mesh
from trunnion_slicer.nonplanar.normals import corner_angles, face_normals, mean_normals

CREASE_DEG = 20.0
"""Degrees between facets from which on each keeps its own normal at their common corner."""

CREASE_JUMP = 0.035
"""Two degrees: a larger step of the tool axis at a point is spread over the path before and behind it."""


def corner_normals(mesh: Mesh, region: BoolArray) -> FloatArray:
    """(m, 3, 3) unit: at every corner of the region's faces the mean, weighted by angle, of the normals around it that
    are within CREASE_DEG of its face's; 0 elsewhere.

    Faces beyond the border of the region (m,) count as well: where it ends says nothing about the surface.
    """
    faces = mesh.faces
    normal, _ = face_normals(mesh.vertices, faces)
    mean = mean_normals(mesh.vertices, faces)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    corners = np.where(region[:, None, None], mean[faces], 0.0)
    rows = np.flatnonzero(region)
    off = (corners[rows] * normal[rows, None]).sum(axis=2) < np.cos(np.radians(CREASE_DEG / 2))
    creased = np.zeros(len(mesh.vertices), np.bool_)
    creased[faces[rows][off]] = True
    around = np.flatnonzero(creased[faces].ravel())
    if not around.size:
        return corners
    vertex = faces.ravel()[around]
    order = np.argsort(vertex, kind="stable")
    around, vertex = around[order], vertex[order]
    mine = np.flatnonzero(region[around // 3])
    first = np.searchsorted(vertex, vertex[mine], side="left")
    valence = np.searchsorted(vertex, vertex[mine], side="right") - first
    pair = np.repeat(np.arange(len(mine)), valence)
    other = around[first[pair] + np.arange(len(pair)) - np.repeat(np.cumsum(valence) - valence, valence)]
    mine = around[mine]
    alike = (normal[mine[pair] // 3] * normal[other // 3]).sum(axis=1) >= np.cos(np.radians(CREASE_DEG))
    weight = corner_angles(mesh.vertices, faces).ravel()[other] * alike
    total = [np.bincount(pair, weight * normal[other // 3, axis], len(mine)) for axis in range(3)]
    summed = np.stack(total, axis=1)
    corners = corners.reshape(-1, 3)
    corners[mine] = summed / np.linalg.norm(summed, axis=1, keepdims=True)
    return corners.reshape(-1, 3, 3)


def inherited(triangles: FloatArray, whole: FloatArray, normals: FloatArray) -> FloatArray:
    """(m, 3, 3) unit: normals at the corners of triangles, each a part of one of `whole` with `normals`, all (m, 3, 3).

    Cutting a face in pieces changes nothing about which way the tool stands on it.
    """
    side, other = whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]
    away = triangles - whole[:, :1]
    across = np.cross(side, other)
    size = np.maximum((across * across).sum(axis=1), 1e-300)[:, None]
    second = (np.cross(away, other[:, None]) * across[:, None]).sum(axis=2) / size
    third = (np.cross(side[:, None], away) * across[:, None]).sum(axis=2) / size
    weights = np.clip(np.stack([1 - second - third, second, third], axis=2), 0.0, 1.0)
    between = np.einsum("mck,mkd->mcd", weights, normals)
    return np.asarray(between / np.maximum(np.linalg.norm(between, axis=2, keepdims=True), 1e-300))


def spread_jumps(
    points: FloatArray, arriving: FloatArray, leaving: FloatArray, density: FloatArray, starts: IntArray, blend: float
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Points, one axis each, densities and starts, the tool turning evenly over `blend` mm around every jump.

    points (n, 3), density (n,) of paths starts[i] : starts[i + 1]; arriving and leaving (n, 3) unit are the axes at
    the end of the piece before a row and at the start of the one behind. Rows are added where the turning begins and
    ends.
    """
    axes = arriving + leaving
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    jump = np.linalg.norm(arriving - leaving, axis=1) > CREASE_JUMP
    if not jump.any():
        return points, axes, density, starts
    along = np.zeros(len(points))
    along[1:] = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
    low = np.repeat(along[starts[:-1]], np.diff(starts))
    high = np.repeat(along[starts[1:] - 1], np.diff(starts))
    gap = np.repeat(np.arange(len(starts) - 1) * 4 * blend, np.diff(starts))
    along, low, high = along + gap, low + gap, high + gap

    centre = along[jump]
    before, behind = np.maximum(centre - blend, low[jump]), np.minimum(centre + blend, high[jump])
    added = np.unique(np.concatenate([before, behind]))
    nearest = np.clip(np.searchsorted(along, added), 1, len(along) - 1)
    distance = np.minimum(np.abs(along[nearest] - added), np.abs(along[nearest - 1] - added))
    added = added[distance > 1e-3]
    place = np.searchsorted(along, added)
    straight = np.column_stack([points, density])
    between = [np.interp(added, along, column) for column in straight.T]
    # Axes run from one row's leaving to the next one's arriving.
    twice, sides = np.repeat(along, 2), np.stack([arriving, leaving], axis=1).reshape(-1, 3)
    between += [np.interp(added, twice, axis) for axis in sides.T]
    values = np.insert(np.column_stack([straight, axes]), place, np.stack(between, axis=1), axis=0)
    turned = np.insert(along, place, added)

    # Rows within reach of a jump take the axis between those at the two ends of its reach.
    ends = np.stack([[np.interp(s, twice, axis) for axis in sides.T] for s in (before, behind)])
    right = np.clip(np.searchsorted(centre, turned), 0, len(centre) - 1)
    left = np.maximum(right - 1, 0)
    near = np.where(np.abs(centre[left] - turned) < np.abs(centre[right] - turned), left, right)
    inside = (turned > before[near]) & (turned < behind[near])
    which = near[inside]
    t = ((turned[inside] - before[which]) / (behind[which] - before[which]))[:, None]
    values[inside, 4:] = (1 - t) * ends[0].T[which] + t * ends[1].T[which]
    values[:, 4:] /= np.linalg.norm(values[:, 4:], axis=1, keepdims=True)
    moved = starts + np.searchsorted(place, starts, side="left")
    return values[:, :3], values[:, 4:], values[:, 3], moved
