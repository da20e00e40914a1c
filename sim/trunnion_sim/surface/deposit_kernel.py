"""The loop that lays beads on a grid, in order: see `deposit` for the model.

Rows that lay plastic without a break are one bead. It is cut into even steps of about two cells. A cursor that runs
half a bore ahead reads, at every step, the gap across the path; the mean of these profiles over the bore is what the
section is solved for; the slab of the step is drawn with it. A bead never takes itself for what is there: of cells
that it touched within the last `own` mm of its way the height before counts.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_sim.surface.draw_kernel import Frame, Grid, draw
from trunnion_sim.surface.section_kernel import REACH, section

_F = NDArray[np.float64]
_G = NDArray[np.float32]
_B = NDArray[np.bool_]

STEEPEST = 0.2
"""Least Z of the normal of a swept surface (78 degrees) that a height field can hold."""
MARGIN = 3.0
"""mm beyond the field where beads are still followed."""
RELAX = 2.0
"""mm of way over which plastic that found no room comes out after all: pressure advance of 0.05 s at 40 mm/s."""
MOST_RELAXED = 0.25
"""Share of a bead's area that may come or go that way."""
MOST_PIECES = 50_000
"""Of one bead; longer ones are laid in parts."""
OPEN = 1.1 * REACH
"""In thread diameters: what is deeper than this is open, however deep, so that a bead does not sink into a slit."""
SHARP = 0.5
"""Cosine of the turn beyond which a corner is closed by a disc instead of a mitre."""


@njit(cache=True)
def run(
    grid: Grid,
    starts: _F,
    ends: _F,
    axes: _F,
    volumes: _F,
    present: _B,
    rows: NDArray[np.int64],
    flat: float,
    bore: float,
    stats: _F,
    depth_point: _G,
    final: bool,
    state: _F,
) -> int:
    """Execute pieces; returns how many: unless they are the `final` ones, a bead that may go on is left for later.

    Fills the grid, depth_point, and of stats (5, n) gap x length, length, unsupported, bulged, depth. `state` (5,) is
    handed on from call to call: mm³ kept on the grid, laid beyond it, not laid, owed to the next step; number of the
    last step.
    """
    ny, nx = grid.material.shape
    low_x, high_x = grid.x - MARGIN, grid.x + (nx - 1) * grid.cell + MARGIN
    low_y, high_y = grid.y - MARGIN, grid.y + (ny - 1) * grid.cell + MARGIN
    m = 0
    while m < len(rows):
        p, q = starts[m], ends[m]
        if not present[m]:
            m += 1
            continue
        if max(p[0], q[0]) < low_x or min(p[0], q[0]) > high_x or max(p[1], q[1]) < low_y or min(p[1], q[1]) > high_y:
            state[1] += volumes[m]
            m += 1
            continue
        if volumes[m] <= 0:
            _travel(grid, p, q, rows[m], stats, depth_point)
            m += 1
            continue
        length, frame = frame_of(p, q, axes[m])
        if length < 1e-9 or frame.nz < STEEPEST:
            state[2] += volumes[m]
            m += 1
            continue
        last = m
        way = length
        while last + 1 < len(rows) and last - m < MOST_PIECES and _goes_on(starts, ends, volumes, present, last):
            length, frame = frame_of(starts[last + 1], ends[last + 1], axes[last + 1])
            if length >= 1e-9 and frame.nz < STEEPEST:
                break
            last += 1
            way += length
        if last + 1 == len(rows) and last - m < MOST_PIECES and not final:
            return m
        _bead(grid, starts, ends, axes, volumes, rows, m, last, way, flat, bore, stats, state)
        m = last + 1
    return m


