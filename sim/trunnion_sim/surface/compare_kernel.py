"""Loops of the comparison: topmost facet under points, heights of a field, distance to a field's surface."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]
_G = NDArray[np.float32]


@njit(cache=True)
def topmost(triangles: _F, xy: _F) -> tuple[_F, NDArray[np.int64]]:
    """Highest facet over each point: height and row. Points are sorted into buckets, facets look up theirs."""
    n = len(xy)
    z = np.full(n, np.nan)
    face = np.full(n, -1, np.int64)
    if n == 0:
        return z, face
    x0, y0 = xy[:, 0].min(), xy[:, 1].min()
    x1, y1 = xy[:, 0].max(), xy[:, 1].max()
    size = max(1e-6, math.sqrt(max(x1 - x0, 1e-6) * max(y1 - y0, 1e-6) / n) * 2)
    nx, ny = int((x1 - x0) / size) + 1, int((y1 - y0) / size) + 1
    count = np.zeros(nx * ny + 1, np.int64)
    bucket = np.empty(n, np.int64)
    for p in range(n):
        bucket[p] = int((xy[p, 1] - y0) / size) * nx + int((xy[p, 0] - x0) / size)
        count[bucket[p] + 1] += 1
    for c in range(nx * ny):
        count[c + 1] += count[c]
    fill = count.copy()
    order = np.empty(n, np.int64)
    for p in range(n):
        order[fill[bucket[p]]] = p
        fill[bucket[p]] += 1
    for f in range(len(triangles)):
        ax, ay, az = triangles[f, 0]
        bx, by, bz = triangles[f, 1]
        cx, cy, cz = triangles[f, 2]
        det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(det) < 1e-14:
            continue
        i0 = max(0, int((min(ax, bx, cx) - x0) / size))
        i1 = min(nx - 1, int((max(ax, bx, cx) - x0) / size))
        j0 = max(0, int((min(ay, by, cy) - y0) / size))
        j1 = min(ny - 1, int((max(ay, by, cy) - y0) / size))
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                c = j * nx + i
                for k in range(count[c], count[c + 1]):
                    p = order[k]
                    px, py = xy[p, 0] - ax, xy[p, 1] - ay
                    u = (px * (cy - ay) - (cx - ax) * py) / det
                    v = ((bx - ax) * py - px * (by - ay)) / det
                    if u >= -1e-9 and v >= -1e-9 and u + v <= 1 + 1e-9:
                        height = az + u * (bz - az) + v * (cz - az)
                        if face[p] < 0 or height > z[p]:
                            z[p] = height
                            face[p] = f
    return z, face


@njit(cache=True)
def field_heights(top: _G, x0: float, y0: float, cell: float, xy: _F) -> _F:
    """Height of a field at points, bilinear between cells; 0 outside."""
    ny, nx = top.shape
    z = np.zeros(len(xy))
    for p in range(len(xy)):
        fx, fy = (xy[p, 0] - x0) / cell, (xy[p, 1] - y0) / cell
        i, j = math.floor(fx), math.floor(fy)
        if 0 <= i < nx - 1 and 0 <= j < ny - 1:
            fx -= i
            fy -= j
            z[p] = (top[j, i] * (1 - fx) + top[j, i + 1] * fx) * (1 - fy) + (
                top[j + 1, i] * (1 - fx) + top[j + 1, i + 1] * fx
            ) * fy
    return z


@njit(cache=True)
def distance_to_field(top: _G, x0: float, y0: float, cell: float, points: _F, bound: _F) -> _F:
    """Distance of points (n, 3) to the surface of a field, two triangles a cell, in rings up to a known `bound`."""
    ny, nx = top.shape
    result = bound.copy()
    for p in range(len(points)):
        best = bound[p]
        x, y, z = points[p]
        ci, cj = math.floor((x - x0) / cell), math.floor((y - y0) / cell)
        ring = 0
        while (ring - 1) * cell < best:
            for j in range(cj - ring, cj + ring + 1):
                edge = j == cj - ring or j == cj + ring
                step = 1 if edge or ring == 0 else 2 * ring
                for i in range(ci - ring, ci + ring + 1, step):
                    if not (0 <= i < nx - 1 and 0 <= j < ny - 1):
                        continue
                    low = min(top[j, i], top[j, i + 1], top[j + 1, i], top[j + 1, i + 1])
                    high = max(top[j, i], top[j, i + 1], top[j + 1, i], top[j + 1, i + 1])
                    if low - z >= best or z - high >= best:
                        continue
                    dx, dy = x - (x0 + i * cell), y - (y0 + j * cell)
                    best = min(
                        best,
                        _triangle(dx, dy, z, cell, top[j, i], top[j, i + 1], top[j + 1, i]),
                        _triangle(cell - dx, cell - dy, z, cell, top[j + 1, i + 1], top[j + 1, i], top[j, i + 1]),
                    )
            ring += 1
        result[p] = best
    return result


@njit(cache=True)
def _triangle(px: float, py: float, pz: float, cell: float, za: float, zb: float, zc: float) -> float:
    """Distance of a point to the triangle (0, 0, za), (cell, 0, zb), (0, cell, zc)."""
    pz -= za
    bz, cz = zb - za, zc - za
    # barycentric coordinates of the foot on the plane (Ericson, Real-Time Collision Detection, 5.1.5)
    bb, cc, bc = cell * cell + bz * bz, cell * cell + cz * cz, bz * cz
    pb, pc = px * cell + pz * bz, py * cell + pz * cz
    det = bb * cc - bc * bc
    u, v = (pb * cc - pc * bc) / det, (pc * bb - pb * bc) / det
    if u >= 0 and v >= 0 and u + v <= 1:
        dx, dy, dz = px - u * cell, py - v * cell, pz - u * bz - v * cz
        return math.sqrt(dx * dx + dy * dy + dz * dz)
    s = min(1.0, max(0.0, pb / bb))
    best = math.sqrt((px - s * cell) ** 2 + py**2 + (pz - s * bz) ** 2)
    s = min(1.0, max(0.0, pc / cc))
    best = min(best, math.sqrt(px**2 + (py - s * cell) ** 2 + (pz - s * cz) ** 2))
    # edge from b to c
    ez = cz - bz
    s = ((px - cell) * -cell + py * cell + (pz - bz) * ez) / (2 * cell * cell + ez * ez)
    s = min(1.0, max(0.0, s))
    return min(best, math.sqrt((px - cell + s * cell) ** 2 + (py - s * cell) ** 2 + (pz - bz - s * ez) ** 2))
