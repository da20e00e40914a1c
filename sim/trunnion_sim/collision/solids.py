"""Convex solids as rows of numbers: how far a point is from one, and how far one reaches in a direction.

A solid is one row. Revolution: (0, x, y, bottom, top, bottom radius, top radius, 0) about the local Z. Box: (1, lowest
corner, highest corner, 0). Hull: (2, first and last corner, first and last face, 0, 0, 0), which are rows of the two
tables that all hulls share: corners (h, 3), and faces (f, 4) as outward normal and offset.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray
from trunnion_core.solid_tables import BoxTable, CylinderTable, HullTable, SolidTable

REVOLUTION = 0.0
BOX = 1.0
HULL = 2.0


def rows_of(solids: Sequence[SolidTable]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows (b, 8) of the solids of a profile, each in its own frame, mm, and the tables of their hulls."""
    corners, faces = [np.empty((0, 3))], [np.empty((0, 4))]
    rows = []
    for solid in solids:
        if isinstance(solid, HullTable):
            from scipy.spatial import ConvexHull

            hull = ConvexHull(np.array(solid.points))
            first = sum(map(len, corners)), sum(map(len, faces))
            corners.append(hull.points[hull.vertices])
            faces.append(np.unique(hull.equations.round(12), axis=0) * (1.0, 1.0, 1.0, -1.0))
            ends = first[0] + len(corners[-1]), first[1] + len(faces[-1])
            rows.append(np.array([HULL, first[0], ends[0], first[1], ends[1], 0.0, 0.0, 0.0]))
        else:
            rows.append(_row_of(solid))
    return np.array(rows).reshape(len(rows), 8), np.concatenate(corners), np.concatenate(faces)


def ball_of(row: FloatArray, corners: FloatArray) -> tuple[FloatArray, float]:
    """Centre (3,) and radius in mm of a ball that holds a solid, in its frame."""
    if row[0] == REVOLUTION:
        centre = np.array([row[1], row[2], (row[3] + row[4]) / 2])
        return centre, math.hypot((row[4] - row[3]) / 2, max(row[5], row[6]))
    if row[0] == BOX:
        return np.asarray((row[1:4] + row[4:7]) / 2), float(np.linalg.norm(row[4:7] - row[1:4]) / 2)
    own = corners[int(row[1]) : int(row[2])]
    middle = np.asarray((own.min(axis=0) + own.max(axis=0)) / 2)
    return middle, float(np.linalg.norm(own - middle, axis=1).max())


def farthest_from(row: FloatArray, corners: FloatArray, point: FloatArray, axis: FloatArray) -> float:
    """At least the distance in mm of any point of a solid from the line through `point` along `axis` (unit)."""
    if row[0] == HULL:
        ends, spread = corners[int(row[1]) : int(row[2])], np.zeros(1)
    elif row[0] == BOX:
        ends = np.array(np.meshgrid(*zip(row[1:4], row[4:7], strict=True), indexing="ij")).reshape(3, -1).T
        spread = np.zeros(1)
    else:
        ends = np.array([[row[1], row[2], row[3]], [row[1], row[2], row[4]]])
        spread = row[5:7]
    return float((np.linalg.norm(np.cross(ends - point, axis), axis=1) + spread).max())


def _row_of(solid: SolidTable) -> FloatArray:
    if isinstance(solid, BoxTable):
        return np.array([BOX, *solid.min, *solid.max, 0.0])
    assert not isinstance(solid, HullTable)
    if isinstance(solid, CylinderTable):
        radii = (solid.diameter / 2, solid.diameter / 2)
    else:
        radii = (solid.bottom_diameter / 2, solid.top_diameter / 2)
    return np.array([REVOLUTION, *solid.center, solid.bottom, solid.top, *radii, 0.0])


@njit(cache=True)
def signed_distance(row: Any, faces: Any, x: Any, y: Any, z: Any) -> Any:
    """Distance in mm of a point in the solid's frame from its surface, negative inside.

    Exact but outside a hull, where it is the distance to the farthest of its faces' planes: at most the true one, and
    zero in the same places.
    """
    if row[0] == 1.0:
        dx = abs(x - (row[1] + row[4]) / 2) - (row[4] - row[1]) / 2
        dy = abs(y - (row[2] + row[5]) / 2) - (row[5] - row[2]) / 2
        dz = abs(z - (row[3] + row[6]) / 2) - (row[6] - row[3]) / 2
        outside = math.sqrt(max(dx, 0.0) ** 2 + max(dy, 0.0) ** 2 + max(dz, 0.0) ** 2)
        return outside + min(max(dx, dy, dz), 0.0)
    if row[0] == 2.0:
        most = -1e300
        for f in range(int(row[3]), int(row[4])):
            most = max(most, faces[f, 0] * x + faces[f, 1] * y + faces[f, 2] * z - faces[f, 3])
        return most
    rho = math.hypot(x - row[1], y - row[2])
    bottom, top, r0, r1 = row[3], row[4], row[5], row[6]
    height = top - bottom
    slant = math.hypot(height, r1 - r0)
    beside = ((rho - r0) * height - (r1 - r0) * (z - bottom)) / slant
    inside = max(beside, bottom - z, z - top)
    if inside <= 0.0:
        return inside
    low = math.hypot(max(rho - r0, 0.0), z - bottom)
    high = math.hypot(max(rho - r1, 0.0), z - top)
    along = ((rho - r0) * (r1 - r0) + (z - bottom) * height) / (slant * slant)
    along = min(max(along, 0.0), 1.0)
    side = math.hypot(rho - r0 - along * (r1 - r0), z - bottom - along * height)
    return min(low, high, side)


@njit(cache=True)
def support(row: Any, corners: Any, rotation: Any, shift: Any, dx: Any, dy: Any, dz: Any, out: Any) -> Any:
    """The point of a placed solid that lies farthest along a direction (of any length), into out (3,)."""
    lx = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
    ly = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
    lz = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
    if row[0] == 1.0:
        x = row[4] if lx > 0.0 else row[1]
        y = row[5] if ly > 0.0 else row[2]
        z = row[6] if lz > 0.0 else row[3]
    elif row[0] == 2.0:
        best, at = -1e300, int(row[1])
        for k in range(int(row[1]), int(row[2])):
            far = corners[k, 0] * lx + corners[k, 1] * ly + corners[k, 2] * lz
            if far > best:
                best, at = far, k
        x, y, z = corners[at, 0], corners[at, 1], corners[at, 2]
    else:
        across = math.hypot(lx, ly)
        upper = row[6] * across + row[4] * lz > row[5] * across + row[3] * lz
        radius = row[6] if upper else row[5]
        z = row[4] if upper else row[3]
        x, y = row[1], row[2]
        if across > 0.0:
            x += radius * lx / across
            y += radius * ly / across
    for r in range(3):
        out[r] = rotation[r, 0] * x + rotation[r, 1] * y + rotation[r, 2] * z + shift[r]
