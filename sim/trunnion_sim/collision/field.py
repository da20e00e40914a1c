"""One body, one row of motion, and what is printed so far: how deep does it enter anywhere along the way?

An interval of the row is proven free when, at its middle, the body is farther from everything than it can move in half
the interval; what cannot be proven is halved, down to SMALLEST_STEP, where the middle itself decides. So nothing deeper
than half of SMALLEST_STEP is missed between poses (conservative advancement; Mirtich 1996, "Impulse-based dynamic
simulation of rigid body systems", chapter 3).

Half an interval moves a point of a body, at distance r from the body's reference point, by at most
|chord|/2 + bow + r * turn/2: the chord is that of the reference point in `part`, turn the sum of the rotary joints'
steps, and bow <= (2 turn * slide + turn^2 * reach)/8 bounds how far the reference point's path leaves the chord
(Taylor). This stays small where linear joints make up for the rotary ones, as they do around the tip.

Around the tip the nozzle touches plastic by design. For bodies of the tool, material counts only where it stands more
than PRESS above the plane of the tip.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_core.arrays import FloatArray
from trunnion_sim.collision.place import place_in_part
from trunnion_sim.collision.solids import signed_distance

PRESS = 0.1 + 1e-4
"""mm above the plane of the tip up to which plastic may touch the nozzle: a bead's own squeeze, its soft neighbours;
and the rounding of heights, so that a step down by exactly 0.1 is not decided by it."""
SMALLEST_STEP = 0.05
"""mm that no point of a body moves beyond between two poses that decide."""
DEEPER = 0.1
"""Share by which a place has to be deeper than the deepest known to be looked for."""
CELL = 0.25
"""mm between samples of what is printed: finer than a bead is wide, so that no bead falls between two."""
BLOCK = 8
"""Cells along the side of a block, and blocks along the side of a tile, whose highest point prunes the search."""
UNDER = -1e9
"""Height in mm where nothing is."""
FLOOR = 0.0
"""mm in `part`: where the columns of what is printed begin, on the plate."""
FAR = 1e9


class Field(NamedTuple):
    """What is printed so far, in `part`: a height over every cell, and the highest of every block and tile."""

    corner: FloatArray
    """(2,) mm: centre of the first cell."""
    cells: NDArray[np.float32]
    """(nx, ny) mm; UNDER where nothing is."""
    blocks: NDArray[np.float32]
    tiles: NDArray[np.float32]


def empty_field(low: FloatArray, high: FloatArray) -> Field:
    """A field over the rectangle from low to high, (2,) mm each, padded to whole tiles."""
    tile = BLOCK * BLOCK
    nx, ny = (max(int(np.ceil(span / CELL / tile)), 1) for span in high - low)
    heights = (np.full((nx * side, ny * side), UNDER, np.float32) for side in (tile, BLOCK, 1))
    return Field(np.asarray(low + CELL / 2), *heights)


@njit(cache=True)
def enter(before: Any, after: Any, b: Any, chain: Any, bodies: Any, field: Any, found: Any) -> Any:
    """Smallest distance in mm of body b from what is printed, over the motion of the joints from `before` to `after`.

    Negative where it enters, to within DEEPER and SMALLEST_STEP of the deepest; FAR where it is never near enough to be
    measured. found (3,) receives the place, and the second result is how many poses were looked at.
    """
    rotation, shift = np.empty((3, 3)), np.empty(3)
    first, last, here = np.empty(3), np.empty(3), np.empty(3)
    q = np.empty(len(before))
    stack = np.empty((64, 2))
    turn, slide = 0.0, 0.0
    for j in range(len(q)):
        if bodies.carried[b, j] != chain.work_side[j]:
            if chain.rotary[j]:
                turn += abs(after[j] - before[j])
            else:
                slide += abs(after[j] - before[j])
    middle_off = bodies.middles[b]
    size = math.sqrt(middle_off[0] ** 2 + middle_off[1] ** 2 + middle_off[2] ** 2) + bodies.radii[b]
    worst, poses, waiting = FAR, 0, 1
    stack[0, 0], stack[0, 1] = 0.0, 1.0
    while waiting:
        waiting -= 1
        begin, end = stack[waiting, 0], stack[waiting, 1]
        share = end - begin
        middle = (begin + end) / 2.0
        for look in range(3):
            at = begin if look == 0 else (end if look == 1 else middle)
            for j in range(len(q)):
                q[j] = before[j] + at * (after[j] - before[j])
            place_in_part(q, b, chain, bodies, rotation, shift)
            if look == 0:
                first[:] = shift
            elif look == 1:
                last[:] = shift
        poses += 1
        dx, dy, dz = last[0] - first[0], last[1] - first[1], last[2] - first[2]
        chord = math.sqrt(dx * dx + dy * dy + dz * dz)
        angle, way = turn * share, slide * share
        bow = (2.0 * angle * way + angle * angle * (_lever(q, shift, b, chain, bodies) + way)) / 8.0
        motion = chord / 2.0 + bow + size * angle / 2.0
        decides = motion <= SMALLEST_STEP / 2.0
        press, lean = -FAR, 0.0
        if bodies.tool[b]:
            press = PRESS
            if not decides:
                axial = abs(rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz) / 2.0
                lean = angle / 2.0
                press = PRESS - axial - bow - chord * angle / 4.0
        # once something is entered, only what is noticeably deeper matters
        deeper = min(worst + DEEPER * worst - SMALLEST_STEP, 0.0) if worst < 0.0 else 0.0
        want = min(worst, SMALLEST_STEP) if decides else motion + deeper
        near = _nearest(b, bodies, rotation, shift, press, lean, field, want, here)
        if near >= want:
            continue
        if decides:
            worst = near
            found[:] = here
        else:
            stack[waiting, 0], stack[waiting, 1] = begin, middle
            stack[waiting + 1, 0], stack[waiting + 1, 1] = middle, end
            waiting += 2
    return worst, poses


@njit(cache=True)
def _lever(q: Any, point: Any, b: Any, chain: Any, bodies: Any) -> Any:
    """At least the distance in mm of a body's reference point from every rotary axis between it and the part.

    A joint keeps distances to its own axis; from one axis to the next their pivots' distance is added, and what linear
    joints beyond an axis have moved.
    """
    lever, spread = 0.0, 0.0
    for j in range(len(q)):
        if bodies.carried[b, j] == chain.work_side[j]:
            continue
        if chain.rotary[j]:
            far = 0.0
            for c in range(3):
                at = point[c] + chain.origin[c] if chain.work_side[j] else bodies.places[b, c]
                far += (at - chain.pivots[j, c]) ** 2
            lever = max(lever, math.sqrt(far))
        for m in range(j):
            if chain.rotary[m] and chain.work_side[m] == chain.work_side[j]:
                if not chain.rotary[j]:
                    spread += abs(q[j])
                    break
                between = 0.0
                for c in range(3):
                    between += (chain.pivots[m, c] - chain.pivots[j, c]) ** 2
                spread += math.sqrt(between)
    return lever + spread


@njit(cache=True)
def _at(row: Any, faces: Any, rotation: Any, shift: Any, x: Any, y: Any, z: Any) -> Any:
    """Signed distance of a point of the part from a placed body."""
    dx, dy, dz = x - shift[0], y - shift[1], z - shift[2]
    return signed_distance(
        row,
        faces,
        rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz,
        rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz,
        rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz,
    )


@njit(cache=True)
def _column(row: Any, faces: Any, rotation: Any, shift: Any, x: Any, y: Any, low: Any, high: Any) -> Any:
    """Smallest signed distance of the upright line from low to high; (distance, z).

    Distance to a convex body is convex along a line, so the section search (golden, 24 steps) ends at the minimum.
    """
    top = _at(row, faces, rotation, shift, x, y, high)
    nearly = _at(row, faces, rotation, shift, x, y, high - 1e-4)
    if nearly >= top or high - low < 1e-4:
        return top, high
    golden = 0.6180339887498949
    a, b = low, high
    c, d = b - golden * (b - a), a + golden * (b - a)
    fc, fd = _at(row, faces, rotation, shift, x, y, c), _at(row, faces, rotation, shift, x, y, d)
    for _ in range(24):
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - golden * (b - a)
            fc = _at(row, faces, rotation, shift, x, y, c)
        else:
            a, c, fc = c, d, fd
            d = a + golden * (b - a)
            fd = _at(row, faces, rotation, shift, x, y, d)
    return (fc, c) if fc < fd else (fd, d)


@njit(cache=True)
def _nearest(
    b: Any, bodies: Any, rotation: Any, shift: Any, press: Any, lean: Any, field: Any, want: Any, found: Any
) -> Any:
    """Smallest distance below `want` between a placed body and what is printed; `want` where there is none.

    Only material that stands more than press - lean * (distance from the tip) above the tip's plane counts.
    found (3,) receives the place. Blocks and tiles are skipped whole where even their highest point is too far.
    """
    row, faces, middle, radius = bodies.rows[b], bodies.faces, bodies.middles[b], bodies.radii[b]
    cells, blocks, tiles, corner, floor = field.cells, field.blocks, field.tiles, field.corner, FLOOR
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
    elif row[0] == 2.0:
        half_x = half_y = half_z = radius
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
                near, _ = _column(row, faces, rotation, shift, tx, ty, floor, tiles[ti, tj])
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
                    near, _ = _column(row, faces, rotation, shift, bx, by, floor, high)
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
                            distance, z = _column(row, faces, rotation, shift, x, y, bottom, top)
                            if distance < best:
                                best = distance
                                found[0], found[1], found[2] = x, y, z
    return best
