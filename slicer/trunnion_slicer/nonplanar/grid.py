"""Triangles seen from above become a grid of buckets: which triangle is over a point, in time that does not grow.

Everything non-planar is a height field, so every question about it (what is above this vertex, where on the surface
is this point of a path) is a search in XY. Buckets hold the triangles whose bounding box touches them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray, freeze
from trunnion_slicer.nonplanar.grid_kernels import bucket, bucket_count, column, cut, locate

MOST_ENTRIES = 60
"""Mean number of buckets a triangle may lie in before buckets are made larger: bounds memory on bundles of slivers."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Buckets over triangles. Build one with `build_grid`."""

    triangles: FloatArray
    """(m, 3, 3) mm."""
    origin: FloatArray
    """(2,) mm, the low corner."""
    cell: float
    """mm, side of a bucket."""
    shape: tuple[int, int]
    """Buckets along X and Y."""
    start: IntArray
    """(buckets + 1,) first entry of every bucket."""
    entries: IntArray
    """Triangles, bucket by bucket."""

    def __post_init__(self) -> None:
        freeze(self.origin, self.start, self.entries)

    @cached_property
    def _lattice(self) -> tuple[FloatArray, float, int, int, IntArray, IntArray]:
        return self.origin, self.cell, *self.shape, self.start, self.entries

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """The triangle under each point (n, 2) and barycentric coordinates (n, 3) in it.

        A point outside every triangle gets the nearest one and the coordinates of the nearest point of that.
        """
        found: tuple[IntArray, FloatArray] = locate(np.ascontiguousarray(points), self.triangles, *self._lattice)
        return found

    def column(self, points: FloatArray, clearance: float) -> tuple[FloatArray, FloatArray]:
        """Vertical rays from points (n, 3): distance in mm to the next triangle above and below, inf where none.

        Nearer than `clearance` mm does not count, so that a ray does not hit the triangle it starts on.
        """
        gaps: tuple[FloatArray, FloatArray] = column(
            np.ascontiguousarray(points), clearance, self.triangles, *self._lattice
        )
        return gaps

    def cut(self, points: FloatArray, starts: IntArray) -> tuple[FloatArray, IntArray]:
        """Polylines with a point added wherever they cross an edge of a triangle.

        Polyline i is points[starts[i] : starts[i + 1]], (n, 2) mm; the answer has the same form.
        """
        lines: tuple[FloatArray, IntArray] = cut(np.ascontiguousarray(points), starts, self.triangles, *self._lattice)
        return lines


def build_grid(triangles: FloatArray) -> Grid:
    """Buckets over triangles (m, 3, 3) mm, m >= 1, about as many as there are triangles."""
    triangles = np.ascontiguousarray(triangles, dtype=np.float64)
    low = triangles[:, :, :2].min(axis=(0, 1)) - 1e-6
    high = triangles[:, :, :2].max(axis=(0, 1)) + 1e-6
    cell = float(np.sqrt(np.prod(high - low) / np.clip(len(triangles), 16, 1 << 21)))
    cell = max(cell, float((high - low).max()) / 4096, 1e-3)
    while True:
        shape = (int((high[0] - low[0]) / cell) + 1, int((high[1] - low[1]) / cell) + 1)
        count = bucket_count(triangles, low, cell, *shape)
        if count.sum() <= MOST_ENTRIES * len(triangles) + 100_000:
            break
        cell *= 2
    start = np.zeros(len(count) + 1, np.int64)
    np.cumsum(count, out=start[1:])
    return Grid(triangles, low, cell, shape, start, bucket(triangles, low, cell, *shape, start))
