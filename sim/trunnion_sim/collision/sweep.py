"""Walk through a program's motion and find where a moving body enters what stands on the bed at that moment.

Between two rows the machine moves linearly in its joints. An interval of a row is proven free when, at its middle,
every body is farther from everything than it can move in half the interval; what cannot be proven is halved, down to
SMALLEST_STEP, where the middle itself decides. So nothing deeper than half of SMALLEST_STEP is missed between poses
(conservative advancement; Mirtich 1996, "Impulse-based dynamic simulation of rigid body systems", chapter 3).

Half an interval moves a point of a body, at distance r from the body's reference point, by at most
|chord|/2 + bow + r * turn/2: the chord is that of the reference point in `part`, turn the sum of the rotary joints'
steps, and bow <= (2 turn * slide + turn^2 * reach)/8 bounds how far the reference point's path leaves the chord
(Taylor).

Around the tip the nozzle touches plastic by design. For bodies of the tool, material counts only where it stands more
than PRESS above the plane of the tip.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_sim.collision.material import raise_bead
from trunnion_sim.collision.scene import BLOCK, CELL, Scene
from trunnion_sim.collision.solids import signed_distance

PRESS = 0.1 + 1e-4
"""mm above the plane of the tip up to which plastic may touch the nozzle: a bead's own squeeze, its soft neighbours;
and the rounding of heights, so that a step down by exactly 0.1 is not decided by it."""
SMALLEST_STEP = 0.05
"""mm that no point of a body moves beyond between two poses that decide."""
FAR = 1e9
CHUNK = 100_000
"""Rows between two collections of hits: what every row keeps for every body is kept for so many only."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Where bodies enter something: one entry for each row and body that does."""

    rows: IntArray
    body: IntArray
    depth: FloatArray
    """(h,) mm, the deepest point."""
    points: FloatArray
    """(h, 3) mm in `part`: where it is deepest."""
    clearance: float
    """mm: the smallest distance that was measured anywhere; infinite where nothing ever came near."""
    poses: int
    """How many poses were looked at."""


