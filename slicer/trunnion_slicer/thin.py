"""Places too narrow for walls or infill become single beads along their middle, as wide as the place is.

The middle is the medial axis: edges of the Voronoi diagram of points along the outline (Kirkpatrick 1979, Efficient
computation of continuous skeletons) that stay inside and keep half the narrowest bead from the outline. The forks into
the corners are cut off.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_slicer.walls import as_multipolygon, offset, opened

SAMPLE = 0.1
"""mm between points along the outline: finer than the narrowest bead, so that the axis does not jump sides."""

NARROWEST = 0.35
"""Share of the width below which a place is left to the beads beside it: they squeeze into it."""

WAVER = 0.02
"""mm. How far the axis of sampled points may be straightened."""

WIDTH_STEP = 1.0
"""mm. The width of a bead is measured at least this often."""

EMPTY = 0.05
"""mm². What two outlines leave between them by rounding corners differently is less than this."""


def gaps(region: MultiPolygon, lines: Sequence[MultiPolygon], width: float, spacing: float) -> list[MultiPolygon]:
    """What the walls leave bare: outside wall 0 (where it does not fit), between walls 0 and 1, ...

    `lines` are the areas inside each wall's centre line (`walls.wall_lines`). What is inside the innermost wall is
    the infill's, and not here.
    """
    outside = [region, *(offset(line, -spacing / 2) for line in lines[:-1])]
    taken = [offset(line, (width if index == 0 else spacing) / 2) for index, line in enumerate(lines)]
    return [bare(whole, part, width) for whole, part in zip(outside, taken, strict=False)]


def bare(whole: MultiPolygon, part: MultiPolygon, width: float) -> MultiPolygon:
    """`whole` without `part`, without what is too narrow for any bead."""
    if whole.is_empty or whole.area - part.area < EMPTY:
        return MultiPolygon()
    return opened(as_multipolygon(whole.difference(part)), NARROWEST * width / 2)


def middle_lines(region: MultiPolygon, width: float) -> list[tuple[FloatArray, FloatArray]]:
    """Centre lines (n, 2) mm and how wide `region` is at their points (n,) mm, at most twice `width`.

    Lines shorter than `width` are left out.
    """
    found: list[tuple[FloatArray, FloatArray]] = []
    for part in region.geoms:
        outline = part.boundary
        shapely.prepare(outline)
        for line in _axis(part, width):
            eased = shapely.segmentize(shapely.simplify(line, WAVER), WIDTH_STEP)
            points = shapely.get_coordinates(eased)
            wide = 2 * np.asarray(shapely.distance(shapely.points(points), outline))
            found.append((points, np.clip(wide, NARROWEST * width, 2 * width)))
    return found


def _axis(part: Polygon, width: float) -> list[shapely.LineString]:
    """The branches of the medial axis, without forks into corners."""
    outline = shapely.segmentize(part.boundary, SAMPLE)
    samples = shapely.multipoints(np.unique(shapely.get_coordinates(outline), axis=0))
    edges = shapely.get_parts(shapely.voronoi_polygons(samples, only_edges=True))
    edges = edges[shapely.contains_properly(part, edges)]
    if not len(edges):
        return []
    ends = shapely.get_coordinates(edges).reshape(-1, 2, 2)
    clear = shapely.distance(shapely.points(ends), part.boundary).min(axis=1)
    branches = _merged(edges[clear >= 0.9 * NARROWEST * width / 2])
    if not len(branches):
        return []
    return [line for line in _merged(branches[~_forks(branches, width)]) if line.length >= width]


def _merged(lines: "np.typing.NDArray[np.object_]") -> "np.typing.NDArray[np.object_]":
    if not len(lines):
        return lines
    parts: np.typing.NDArray[np.object_] = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines)))
    return parts


def _forks(branches: "np.typing.NDArray[np.object_]", width: float) -> BoolArray:
    """Short branches that hang on a junction with one end only."""
    ends = np.round(shapely.get_coordinates(shapely.get_point(np.repeat(branches, 2), [0, -1] * len(branches))), 9)
    _, number, degree = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    meets = degree[number.reshape(-1)].reshape(-1, 2)
    return np.asarray((shapely.length(branches) < width) & (meets.min(axis=1) == 1) & (meets.max(axis=1) > 1))
