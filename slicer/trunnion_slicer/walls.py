"""A region becomes the centre lines of its walls, and the region inside them that infill has to fill.

Wall i runs width / 2 + i * spacing inside the outline (mitred parallel offsets). A wall is only laid where two of its
runs facing each other are at least CLOSEST_RUNS spacings apart: nearer than that the two beads would be one heap, and
the place is left to `thin.py`.
"""

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from trunnion_core.arrays import FloatArray

CLOSEST_RUNS = 0.6
"""Share of the spacing that two runs of one wall must keep: at 0.6 the excess plastic is what a bead can take up by
squeezing (the value PrusaSlicer's perimeter generator arrived at)."""

MITRE_LIMIT = 2.0
"""Corners sharper than about 60 degrees are bevelled where a wall goes round their outside."""


SAME_AREA = 1e-3
"""mm². Places too narrow for two runs are larger than this."""

GRID = 1e-6
"""mm. Overlaying two outlines that nearly coincide leaves points closer than this, which are one point."""


def walls(
    region: Polygon | MultiPolygon, count: int, width: float, spacing: float
) -> tuple[list[tuple[int, FloatArray]], MultiPolygon]:
    """Closed rings (n, 2) mm with their index (0: outermost), and the region left for infill.

    `width` and `spacing` in mm are those of one bead and of two neighbours. The first point of a ring is repeated at
    its end; rings around material run counter-clockwise, around holes clockwise. The region left is bounded by the
    inner edge of the innermost wall; with `count` 0 it is `region` itself. Where nothing fits, nothing is returned.
    """
    lines = wall_lines(as_multipolygon(region), count, width, spacing)
    found = [(index, ring) for index, line in enumerate(lines) for ring in rings(line)]
    return found, offset(lines[-1], -spacing / 2) if lines else as_multipolygon(region)


def wall_lines(region: MultiPolygon, count: int, width: float, spacing: float) -> list[MultiPolygon]:
    """The areas inside each wall's centre line, outermost first."""
    lines = []
    line = region
    for index in range(count):
        line = _fitting(line, width / 2 if index == 0 else spacing, CLOSEST_RUNS * spacing / 2)
        lines.append(line)
    return lines


def offset(region: BaseGeometry, distance: float) -> MultiPolygon:
    """The region grown by `distance` mm with mitred corners; shrunk where negative."""
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS divides by zero at collinear corners, and recovers
        return as_multipolygon(region.buffer(distance, join_style="mitre", mitre_limit=MITRE_LIMIT))


def opened(region: BaseGeometry, radius: float) -> MultiPolygon:
    """The region without what is narrower than 2 `radius`."""
    return offset(offset(region, -radius), radius)


def as_multipolygon(region: BaseGeometry) -> MultiPolygon:
    """The areas of any geometry, without its lines and points."""
    if isinstance(region, MultiPolygon):
        return region
    if isinstance(region, Polygon):
        return MultiPolygon() if region.is_empty else MultiPolygon([region])
    parts = shapely.get_parts(shapely.get_parts(region))
    return MultiPolygon([part for part in parts if isinstance(part, Polygon) and not part.is_empty])


def _fitting(region: MultiPolygon, distance: float, margin: float) -> MultiPolygon:
    """`region` shrunk by `distance`, without the places narrower than 2 `margin` after that."""
    shrunk = offset(region, -distance)
    wide = offset(offset(region, -(distance + margin)), margin)
    if abs(shrunk.area - wide.area) < SAME_AREA:
        return shrunk
    return as_multipolygon(shapely.intersection(shrunk, wide, grid_size=GRID))


def rings(region: MultiPolygon) -> list[FloatArray]:
    """Every ring of the region (n, 2) mm, closed, shells counter-clockwise, holes clockwise."""
    oriented = shapely.orient_polygons(region)
    return [np.asarray(ring.coords)[:, :2] for part in oriented.geoms for ring in (part.exterior, *part.interiors)]
