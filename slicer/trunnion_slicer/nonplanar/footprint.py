"""A surface seen from above becomes the area that its beads have to cover."""

import numpy as np
import shapely
from shapely.geometry import MultiPolygon

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_slicer.nonplanar.grid import Grid
from trunnion_slicer.walls import as_multipolygon

SIMPLIFY = 0.01
"""mm. How far simplifying may move the outline."""

CRACK = 0.005
"""mm. Half the width given to a border inside the outline: a cliff, seen from above, has none."""

ON_SURFACE = 1e-6
"""mm. A point nearer than this to a triangle is on it."""


def footprint(vertices: FloatArray, border: IntArray, grid: Grid) -> MultiPolygon:
    """The outline (XY) of a surface with border edges (b, 2) rows of `vertices`; `grid` is over its triangles.

    The border's pieces are noded and the areas between them kept that lie under a triangle, so that borders which
    cross or touch themselves (an offset that recedes through itself) still give an area. A border inside that area is a
    cliff (or a rib of no width): no path may cross it, so it becomes a crack.
    """
    lines = shapely.union_all(shapely.linestrings(vertices[border][:, :, :2]))
    areas = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    if not len(areas):
        return MultiPolygon()
    probes = shapely.get_coordinates(shapely.point_on_surface(areas))
    triangle, weights = grid.locate(probes)
    there = np.einsum("nk,nkd->nd", weights, grid.triangles[triangle][:, :, :2])
    covered = areas[np.linalg.norm(there - probes, axis=1) < ON_SURFACE]
    whole = as_multipolygon(shapely.make_valid(shapely.simplify(shapely.union_all(covered), SIMPLIFY)))
    cracks = shapely.difference(lines, shapely.buffer(whole.boundary, 2 * SIMPLIFY))
    return as_multipolygon(shapely.difference(whole, shapely.buffer(cracks, CRACK)))
