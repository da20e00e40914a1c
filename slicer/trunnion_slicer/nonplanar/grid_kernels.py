"""The loops of `grid.py`, compiled: over buckets, over the triangles in them, over the buckets a line runs through."""

from typing import Any

import numpy as np
from numba import njit

INSIDE = -1e-9
"""Barycentric coordinate down to which a point counts as inside: rounding, no more."""


@njit(cache=True)
def bucket_count(triangles: Any, origin: Any, cell: float, nx: int, ny: int) -> Any:
    """How many triangles touch each bucket."""
    count = np.zeros(nx * ny, np.int64)
    for t in range(len(triangles)):
        x0, x1, y0, y1 = _cells_of(triangles[t], origin, cell, nx, ny)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                count[y * nx + x] += 1
    return count


@njit(cache=True)
def bucket(triangles: Any, origin: Any, cell: float, nx: int, ny: int, start: Any) -> Any:
    """The triangles of every bucket, one bucket after the other."""
    entries = np.empty(start[-1], np.int64)
    place = start[:-1].copy()
    for t in range(len(triangles)):
        x0, x1, y0, y1 = _cells_of(triangles[t], origin, cell, nx, ny)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                entries[place[y * nx + x]] = t
                place[y * nx + x] += 1
    return entries


@njit(cache=True)
def locate(points: Any, triangles: Any, origin: Any, cell: float, nx: int, ny: int, start: Any, entries: Any) -> Any:
    """Triangle and barycentric coordinates under each point, of the nearest triangle where none is."""
    n = len(points)
    found = np.empty(n, np.int64)
    weights = np.empty((n, 3))
    for i in range(n):
        px, py = points[i, 0], points[i, 1]
        cx = min(max(int((px - origin[0]) / cell), 0), nx - 1)
        cy = min(max(int((py - origin[1]) / cell), 0), ny - 1)
        best, best_score = -1, INSIDE
        for e in range(start[cy * nx + cx], start[cy * nx + cx + 1]):
            b = _barycentric(px, py, triangles[entries[e]])
            score = min(b[0], min(b[1], b[2]))
            if score >= best_score:
                best, best_score = entries[e], score
                weights[i, 0], weights[i, 1], weights[i, 2] = b
        if best < 0:
            best = _nearest(px, py, cx, cy, weights[i], triangles, origin, cell, nx, ny, start, entries)
        found[i] = best
    return found, weights


@njit(cache=True)
def column(
    points: Any,
    clearance: float,
    triangles: Any,
    origin: Any,
    cell: float,
    nx: int,
    ny: int,
    start: Any,
    entries: Any,
) -> Any:
    """Distance to the next triangle above and below every point."""
    n = len(points)
    above = np.full(n, np.inf)
    below = np.full(n, np.inf)
    for i in range(n):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        cx = int((px - origin[0]) / cell)
        cy = int((py - origin[1]) / cell)
        if px < origin[0] or py < origin[1] or cx >= nx or cy >= ny:
            continue
        for e in range(start[cy * nx + cx], start[cy * nx + cx + 1]):
            corners = triangles[entries[e]]
            b = _barycentric(px, py, corners)
            if min(b[0], min(b[1], b[2])) < INSIDE:
                continue
            gap = b[0] * corners[0, 2] + b[1] * corners[1, 2] + b[2] * corners[2, 2] - pz
            if gap > clearance:
                above[i] = min(above[i], gap)
            elif -gap > clearance:
                below[i] = min(below[i], -gap)
    return above, below


@njit(cache=True)
def cut(
    points: Any, starts: Any, triangles: Any, origin: Any, cell: float, nx: int, ny: int, start: Any, entries: Any
) -> Any:
    """Polylines with a point wherever they cross a triangle's edge."""
    room = 4 * len(points) + 64
    out = np.empty((room, 2))
    out_starts = np.zeros(len(starts), np.int64)
    crossing = np.empty(256)
    n = 0
    for line in range(len(starts) - 1):
        for i in range(starts[line], starts[line + 1]):
            out[n] = points[i]
            n += 1
            hits = 0
            if i + 1 < starts[line + 1]:
                hits, crossing = _crossings(
                    points[i], points[i + 1], crossing, triangles, origin, cell, nx, ny, start, entries
                )
            if n + hits + 2 > room:
                room = 2 * (room + hits)
                larger = np.empty((room, 2))
                larger[:n] = out[:n]
                out = larger
            if hits:
                step = points[i + 1] - points[i]
                least = 1e-6 / (np.hypot(step[0], step[1]) + 1e-12)
                last = 0.0
                for t in np.sort(crossing[:hits]):
                    if t - last > least and 1.0 - t > least:
                        out[n] = points[i] + t * step
                        n += 1
                        last = t
        out_starts[line + 1] = n
    return out[:n].copy(), out_starts


