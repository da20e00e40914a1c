"""Signed distance from a point to a convex body, exact inside and out: cones, cylinders and boxes.

A body is one row of numbers. Revolution: (0, x, y, bottom, top, bottom radius, top radius, 0) about the local Z.
Box: (1, lowest corner, highest corner, 0).
"""

import math
from typing import Any

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray
from trunnion_core.solid_tables import BoxTable, ConeTable, CylinderTable

REVOLUTION = 0.0
BOX = 1.0


def row_of(solid: ConeTable | CylinderTable | BoxTable) -> FloatArray:
    """(8,) numbers of a solid of a profile, in its own frame, mm."""
    if isinstance(solid, BoxTable):
        return np.array([BOX, *solid.min, *solid.max, 0.0])
    if isinstance(solid, CylinderTable):
        radii = (solid.diameter / 2, solid.diameter / 2)
    else:
        radii = (solid.bottom_diameter / 2, solid.top_diameter / 2)
    return np.array([REVOLUTION, *solid.center, solid.bottom, solid.top, *radii, 0.0])


def middle_of(row: FloatArray) -> FloatArray:
    """(3,) mm: the centre of a sphere around the body; `radius_of` is its radius."""
    if row[0] == BOX:
        return np.asarray((row[1:4] + row[4:7]) / 2)
    return np.array([row[1], row[2], (row[3] + row[4]) / 2])


def radius_of(row: FloatArray) -> float:
    """Radius in mm of the sphere about `middle_of` that holds the body."""
    if row[0] == BOX:
        return float(np.linalg.norm(row[4:7] - row[1:4]) / 2)
    return math.hypot((row[4] - row[3]) / 2, max(row[5], row[6]))


@njit(cache=True)
def signed_distance(row: Any, x: Any, y: Any, z: Any) -> Any:
    """Distance in mm of a point in the body's frame from its surface, negative inside."""
    if row[0] == 1.0:
        dx = abs(x - (row[1] + row[4]) / 2) - (row[4] - row[1]) / 2
        dy = abs(y - (row[2] + row[5]) / 2) - (row[5] - row[2]) / 2
        dz = abs(z - (row[3] + row[6]) / 2) - (row[6] - row[3]) / 2
        outside = math.sqrt(max(dx, 0.0) ** 2 + max(dy, 0.0) ** 2 + max(dz, 0.0) ** 2)
        return outside + min(max(dx, dy, dz), 0.0)
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
