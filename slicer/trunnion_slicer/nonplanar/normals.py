"""Triangles become averaged vertex normals, and the step that keeps every triangle's own thickness (equations 2, 3).

Equation 2 of Shahid 2024 (after Qu 2003) averages the normals of the triangles around a vertex. A plain mean leans
towards wherever a tessellator happened to put more triangles, so each is weighted by the angle it has at the vertex
(Thürmer & Wüthrich 1998, Computing vertex normals from polygonal facets), which does not depend on the tessellation.
"""

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray

LONGEST_STEP = 3.0
"""How much longer than the offset distance the step at a crease may be: beyond it, the mitre is cut off."""


def face_normals(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (m, 3) and areas (m,) mm² of the triangles; (0, 0, 0) for a triangle without area."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(length, 1e-300)[:, None], length / 2


def corner_angles(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Angle in rad of every corner, (m, 3)."""
    corners = vertices[faces]
    ahead = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(ahead, back), axis=2)
    return np.asarray(np.arctan2(sine, (ahead * back).sum(axis=2)))


def mean_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Angle-weighted means (n, 3) of the unit normals around each vertex, not normalised.

    The length is the mean cosine between the triangles and their common normal: 1 where the surface is smooth, less
    at a crease; 0 at a vertex of no triangle.
    """
    normal, _ = face_normals(vertices, faces)
    weight = corner_angles(vertices, faces)
    count = len(vertices)
    total = np.bincount(faces.ravel(), weight.ravel(), count)
    summed = [np.bincount(faces.ravel(), (weight * normal[:, axis, None]).ravel(), count) for axis in range(3)]
    return np.stack(summed, axis=1) / np.maximum(total, 1e-300)[:, None]


def offset_steps(mean: FloatArray) -> FloatArray:
    """Where each vertex goes for an offset of 1 mm to the inside, (n, 3), from `mean_normals`.

    Equation 3 with the averaged normal as direction. At a crease a step of 1 along it would move each facet by the
    cosine only; dividing by the mean cosine gives every facet the whole distance (at most LONGEST_STEP).
    """
    squared = (mean**2).sum(axis=1, keepdims=True)
    return np.asarray(-mean / np.maximum(squared, np.sqrt(squared) / LONGEST_STEP + 1e-300))