@njit(cache=True)
def _cells_of(corners: Any, origin: Any, cell: float, nx: int, ny: int) -> Any:
    """First and last bucket in X and Y that the box of a triangle touches."""
    x0 = int((min(corners[0, 0], min(corners[1, 0], corners[2, 0])) - origin[0]) / cell)
    x1 = int((max(corners[0, 0], max(corners[1, 0], corners[2, 0])) - origin[0]) / cell)
    y0 = int((min(corners[0, 1], min(corners[1, 1], corners[2, 1])) - origin[1]) / cell)
    y1 = int((max(corners[0, 1], max(corners[1, 1], corners[2, 1])) - origin[1]) / cell)
    return max(x0, 0), min(x1, nx - 1), max(y0, 0), min(y1, ny - 1)


@njit(cache=True)
def _barycentric(px: float, py: float, corners: Any) -> Any:
    """Coordinates of a point in the triangle seen from above; (-1, -1, -1) where that is edge-on."""
    ax, ay = corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1]
    bx, by = corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1]
    qx, qy = px - corners[0, 0], py - corners[0, 1]
    twice_area = ax * by - ay * bx
    if abs(twice_area) < 1e-14:
        return -1.0, -1.0, -1.0
    v = (qx * by - qy * bx) / twice_area
    w = (ax * qy - ay * qx) / twice_area
    return 1.0 - v - w, v, w


@njit(cache=True)
def _nearest(
    px: float,
    py: float,
    cx: int,
    cy: int,
    weights: Any,
    triangles: Any,
    origin: Any,
    cell: float,
    nx: int,
    ny: int,
    start: Any,
    entries: Any,
) -> int:
    """The triangle with the edge nearest to a point, searched ring by ring of buckets; fills `weights`."""
    best, nearest = -1, np.inf
    for ring in range(max(nx, ny) + 1):
        if ring > 1 and nearest <= ((ring - 1) * cell) ** 2:
            break
        for y in range(max(cy - ring, 0), min(cy + ring, ny - 1) + 1):
            inner = abs(y - cy) < ring
            for x in range(max(cx - ring, 0), min(cx + ring, nx - 1) + 1):
                if inner and abs(x - cx) < ring:
                    continue
                for e in range(start[y * nx + x], start[y * nx + x + 1]):
                    corners = triangles[entries[e]]
                    for k in range(3):
                        j = (k + 1) % 3
                        ex, ey = corners[j, 0] - corners[k, 0], corners[j, 1] - corners[k, 1]
                        length = ex * ex + ey * ey
                        t = 0.0
                        if length > 0:
                            t = ((px - corners[k, 0]) * ex + (py - corners[k, 1]) * ey) / length
                            t = min(max(t, 0.0), 1.0)
                        d = (px - corners[k, 0] - t * ex) ** 2 + (py - corners[k, 1] - t * ey) ** 2
                        if d < nearest:
                            best, nearest = entries[e], d
                            weights[:] = 0.0
                            weights[k] = 1.0 - t
                            weights[j] = t
    return best


@njit(cache=True)
def _crossings(
    a: Any,
    b: Any,
    crossing: Any,
    triangles: Any,
    origin: Any,
    cell: float,
    nx: int,
    ny: int,
    start: Any,
    entries: Any,
) -> Any:
    """Where the piece a-b crosses edges, as shares of its length in `crossing` (grown as needed), unsorted.

    Row by row of buckets: the piece covers an interval of columns in each.
    """
    hits = 0
    dx, dy = b[0] - a[0], b[1] - a[1]
    low = min(a[1], b[1])
    high = max(a[1], b[1])
    y0 = min(max(int((low - origin[1]) / cell), 0), ny - 1)
    y1 = min(max(int((high - origin[1]) / cell), 0), ny - 1)
    for y in range(y0, y1 + 1):
        xa, xb = a[0], b[0]
        if abs(dy) > 1e-12:
            ta = (origin[1] + y * cell - a[1]) / dy
            tb = (origin[1] + (y + 1) * cell - a[1]) / dy
            xa = a[0] + dx * min(max(ta, 0.0), 1.0)
            xb = a[0] + dx * min(max(tb, 0.0), 1.0)
        x0 = min(max(int((min(xa, xb) - 1e-9 - origin[0]) / cell), 0), nx - 1)
        x1 = min(max(int((max(xa, xb) + 1e-9 - origin[0]) / cell), 0), nx - 1)
        for x in range(x0, x1 + 1):
            for e in range(start[y * nx + x], start[y * nx + x + 1]):
                corners = triangles[entries[e]]
                for k in range(3):
                    j = (k + 1) % 3
                    ex, ey = corners[j, 0] - corners[k, 0], corners[j, 1] - corners[k, 1]
                    qx, qy = corners[k, 0] - a[0], corners[k, 1] - a[1]
                    cross = dx * ey - dy * ex
                    if cross == 0.0:
                        continue
                    t = (qx * ey - qy * ex) / cross
                    u = (qx * dy - qy * dx) / cross
                    if 0.0 < t < 1.0 and -1e-9 <= u <= 1.0 + 1e-9:
                        if hits == len(crossing):
                            larger = np.empty(2 * hits)
                            larger[:hits] = crossing
                            crossing = larger
                        crossing[hits] = t
                        hits += 1
    return hits, crossing