@njit(cache=True)
def _bead(
    grid: Grid,
    starts: _F,
    ends: _F,
    axes: _F,
    volumes: _F,
    rows: NDArray[np.int64],
    first: int,
    last: int,
    way: float,
    flat: float,
    bore: float,
    stats: _F,
    state: _F,
) -> None:
    """Lay one bead, pieces `first` to `last`, `way` mm long."""
    count = max(1, math.ceil(way / (2 * grid.cell)))
    pitch = way / count
    ahead = min(count - 1, math.ceil(bore / 2 / pitch - 0.5)) if pitch < bore else 0
    du = min(grid.cell, bore / 8)
    mid = math.ceil((flat + bore / 2) / du)
    ring = 2 * ahead + 2
    gaps, pores = np.zeros((ring, 2 * mid + 1)), np.zeros((ring, 2 * mid + 1))
    areas, under = np.zeros(ring), np.zeros(ring)
    total = volumes[first : last + 1].sum()
    thread = math.sqrt(4 * total / way / math.pi)
    own = min(count, math.ceil(max(1.5 * thread, bore) / pitch)) + 2
    base = int(state[4]) + own + 1
    state[4] = base + count
    reader, read_off, read_volume, fed = first, 0.0, 0.0, 0.0  # the cursor ahead
    reading = 0
    current = -1
    bead = section(np.ones(3), np.zeros(3), du, 0.1, 0.0, 0.0, flat, bore, 1.0)
    off = 0.0
    previous = Frame(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    started = False
    for m in range(first, last + 1):
        length, frame = frame_of(starts[m], ends[m], axes[m])
        if length < 1e-9:
            state[3] += volumes[m]
            continue
        p, row = starts[m], rows[m]
        mitre_start, sharp = _mitre(previous, frame) if started else (0.0, False)
        mitre_end = 0.0
        for k in range(m + 1, last + 1):
            size, following = frame_of(starts[k], ends[k], axes[k])
            if size >= 1e-9:
                mitre_end, _ = _mitre(frame, following)
                break
        density = volumes[m] / length
        at = 0.0
        while at < length - 1e-9:
            step = min(count - 1, math.floor((off + at) / pitch + 1e-9))
            if step > current:
                current = step
                while reading < min(count, current + ahead + 1):
                    middle = (reading + 0.5) * pitch
                    while reader < last and read_off + _way(starts[reader], ends[reader]) < middle:
                        read_off += _way(starts[reader], ends[reader])
                        read_volume += volumes[reader]
                        reader += 1
                    slot = reading % ring
                    until = _volume_at(starts, ends, volumes, reader, last, read_off, read_volume, middle + pitch / 2)
                    areas[slot] = (until - fed) / pitch
                    fed = until
                    size, there = frame_of(starts[reader], ends[reader], axes[reader])
                    f = middle - read_off
                    _profile(grid, starts[reader], f, there, du, base + reading - own, gaps[slot], pores[slot])
                    under[slot] = gaps[slot, mid]
                    reading += 1
                gap, pore = np.zeros(2 * mid + 1), np.zeros(2 * mid + 1)
                area, weights, nearest = 0.0, 0.0, np.inf
                begin, end = max(0, current - ahead), min(count, current + ahead + 1)
                thickest = max(1e-6, max([areas[k % ring] for k in range(begin, end)])) * (1 + MOST_RELAXED)
                deepest = OPEN * math.sqrt(4 * thickest / math.pi)
                for k in range(begin, end):
                    weight = min(1.0, (bore / 2 / pitch - abs(k - current)) + 0.5) if k != current else 1.0
                    if weight <= 0:
                        continue
                    gap += weight * np.minimum(gaps[k % ring], deepest)
                    pore += weight * pores[k % ring]
                    area += weight * areas[k % ring]
                    weights += weight
                    nearest = min(nearest, under[k % ring])
                gap /= weights
                pore /= weights
                area = max(area / weights, 1e-6)
                extra = min(max(state[3] / RELAX, -MOST_RELAXED * area), MOST_RELAXED * area)
                waits = max(extra, 0.0)
                due = waits if extra < MOST_RELAXED * area else np.inf
                bead = section(gap, pore, du, area + extra, waits, due, flat, bore, nearest)
            stop = length if current == count - 1 else min(length, (current + 1) * pitch - off)
            if stop <= at:
                stop = min(length, at + 1e-9)
            size = stop - at
            x = p[0] + frame.tx * (at + stop) / 2
            y = p[1] + frame.ty * (at + stop) / 2
            z = p[2] + frame.tz * (at + stop) / 2
            added, cut = 0.0, False
            if at == 0.0 and sharp:
                added, cut = draw(
                    grid, p[0], p[1], p[2], frame, 0.0, 0.0, 0.0, True, bead, base + current, base + current - own
                )
            more, cut_more = draw(
                grid,
                x,
                y,
                z,
                frame,
                size / 2,
                mitre_start if at == 0.0 else 0.0,
                mitre_end if stop == length else 0.0,
                False,
                bead,
                base + current,
                base + current - own,
            )
            added += more
            state[0] += added
            if cut or cut_more:
                state[1] += density * size - added
            else:
                state[3] += density * size - added
            stats[0, row] += under[current % ring] * size
            stats[1, row] += size
            stats[2, row] += bead.unsupported * size
            stats[3, row] += bead.bulged * size
            at = stop
        off += length
        previous = frame
        started = True


@njit(cache=True)
def _profile(grid: Grid, p: _F, at: float, frame: Frame, du: float, since: int, gaps: _F, pores: _F) -> None:
    """Gaps and pores across the path, `at` mm on from p, at right angles to the bead; outside, the bed."""
    ny, nx = grid.material.shape
    mid = len(gaps) // 2
    x, y, z = p[0] + at * frame.tx, p[1] + at * frame.ty, p[2] + at * frame.tz
    for k in range(-mid, mid + 1):
        u = k * du
        fx, fy = (x + u * frame.bx - grid.x) / grid.cell, (y + u * frame.by - grid.y) / grid.cell
        i, j = math.floor(fx), math.floor(fy)
        height, pore = 0.0, 0.0
        if 0 <= i < nx - 1 and 0 <= j < ny - 1:
            fx -= i
            fy -= j
            for dj in range(2):
                for di in range(2):
                    weight = (fx if di else 1 - fx) * (fy if dj else 1 - fy)
                    if grid.stamp[j + dj, i + di] > since:
                        height += weight * grid.before[j + dj, i + di]
                    else:
                        height += weight * grid.material[j + dj, i + di]
                        pore += weight * grid.pores[j + dj, i + di]
        gaps[mid + k] = (z + u * frame.bz - height) * frame.nz
        pores[mid + k] = pore * frame.nz


@njit(cache=True)
def _travel(grid: Grid, p: _F, q: _F, row: int, stats: _F, depth_point: _G) -> None:
    """How deep the tip dips below the surface on a travel.

    Bulges do not count: they are soft, rose behind a nozzle at this height, and the next one presses them flat.
    """
    ny, nx = grid.material.shape
    length = _way(p, q)
    if length < 1e-9:
        return
    n = max(1, math.ceil(length / grid.cell))
    for s in range(n + 1):
        f = s / n
        x, y, z = p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1]), p[2] + f * (q[2] - p[2])
        i, j = round((x - grid.x) / grid.cell), round((y - grid.y) / grid.cell)
        if 0 <= i < nx and 0 <= j < ny:
            depth = grid.material[j, i] - grid.bulge[j, i] - z
            if grid.material[j, i] > 0 and depth > stats[4, row]:
                stats[4, row] = depth
                depth_point[row, 0] = x
                depth_point[row, 1] = y
                depth_point[row, 2] = z