def sweep(
    scene: Scene,
    joints: FloatArray,
    tips: FloatArray,
    tool_axes: FloatArray,
    width: FloatArray,
    height: FloatArray,
    checked: BoolArray,
    first: tuple[FloatArray, FloatArray, FloatArray] | None = None,
) -> Hits:
    """Hits along joints (n, k): row i moves from joints[i-1] to joints[i] and lays a bead where width[i] > 0.

    tips (n, 3) mm and tool_axes (n, 3) in `part` belong to the rows' ends; width, height (n,) mm. Rows that are not
    `checked` (n,) are passed over, such as homing. Row 0 moves from `first` (its joints, tip and tool axis); without
    it, row 0 is only where row 1 starts.
    """
    ground = scene.ground
    cells = ground.copy()
    blocks = ground.reshape(ground.shape[0] // BLOCK, BLOCK, ground.shape[1] // BLOCK, BLOCK).max(axis=(1, 3))
    tiles = blocks.reshape(blocks.shape[0] // BLOCK, BLOCK, blocks.shape[1] // BLOCK, BLOCK).max(axis=(1, 3))
    blocks, tiles = np.ascontiguousarray(blocks), np.ascontiguousarray(tiles)
    n, bodies = len(joints), len(scene.bodies)
    begin = 1 if first is None else 0
    parts = [(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty((0, 3)))]
    clearance, poses = FAR, 0
    for low in range(begin, n if bodies else 0, CHUNK):
        rows = slice(low, low + CHUNK)
        start = (joints[low - 1], tips[low - 1], tool_axes[low - 1]) if first is None or low else first
        count = len(joints[rows])
        worst = np.full((count + 1, bodies), FAR)
        where = np.zeros((count + 1, bodies, 3))
        near, looked = _sweep(
            np.vstack([start[0], joints[rows]]),
            np.vstack([start[1], tips[rows]]),
            np.vstack([start[2], tool_axes[rows]]),
            np.append(0.0, width[rows]),
            np.append(0.0, height[rows]),
            np.append(False, checked[rows]),
            scene.work_side,
            scene.rotary,
            scene.axes,
            scene.pivots,
            scene.origin,
            scene.bodies,
            scene.middles,
            scene.radii,
            scene.turns,
            scene.places,
            scene.carried,
            scene.nozzle,
            cells,
            blocks,
            tiles,
            scene.corner,
            scene.floor,
            worst,
            where,
        )
        clearance, poses = min(clearance, near), poses + looked
        row, body = np.nonzero(worst < 0.0)
        parts.append((row.astype(np.int64) - 1 + low, body.astype(np.int64), -worst[row, body], where[row, body]))
    return Hits(
        rows=np.concatenate([part[0] for part in parts]),
        body=np.concatenate([part[1] for part in parts]),
        depth=np.concatenate([part[2] for part in parts]),
        points=np.concatenate([part[3] for part in parts]),
        clearance=math.inf if clearance >= FAR else float(clearance),
        poses=int(poses),
    )


@njit(cache=True)
def _turn(axis: Any, angle: Any, out: Any) -> Any:
    """Rodrigues' formula into out (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    t = 1.0 - c
    x, y, z = axis[0], axis[1], axis[2]
    out[0, 0], out[0, 1], out[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c


@njit(cache=True)
def _side(
    q: Any, work: Any, count: Any, work_side: Any, rotary: Any, axes: Any, pivots: Any, rotation: Any, shift: Any
) -> Any:
    """Motion of one side's first `count` joints at q: point -> rotation @ point + shift, in the machine frame."""
    rotation[:] = 0.0
    rotation[0, 0] = rotation[1, 1] = rotation[2, 2] = 1.0
    shift[:] = 0.0
    step = np.empty((3, 3))
    product = np.empty((3, 3))
    done = 0
    for j in range(len(q)):
        if work_side[j] != work or done == count:
            continue
        done += 1
        if rotary[j]:
            _turn(axes[j], q[j], step)
            for r in range(3):
                moved = 0.0
                for c in range(3):
                    off = pivots[j, c] - (
                        step[c, 0] * pivots[j, 0] + step[c, 1] * pivots[j, 1] + step[c, 2] * pivots[j, 2]
                    )
                    moved += rotation[r, c] * off
                    product[r, c] = (
                        rotation[r, 0] * step[0, c] + rotation[r, 1] * step[1, c] + rotation[r, 2] * step[2, c]
                    )
                shift[r] += moved
            rotation[:] = product
        else:
            for r in range(3):
                shift[r] += q[j] * (
                    rotation[r, 0] * axes[j, 0] + rotation[r, 1] * axes[j, 1] + rotation[r, 2] * axes[j, 2]
                )


@njit(cache=True)
def _place(
    q: Any,
    b: Any,
    work_side: Any,
    rotary: Any,
    axes: Any,
    pivots: Any,
    origin: Any,
    turns: Any,
    places: Any,
    carried: Any,
    rw: Any,
    tw: Any,
    rt: Any,
    tt: Any,
    rotation: Any,
    shift: Any,
) -> Any:
    """Part from body at q, into rotation (3, 3) and shift (3,)."""
    _side(q, True, len(q), work_side, rotary, axes, pivots, rw, tw)
    _side(q, False, carried[b], work_side, rotary, axes, pivots, rt, tt)
    # machine point of the body's origin, then back through the work side
    px = rt[0, 0] * places[b, 0] + rt[0, 1] * places[b, 1] + rt[0, 2] * places[b, 2] + tt[0] - tw[0]
    py = rt[1, 0] * places[b, 0] + rt[1, 1] * places[b, 1] + rt[1, 2] * places[b, 2] + tt[1] - tw[1]
    pz = rt[2, 0] * places[b, 0] + rt[2, 1] * places[b, 1] + rt[2, 2] * places[b, 2] + tt[2] - tw[2]
    for r in range(3):
        shift[r] = rw[0, r] * px + rw[1, r] * py + rw[2, r] * pz - origin[r]
        for c in range(3):
            total = 0.0
            for m in range(3):
                total += rw[m, r] * (rt[m, 0] * turns[b, 0, c] + rt[m, 1] * turns[b, 1, c] + rt[m, 2] * turns[b, 2, c])
            rotation[r, c] = total


@njit(cache=True)
def _lever(q: Any, point: Any, place: Any, work_side: Any, rotary: Any, pivots: Any, origin: Any) -> Any:
    """At least the distance in mm of a body's reference point from every rotary axis of its way to the part.

    A joint keeps distances to its own axis; from one axis to the next their pivots' distance is added, and what linear
    joints on the part's side have moved.
    """
    lever, spread = 0.0, 0.0
    for j in range(len(q)):
        if not rotary[j]:
            if work_side[j]:
                spread += abs(q[j])
            continue
        far = 0.0
        for c in range(3):
            away = point[c] + origin[c] - pivots[j, c] if work_side[j] else place[c] - pivots[j, c]
            far += away * away
        lever = max(lever, math.sqrt(far))
        for m in range(j):
            if rotary[m] and work_side[m] == work_side[j]:
                spread += math.sqrt(
                    (pivots[m, 0] - pivots[j, 0]) ** 2
                    + (pivots[m, 1] - pivots[j, 1]) ** 2
                    + (pivots[m, 2] - pivots[j, 2]) ** 2
                )
    return lever + spread


@njit(cache=True)
def _at(row: Any, rotation: Any, shift: Any, x: Any, y: Any, z: Any) -> Any:
    """Signed distance of a point of the part from a placed body."""
    dx, dy, dz = x - shift[0], y - shift[1], z - shift[2]
    return signed_distance(
        row,
        rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz,
        rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz,
        rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz,
    )


@njit(cache=True)
def _column(row: Any, rotation: Any, shift: Any, x: Any, y: Any, low: Any, high: Any) -> Any:
    """Smallest signed distance of the upright line from low to high; (distance, z).

    Distance to a convex body is convex along a line, so the section search (golden, 24 steps) ends at the minimum.
    """
    top = _at(row, rotation, shift, x, y, high)
    nearly = _at(row, rotation, shift, x, y, high - 1e-4)
    if nearly >= top or high - low < 1e-4:
        return top, high
    golden = 0.6180339887498949
    a, b = low, high
    c, d = b - golden * (b - a), a + golden * (b - a)
    fc, fd = _at(row, rotation, shift, x, y, c), _at(row, rotation, shift, x, y, d)
    for _ in range(24):
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - golden * (b - a)
            fc = _at(row, rotation, shift, x, y, c)
        else:
            a, c, fc = c, d, fd
            d = a + golden * (b - a)
            fd = _at(row, rotation, shift, x, y, d)
    return (fc, c) if fc < fd else (fd, d)


@njit(cache=True)
def _nearest(
    row: Any,
    middle: Any,
    radius: Any,
    rotation: Any,
    shift: Any,
    press: Any,
    lean: Any,
    cells: Any,
    blocks: Any,
    tiles: Any,
    corner: Any,
    floor: Any,
    want: Any,
    found: Any,
) -> Any:
    """Smallest distance below `want` between a placed body and what stands on the bed; `want` where there is none.

    Only material that stands more than press - lean * (distance from the tip) above the tip's plane counts.
    found (3,) receives the place. Blocks and tiles are skipped whole where even their highest point is too far.
    """
    block = BLOCK
    mx = rotation[0, 0] * middle[0] + rotation[0, 1] * middle[1] + rotation[0, 2] * middle[2] + shift[0]
    my = rotation[1, 0] * middle[0] + rotation[1, 1] * middle[1] + rotation[1, 2] * middle[2] + shift[1]
    mz = rotation[2, 0] * middle[0] + rotation[2, 1] * middle[1] + rotation[2, 2] * middle[2] + shift[2]
    ax, ay, az = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    best = want
    reach = radius + max(want, 0.0)
    # the body's lowest point is no lower than this: a long beam lies high although its sphere does not
    if row[0] == 0.0:
        half_x = half_y = max(row[5], row[6])
        half_z = (row[4] - row[3]) / 2.0
    else:
        half_x, half_y, half_z = (row[4] - row[1]) / 2.0, (row[5] - row[2]) / 2.0, (row[6] - row[3]) / 2.0
    extent = abs(rotation[2, 0]) * half_x + abs(rotation[2, 1]) * half_y + abs(rotation[2, 2]) * half_z
    lowest = mz - min(radius, extent) - max(want, 0.0)
    tile = CELL * block * block
    left, low_y = corner[0] - CELL / 2, corner[1] - CELL / 2
    first_i = max(int((mx - reach - left) // tile), 0)
    last_i = min(int((mx + reach - left) // tile), tiles.shape[0] - 1)
    first_j = max(int((my - reach - low_y) // tile), 0)
    last_j = min(int((my + reach - low_y) // tile), tiles.shape[1] - 1)
    half_block = 0.7071067811865476 * CELL * block
    for ti in range(first_i, last_i + 1):
        for tj in range(first_j, last_j + 1):
            if tiles[ti, tj] < floor or tiles[ti, tj] < lowest:
                continue
            if radius > tile:
                tx, ty = left + (ti + 0.5) * tile, low_y + (tj + 0.5) * tile
                near, _ = _column(row, rotation, shift, tx, ty, floor, tiles[ti, tj])
                if near > best + half_block * block:
                    continue
            for bi in range(ti * block, ti * block + block):
                bx = left + (bi + 0.5) * CELL * block
                if abs(bx - mx) > reach + half_block:
                    continue
                for bj in range(tj * block, tj * block + block):
                    high = blocks[bi, bj]
                    if high < floor or high < lowest:
                        continue
                    by = low_y + (bj + 0.5) * CELL * block
                    if (bx - mx) ** 2 + (by - my) ** 2 > (reach + half_block) ** 2:
                        continue
                    # plane of the tip: skip where the block's highest corner stays under it
                    flat = math.hypot(bx - shift[0], by - shift[1])
                    over = ax * (bx - shift[0]) + ay * (by - shift[1]) + az * (high - shift[2])
                    over += half_block * math.hypot(ax, ay)
                    away = math.hypot(flat + half_block, high - shift[2])
                    if over < press - lean * away:
                        continue
                    near, _ = _column(row, rotation, shift, bx, by, floor, high)
                    if near > best + half_block:
                        continue
                    for i in range(bi * block, bi * block + block):
                        x = corner[0] + i * CELL
                        for j in range(bj * block, bj * block + block):
                            top = cells[i, j]
                            if top < floor:
                                continue
                            y = corner[1] + j * CELL
                            bottom = floor
                            if press > -FAR:
                                away = math.sqrt((x - shift[0]) ** 2 + (y - shift[1]) ** 2 + (top - shift[2]) ** 2)
                                plane = press - lean * away
                                rest = ax * (x - shift[0]) + ay * (y - shift[1])
                                if rest + az * (top - shift[2]) < plane:
                                    continue
                                if az > 1e-6:
                                    bottom = max(floor, shift[2] + (plane - rest) / az)
                            distance, z = _column(row, rotation, shift, x, y, bottom, top)
                            if distance < best:
                                best = distance
                                found[0], found[1], found[2] = x, y, z
    return best


@njit(cache=True)
def _sweep(
    joints: Any,
    tips: Any,
    tool_axes: Any,
    width: Any,
    height: Any,
    checked: Any,
    work_side: Any,
    rotary: Any,
    axes: Any,
    pivots: Any,
    origin: Any,
    bodies: Any,
    middles: Any,
    radii: Any,
    turns: Any,
    places: Any,
    carried: Any,
    nozzle: Any,
    cells: Any,
    blocks: Any,
    tiles: Any,
    corner: Any,
    floor: Any,
    worst: Any,
    where: Any,
) -> Any:
    """The loop over rows; intervals of a row wait on a stack. Returns (smallest distance measured, poses looked at)."""
    n, k = joints.shape
    rw, rt, rotation = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    tw, tt, shift = np.empty(3), np.empty(3), np.empty(3)
    first, last, found = np.empty(3), np.empty(3), np.empty(3)
    q = np.empty(k)
    stack = np.empty((64, 2))
    clearance, poses = FAR, 0
    for i in range(1, n):
        turn, slide = 0.0, 0.0
        for j in range(k):
            step = abs(joints[i, j] - joints[i - 1, j])
            if rotary[j]:
                turn += step
            else:
                slide += step
        for b in range(len(bodies)):
            if turn + slide == 0.0 or not checked[i]:
                break
            stack[0, 0], stack[0, 1] = 0.0, 1.0
            waiting = 1
            while waiting:
                waiting -= 1
                begin, end = stack[waiting, 0], stack[waiting, 1]
                share = end - begin
                middle = (begin + end) / 2.0
                for look in range(3):
                    at = begin if look == 0 else (end if look == 1 else middle)
                    for j in range(k):
                        q[j] = joints[i - 1, j] + at * (joints[i, j] - joints[i - 1, j])
                    _place(
                        q,
                        b,
                        work_side,
                        rotary,
                        axes,
                        pivots,
                        origin,
                        turns,
                        places,
                        carried,
                        rw,
                        tw,
                        rt,
                        tt,
                        rotation,
                        shift,
                    )
                    if look == 0:
                        first[:] = shift
                    elif look == 1:
                        last[:] = shift
                poses += 1
                dx, dy, dz = last[0] - first[0], last[1] - first[1], last[2] - first[2]
                chord = math.sqrt(dx * dx + dy * dy + dz * dz)
                lever = _lever(joints[i], shift, places[b], work_side, rotary, pivots, origin)
                angle, way = turn * share, slide * share
                bow = (2.0 * angle * way + angle * angle * (lever + way)) / 8.0
                size = math.sqrt(middles[b, 0] ** 2 + middles[b, 1] ** 2 + middles[b, 2] ** 2) + radii[b]
                motion = chord / 2.0 + bow + size * angle / 2.0
                press, lean = -FAR, 0.0
                if nozzle[b]:
                    axial = abs(rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz) / 2.0
                    lean = angle / 2.0
                    press = PRESS - axial - bow - chord * angle / 4.0
                decides = motion <= SMALLEST_STEP / 2.0
                if decides and nozzle[b]:
                    press, lean = PRESS, 0.0
                want = SMALLEST_STEP if decides else motion
                near = _nearest(
                    bodies[b],
                    middles[b],
                    radii[b],
                    rotation,
                    shift,
                    press,
                    lean,
                    cells,
                    blocks,
                    tiles,
                    corner,
                    floor,
                    want,
                    found,
                )
                if not decides:
                    if near < motion:
                        stack[waiting, 0], stack[waiting, 1] = begin, middle
                        stack[waiting + 1, 0], stack[waiting + 1, 1] = middle, end
                        waiting += 2
                    continue
                if near < clearance:
                    clearance = near
                if near < worst[i, b]:
                    worst[i, b] = near
                    where[i, b, 0], where[i, b, 1], where[i, b, 2] = found[0], found[1], found[2]
        if width[i] > 0.0:
            raise_bead(
                cells, blocks, tiles, corner, CELL, BLOCK, tips[i - 1], tips[i], tool_axes[i], width[i], height[i]
            )
    return clearance, poses
