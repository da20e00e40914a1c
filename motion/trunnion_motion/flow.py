"""Turn the beads of a toolpath into filament: section of the bead times its length in the part.

The length is that of the bead's middle line, which runs half a bead's height below the tip, along the tool. On flat
layers it is the tip's own length; over a convex surface it is shorter by half the height times the curvature, inside
a bowl longer, so that stacked curved layers hold their volume. Nothing here knows a machine.
"""

import math

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.bead import bead_area
from trunnion_core.toolpath import Toolpath

MOST_CURVATURE = 0.1
"""How much curvature may change a bead's length, as a share: a radius of five bead heights. What bends more is an edge,
at which the tool turns within a row but no bead is shorter for it."""


def filament_per_row(toolpath: Toolpath, filament_diameter: float, multiplier: float = 1.0) -> FloatArray:
    """(n,) mm of filament that every row of the toolpath feeds; 0 where nothing is extruded.

    `filament_diameter` in mm, `multiplier` a factor on everything (`extrusion_multiplier`). Depends on the toolpath
    alone: the same numbers for every machine that takes this filament.
    """
    return bead_volume(toolpath) * (multiplier / (math.pi / 4 * filament_diameter**2))


def bead_volume(toolpath: Toolpath) -> FloatArray:
    """(n,) mm³ of plastic in the bead of every row; 0 where nothing is extruded."""
    if not len(toolpath):
        return np.zeros(0)
    half = 0.5 * toolpath.height[1:, None]
    middle_end = toolpath.points[1:] - half * toolpath.tool_axes[1:]
    middle_start = toolpath.points[:-1] - half * toolpath.tool_axes[:-1]
    tip = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1)
    middle = np.linalg.norm(middle_end - middle_start, axis=1)
    length = np.clip(middle, (1 - MOST_CURVATURE) * tip, (1 + MOST_CURVATURE) * tip)
    volume = np.zeros(len(toolpath))
    section = bead_area(toolpath.width[1:], np.maximum(toolpath.height[1:], np.finfo(float).tiny))
    volume[1:] = section * length
    volume[~toolpath.extrudes] = 0.0
    return volume


def share(per_row: FloatArray, points: FloatArray, source: IntArray) -> FloatArray:
    """Split what belongs to a toolpath's rows over the (m,) rows of its subdivision, in proportion to tip length.

    `points` (m, 3) mm are the tip positions at the ends of the pieces, `source` (m,) the row each is a part of, or -1
    for rows that motion inserted, which get nothing. Where a row has no length its pieces share alike.
    """
    length = np.zeros(len(points))
    length[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    owned = source >= 0
    rows = np.where(owned, source, 0)
    total = np.bincount(rows, weights=np.where(owned, length, 0.0), minlength=len(per_row))
    count = np.bincount(rows, weights=owned, minlength=len(per_row))
    still = total[rows] <= 0
    part = np.where(still, 1.0 / np.maximum(count[rows], 1), length / np.where(still, 1.0, total[rows]))
    return np.where(owned, per_row[rows] * part, 0.0)