@njit(cache=True)
def frame_of(p: _F, q: _F, a: _F) -> tuple[float, Frame]:
    """Length of a piece and its frame; nz is 0 where the tool lies along the path."""
    tx, ty, tz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    size = max(length, 1e-12)
    tx, ty, tz = tx / size, ty / size, tz / size
    bx, by, bz = a[1] * tz - a[2] * ty, a[2] * tx - a[0] * tz, a[0] * ty - a[1] * tx
    size = math.sqrt(bx * bx + by * by + bz * bz)
    if size < 1e-6:
        return length, Frame(tx, ty, tz, bx, by, bz, 0.0)
    bx, by, bz = bx / size, by / size, bz / size
    return length, Frame(tx, ty, tz, bx, by, bz, tx * by - ty * bx)


@njit(cache=True)
def _mitre(before: Frame, after: Frame) -> tuple[float, bool]:
    """Tangent of half the turn between two pieces, positive towards `across`; 0 and True where it is too sharp."""
    cosine = before.tx * after.tx + before.ty * after.ty + before.tz * after.tz
    if cosine < SHARP:
        return 0.0, True
    sine = before.bx * after.tx + before.by * after.ty + before.bz * after.tz
    return sine / (1 + cosine), False


@njit(cache=True)
def _way(p: _F, q: _F) -> float:
    return float(math.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2))


@njit(cache=True)
def _volume_at(
    starts: _F, ends: _F, volumes: _F, piece: int, last: int, off: float, volume: float, way: float
) -> float:
    """mm³ of the bead fed up to `way` mm; `piece` begins at `off` mm with `volume` fed."""
    while piece <= last:
        length = _way(starts[piece], ends[piece])
        if off + length >= way:
            return float(volume + volumes[piece] * (way - off) / max(length, 1e-12))
        off += length
        volume += volumes[piece]
        piece += 1
    return volume


@njit(cache=True)
def _goes_on(starts: _F, ends: _F, volumes: _F, present: _B, m: int) -> bool:
    """Whether the bead of piece m goes on in the next."""
    return bool(present[m + 1] and volumes[m + 1] > 0) and bool(
        abs(starts[m + 1, 0] - ends[m, 0]) + abs(starts[m + 1, 1] - ends[m, 1]) + abs(starts[m + 1, 2] - ends[m, 2])
        < 1e-6
    )
