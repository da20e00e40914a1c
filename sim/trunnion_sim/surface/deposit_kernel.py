"""The loop that lays beads on a height field: see `deposit` for the model.

Five numbers a cell: the surface, the surface before the bead that is being laid came by, the way of the tip at which it
came by, how much of the column below is pores, and how much of the surface is a bulge behind the nozzle. A bead never
takes itself for what is there: of cells that it touched within the last `own` mm of its way the surface before counts.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]
_G = NDArray[np.float32]

STEEPEST = 0.2
"""Least Z of the normal of a swept surface (78 degrees) that a height field can hold."""
WIDEN = 1.25
"""How far a bead that has no room on one side may grow on the other, relative to its half width."""
SEAM = 1e-6
"""mm by which slabs overlap, so that rounding leaves no cell between them."""
BLOCKED = 0.75
"""Where the gap under a bead is smaller than this share of what it is elsewhere, a neighbour stands."""
ASIDE = 0.5
"""Share of the plastic without room that goes to the free side; the rest rises behind the nozzle."""
TAKEN = 0.35
"""In thread diameters: a gap so small that the place counts as taken."""
REACH = 1.5
"""In thread diameters: gap up to which a thread falls onto what is below."""


@njit(cache=True)
def run(
    top: _G,
    x0: float,
    y0: float,
    cell: float,
    rows: NDArray[np.int64],
    starts: _F,
    ends: _F,
    axes: _F,
    volumes: _F,
    present: NDArray[np.bool_],
    flat: float,
    bore: float,
    stats: _F,
    depth_point: _F,
    begin: int,
    end: int,
    before: _G,
    stamp: _F,
    pores: _G,
    bulge: _G,
    memory: _F,
) -> None:
    """Execute the pieces `begin` to `end`; those around them are what the bore reaches over.

    Fills top, depth_point, and of stats: gap x length, length, unsupported, crowded, bulged, depth, taken x length.
    before, stamp, pores, bulge and memory (7,) are what one call hands on to the next: memory is the way of the tip,
    the direction of the last bead and where it ended.
    """
    ny, nx = top.shape
    way = memory[0]
    last_t = memory[1:4]
    last_end = memory[4:7]
    result = np.zeros(9)
    spots = np.zeros((max(1, round(bore / (2 * cell))), 7))
    x1, y1 = x0 + (nx - 1) * cell, y0 + (ny - 1) * cell
    for m in range(begin, end):
        if not present[m]:
            last_end[:] = np.nan
            continue
        p, q, a = starts[m], ends[m], axes[m]
        length = math.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2)
        if length < 1e-9:
            continue
        row = rows[m]
        margin = 3.0
        if (
            max(p[0], q[0]) < x0 - margin
            or min(p[0], q[0]) > x1 + margin
            or max(p[1], q[1]) < y0 - margin
            or min(p[1], q[1]) > y1 + margin
        ):
            last_end[:] = np.nan
            way += length
            continue
        if volumes[m] <= 0:
            _travel(top, bulge, x0, y0, cell, p, q, length, row, stats, depth_point)
            last_end[:] = np.nan
            way += 1e3  # whatever was laid before is what is there
            continue
        t = (q - p) / length
        b = np.array([a[1] * t[2] - a[2] * t[1], a[2] * t[0] - a[0] * t[2], a[0] * t[1] - a[1] * t[0]])
        size = math.sqrt(b[0] ** 2 + b[1] ** 2 + b[2] ** 2)
        if size < 1e-6:
            way += length
            continue
        b /= size
        normal_z = t[0] * b[1] - t[1] * b[0]
        if normal_z < STEEPEST:
            way += length
            last_end[:] = np.nan
            continue
        area = volumes[m] / length
        steps = max(1, math.ceil(length / (2 * cell)))
        step = length / steps
        own = max(1.5 * math.sqrt(4 * area / math.pi), bore) + 2 * step
        joined = abs(p[0] - last_end[0]) + abs(p[1] - last_end[1]) + abs(p[2] - last_end[2]) < 1e-6
        turned = joined and t[0] * last_t[0] + t[1] * last_t[1] + t[2] * last_t[2] < 0.996
        for s in range(steps):
            c = p + t * ((s + 0.5) * step)
            here = way + (s + 0.5) * step
            _under_bore(starts, ends, axes, volumes, present, m, (s + 0.5) * step, bore, spots)
            area = spots[:, 6].mean()
            _section(top, before, stamp, pores, x0, y0, cell, c, b, normal_z, area, flat, here - own, spots, result)
            stats[row, 0] += result[3] * step
            stats[row, 1] += step
            stats[row, 2] += result[4] * step
            stats[row, 3] += result[5] * step
            stats[row, 4] += result[6] * step
            stats[row, 6] += result[8] * step
            if s == 0 and turned:
                _draw(top, before, stamp, pores, bulge, x0, y0, cell, p, t, b, normal_z, 0.0, True, result, here, own)
            _draw(top, before, stamp, pores, bulge, x0, y0, cell, c, t, b, normal_z, step / 2, False, result, here, own)
        way += length
        last_t[:] = t
        last_end[:] = q
    memory[0] = way


@njit(cache=True)
def _travel(
    top: _G,
    bulge: _G,
    x0: float,
    y0: float,
    cell: float,
    p: _F,
    q: _F,
    length: float,
    row: int,
    stats: _F,
    depth_point: _F,
) -> None:
    """How deep the tip dips below the surface on a travel; its two ends touch what it comes from and goes to.

    Bulges do not count: they are soft, rose behind a nozzle at this height, and the next one presses them flat.
    """
    ny, nx = top.shape
    n = max(1, math.ceil(length / cell))
    for s in range(n + 1):
        f = s / n
        x, y, z = p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1]), p[2] + f * (q[2] - p[2])
        i, j = round((x - x0) / cell), round((y - y0) / cell)
        if 0 <= i < nx and 0 <= j < ny:
            depth = top[j, i] - bulge[j, i] - z
            if top[j, i] > 0 and depth > stats[row, 5]:
                stats[row, 5] = depth
                depth_point[row, 0] = x
                depth_point[row, 1] = y
                depth_point[row, 2] = z


@njit(cache=True)
def _read(top: _G, before: _G, stamp: _F, x0: float, y0: float, cell: float, x: float, y: float, since: float) -> float:
    """Height of what is there at a point, between four cells; the bed outside the field."""
    ny, nx = top.shape
    fx, fy = (x - x0) / cell, (y - y0) / cell
    i, j = math.floor(fx), math.floor(fy)
    if i < 0 or j < 0 or i >= nx - 1 or j >= ny - 1:
        return 0.0
    fx -= i
    fy -= j
    z = 0.0
    for dj in range(2):
        for di in range(2):
            weight = (fx if di else 1 - fx) * (fy if dj else 1 - fy)
            there = before[j + dj, i + di] if stamp[j + dj, i + di] > since else top[j + dj, i + di]
            z += weight * there
    return z


@njit(cache=True)
def _under_bore(
    starts: _F, ends: _F, axes: _F, volumes: _F, present: NDArray[np.bool_], m: int, at: float, bore: float, spots: _F
) -> None:
    """Where the tip is within half a bore before and behind `at` mm on piece m; where the bead ends, its end.

    spots (k, 7): the point, the unit vector to the right of the path and the bead's area there, k spread evenly over
    the bore.
    """
    count = len(spots)
    for k in range(count):
        piece = m
        s = at + ((k + 0.5) / count - 0.5) * bore
        length = _way(starts[piece], ends[piece])
        while s > length and piece + 1 < len(starts) and _goes_on(starts, ends, volumes, present, piece):
            s -= length
            piece += 1
            length = _way(starts[piece], ends[piece])
        while s < 0 and piece > 0 and _goes_on(starts, ends, volumes, present, piece - 1):
            piece -= 1
            length = _way(starts[piece], ends[piece])
            s += length
        spots[k, 6] = volumes[piece] / max(length, 1e-12)
        t = (ends[piece] - starts[piece]) / max(length, 1e-12)
        a = axes[piece]
        spots[k, :3] = starts[piece] + min(max(s, 0.0), length) * t
        b = np.array([a[1] * t[2] - a[2] * t[1], a[2] * t[0] - a[0] * t[2], a[0] * t[1] - a[1] * t[0]])
        spots[k, 3:6] = b / max(math.sqrt(b[0] ** 2 + b[1] ** 2 + b[2] ** 2), 1e-12)


@njit(cache=True)
def _way(p: _F, q: _F) -> float:
    return math.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2)


@njit(cache=True)
def _goes_on(starts: _F, ends: _F, volumes: _F, present: NDArray[np.bool_], m: int) -> bool:
    """Whether the bead of piece m goes on in the next."""
    return bool(present[m + 1] and present[m] and volumes[m + 1] > 0 and volumes[m] > 0) and bool(
        abs(starts[m + 1, 0] - ends[m, 0]) + abs(starts[m + 1, 1] - ends[m, 1]) + abs(starts[m + 1, 2] - ends[m, 2])
        < 1e-6
    )


@njit(cache=True)
def _gap(top: _G, before: _G, stamp: _F, x0: float, y0: float, cell: float, spots: _F, u: float, since: float) -> float:
    """Vertical gap `u` mm to the right of the path, mean over the spots under the bore."""
    total = 0.0
    for k in range(len(spots)):
        x, y = spots[k, 0] + u * spots[k, 3], spots[k, 1] + u * spots[k, 4]
        total += spots[k, 2] + u * spots[k, 5] - _read(top, before, stamp, x0, y0, cell, x, y, since)
    return total / len(spots)


@njit(cache=True)
def _section(
    top: _G,
    before: _G,
    stamp: _F,
    pores: _G,
    x0: float,
    y0: float,
    cell: float,
    c: _F,
    b: _F,
    normal_z: float,
    area: float,
    flat: float,
    since: float,
    spots: _F,
    result: _F,
) -> None:
    """The bead's section at point c, above the gap that the `spots` under the bore have on average.

    result: 0 left and 1 right half width, 2 height of the section, 3 gap below it, 4 whether unsupported,
    5 crowded and 6 bulged area, 7 how far the section's upper side lies above the path (negative: below), 8 share of
    the way across that is taken.
    """
    ny, nx = top.shape
    thread = math.sqrt(4 * area / math.pi)
    # the gap below
    under = np.empty(9)
    for k in range(9):
        u = (k - 4) * 0.1 * flat
        under[k] = _gap(top, before, stamp, x0, y0, cell, spots, u, since)
    typical = np.sort(under)[6]
    clear = min(typical, BLOCKED * typical)
    gap = 0.0
    count = 0
    result[8] = 0.0
    for k in range(9):
        if under[k] * normal_z < TAKEN * thread:
            result[8] += 1 / 9
        # what stands beside a neighbour was read between it and the open
        if min(under[k], under[max(k - 1, 0)], under[min(k + 1, 8)]) >= clear:
            gap += under[k] * normal_z
            count += 1
    gap = gap / count if count else typical * normal_z
    shift = 0.0
    if gap > thread:
        height = thread
        half = thread / 2
        if gap <= REACH * thread:
            shift = thread - gap
    else:
        height = max(gap, 0.1 * thread)
        half = ((area - math.pi / 4 * height**2) / height + height) / 2
    widest = flat + height
    bulged = 0.0
    if half > widest:
        bulged = (half - widest) * 2 * height
        half = widest
    # room on both sides, pores included
    du = cell / 2
    lack = np.zeros(2)
    contact = False
    reach = half + height / 2
    samples = math.ceil(reach / du)
    du_side = reach / samples
    wide = np.array([half, half])
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        room = 0.0
        filled = 0.0
        for k in range(samples):
            u = (k + 0.5) * reach / samples
            x, y = c[0] + sign * u * b[0], c[1] + sign * u * b[1]
            g = _gap(top, before, stamp, x0, y0, cell, spots, sign * u, since) * normal_z + shift
            room += min(max(g, 0.0), height)
            # where the gap opens sideways, the plastic is used up sooner: the bead ends where its area is spent
            deep = min(max(g, 0.0), max(height, thread))
            filled += deep * du_side
            if (
                u < wide[side]
                and filled - (1 - math.pi / 4) * max(deep, height) ** 2 / 2 > area / 2 + height * cell / 8
            ):
                wide[side] = u
            if u > 0.5 * half and g < 0.6 * height:
                contact = True
            i, j = round((x - x0) / cell), round((y - y0) / cell)
            if 0 <= i < nx and 0 <= j < ny and stamp[j, i] <= since and g < height:
                room += pores[j, i] * normal_z
        lack[side] = max(0.0, area / 2 - bulged / 2 - room * reach / samples - height * cell / 8)
    crowded = lack[0] + lack[1] + bulged
    # what lacks room on one side widens the other
    limit = WIDEN * half
    for side in range(2):
        need = lack[1 - side] * ASIDE
        rises = lack[1 - side] - need
        sign = -1.0 if side == 0 else 1.0
        if need > 0 and lack[side] == 0:
            while need > 0 and wide[side] < limit:
                u = wide[side] + du / 2
                g = _gap(top, before, stamp, x0, y0, cell, spots, sign * u, since) * normal_z + shift
                g = min(max(g, 0.0), height)
                if g * du >= need:
                    wide[side] += need / g
                    need = 0.0
                else:
                    wide[side] += du
                    need -= g * du
            lack[1 - side] = need + rises
    bulged += lack[0] + lack[1]
    result[0] = wide[0]
    result[1] = wide[1]
    result[2] = height
    result[3] = gap
    nearest = under.min()
    for k in range(len(spots)):  # a line that is crossed carries the bead, however little of the bore is over it
        nearest = min(nearest, spots[k, 2] - _read(top, before, stamp, x0, y0, cell, spots[k, 0], spots[k, 1], since))
    result[4] = 1.0 if (nearest * normal_z > REACH * thread and not contact) else 0.0
    result[5] = crowded
    result[6] = bulged
    result[7] = shift + bulged / (wide[0] + wide[1])


@njit(cache=True)
def _draw(
    top: _G,
    before: _G,
    stamp: _F,
    pores: _G,
    bulge: _G,
    x0: float,
    y0: float,
    cell: float,
    c: _F,
    t: _F,
    b: _F,
    normal_z: float,
    along: float,
    disc: bool,
    result: _F,
    here: float,
    own: float,
) -> None:
    """Raise the cells under a section: a slab of half length `along`, or the disc that closes the outside of a bend."""
    ny, nx = top.shape
    left, right, height, lift = result[0], result[1], result[2], result[7]
    radius = min(left, right)
    reach_x = SEAM + (radius if disc else abs(t[0]) * along + abs(b[0]) * max(left, right))
    reach_y = SEAM + (radius if disc else abs(t[1]) * along + abs(b[1]) * max(left, right))
    i0 = max(0, math.ceil((c[0] - reach_x - x0) / cell))
    i1 = min(nx - 1, math.floor((c[0] + reach_x - x0) / cell))
    j0 = max(0, math.ceil((c[1] - reach_y - y0) / cell))
    j1 = min(ny - 1, math.floor((c[1] + reach_y - y0) / cell))
    edge = min(height / 2, radius)
    raised = result[6] / max(left + right, 1e-9) / normal_z
    for j in range(j0, j1 + 1):
        dy = y0 + j * cell - c[1]
        for i in range(i0, i1 + 1):
            dx = x0 + i * cell - c[0]
            # (dx, dy) = v t + u b in projection
            v = (dx * b[1] - dy * b[0]) / normal_z
            u = (t[0] * dy - t[1] * dx) / normal_z
            if disc:
                inside = radius - math.sqrt(u * u + v * v)
            else:
                if abs(v) > along + SEAM:
                    continue
                inside = right - u if u >= 0 else left + u
            if inside <= 0:
                continue
            drop = 0.0
            if inside < edge:
                drop = edge - math.sqrt(edge * edge - (edge - inside) ** 2)
            upper = c[2] + v * t[2] + u * b[2] + (lift - drop) / normal_z
            if stamp[j, i] <= here - own:
                before[j, i] = top[j, i]
            lower = upper - (height - 2 * drop) / normal_z
            if upper > top[j, i]:
                hole = lower - before[j, i]
                pores[j, i] = max(0.0, hole)
                top[j, i] = upper
                bulge[j, i] = raised
            elif stamp[j, i] <= here - own:
                pores[j, i] = 0.0
            stamp[j, i] = here
