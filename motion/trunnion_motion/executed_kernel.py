"""Corner speeds and ramps of printer firmware, compiled: the arithmetic behind `executed`.

Speeds are along the firmware's own length of a move; `share` is what each joint moves per unit of it.
"""

import numba
import numpy as np
from trunnion_core.arrays import BoolArray, FloatArray, IntArray

NEARLY_STRAIGHT = 0.999999
"""Cosine beyond which Marlin and GRBL take a corner for straight, or for a full reversal."""
SHORT_ARC = 1.0
"""mm. Marlin takes shorter moves that turn by less than 45 degrees for pieces of an arc."""
ARC_COSINE = 0.7071067812


@numba.njit(cache=True, error_model="numpy")
def jerk_corners(share: FloatArray, nominal: FloatArray, limit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m,) speed allowed into every move from the one before, and (m,) from rest: Marlin's classic jerk.

    The slower side's nominal speed is compared with the faster side's as they stand, so a rise of F alone counts as a
    jump; a reversal counts by its larger side; where both sides could stop within their jerk, they need not match.
    """
    m, columns = share.shape
    corner = np.zeros(m)
    safe = np.zeros(m)
    for i in range(m):
        safe[i] = nominal[i]
        for j in range(columns):
            if abs(share[i, j]) * safe[i] > limit[j]:
                safe[i] = limit[j] / abs(share[i, j])
        if i == 0:
            continue
        slower = min(nominal[i], nominal[i - 1])
        kept = 1.0
        for j in range(columns):
            out = share[i - 1, j] * slower * kept
            into = share[i, j] * nominal[i] * kept
            jump = max(abs(out), abs(into)) if out * into < 0.0 else abs(out - into)
            if jump > limit[j]:
                kept *= limit[j] / jump
        corner[i] = slower * kept
        if min(safe[i], safe[i - 1]) > 0.99 * corner[i]:
            corner[i] = safe[i]
    return corner, safe


@numba.njit(cache=True, error_model="numpy")
def deviation_corners(
    share: FloatArray,
    nominal: FloatArray,
    length: FloatArray,
    ramp: FloatArray,
    acceleration: FloatArray,
    deviation: float,
    ramps_of_block: bool,
) -> FloatArray:
    """(m,) speed allowed into every move: junction deviation (Jeon) over all columns, mm and degrees mixed.

    With `ramps_of_block` as Marlin: the move's own ramp bounds the acceleration across the corner, and short moves on
    an arc are held to its radius. Without, as GRBL: every axis gives what it has.
    """
    m, columns = share.shape
    corner = np.zeros(m)
    size = np.sqrt((share * share).sum(axis=1))
    for i in range(1, m):
        top = min(nominal[i], nominal[i - 1])
        cosine = 0.0
        for j in range(columns):
            cosine += share[i, j] * share[i - 1, j]
        cosine /= size[i] * size[i - 1]
        if cosine < -NEARLY_STRAIGHT:
            continue
        if cosine > NEARLY_STRAIGHT and not ramps_of_block:
            corner[i] = top
            continue
        cosine = min(cosine, NEARLY_STRAIGHT)
        turn = np.sqrt(((share[i] / size[i] - share[i - 1] / size[i - 1]) ** 2).sum())
        across = ramp[i] if ramps_of_block else np.inf
        for j in range(columns):
            part = abs(share[i, j] / size[i] - share[i - 1, j] / size[i - 1])
            if part > 0.0:
                across = min(across, acceleration[j] * turn / part)
        half = np.sqrt(0.5 * (1.0 + cosine))
        square = across * deviation * half / (1.0 - half)
        if ramps_of_block and length[i] < SHORT_ARC and cosine > ARC_COSINE:
            square = min(square, length[i] * across / np.arccos(cosine))
        corner[i] = min(top, np.sqrt(square))
    return corner


@numba.njit(cache=True, error_model="numpy")
def jump_corners(share: FloatArray, nominal: FloatArray, kind: IntArray, limit: FloatArray) -> FloatArray:
    """(m,) speed allowed into every move: no axis jumps by more than its limit; a stop where `kind` changes."""
    m, columns = share.shape
    corner = np.zeros(m)
    for i in range(1, m):
        if kind[i] != kind[i - 1]:
            continue
        top = min(nominal[i], nominal[i - 1])
        for j in range(columns):
            jump = abs(share[i, j] - share[i - 1, j])
            if jump * top > limit[j]:
                top = limit[j] / jump
        corner[i] = top
    return corner


@numba.njit(cache=True, error_model="numpy")
def bent(
    share: FloatArray, nominal: FloatArray, length: FloatArray, corner: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """(m,) nominal speeds at which a row of small corners, which is a curve, bends no joint faster than it accelerates.

    No firmware looks at more than the jump at one corner. The bend is met halfway: from the middle of one move to the
    middle of the next. The shorter of the two is slowed down; a long one need not crawl because of its end.
    """
    m, columns = share.shape
    slower = nominal.copy()
    for i in range(1, m):
        limit = corner[i]
        for j in range(columns):
            jump = abs(share[i, j] - share[i - 1, j])
            bend = 0.5 * (length[i] + length[i - 1]) * acceleration[j]
            if limit * limit * jump > bend:
                limit = np.sqrt(bend / jump)
        if limit < corner[i]:
            at = i if length[i] <= length[i - 1] else i - 1
            slower[at] = min(slower[at], limit)
    return slower


@numba.njit(cache=True, error_model="numpy")
def ramps(
    length: FloatArray,
    nominal: FloatArray,
    ramp: FloatArray,
    corner: FloatArray,
    rest: FloatArray,
    stops: BoolArray,
    blocks: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Entry, peak and leaving speed (m,) of every move.

    `corner` and `rest` (m,) are the speeds allowed into a move from the one before and from rest; `stops` (m,) where
    the machine stands before the move. The planner knows `blocks` moves at a time and must be able to stop at the end
    of the last, so the farthest that a move may leave with is bounded by the ramps of those that follow it.
    """
    m = len(length)
    entry, peak, leave = np.zeros(m), np.zeros(m), np.zeros(m)
    # Squared speed allowed into each move if the planner saw the whole program.
    seen = np.zeros(m + 1)
    for i in range(m - 1, -1, -1):
        if not stops[i]:
            seen[i] = min(corner[i] * corner[i], seen[i + 1] + 2.0 * ramp[i] * length[i])
    speed = 0.0
    for i in range(m):
        first = rest[i] if stops[i] else speed
        ahead = seen[i + 1]
        room = 0.0
        last = min(m - 1, i + blocks - 1)
        for b in range(i + 1, last + 1):
            if room >= ahead:
                break
            room += 2.0 * ramp[b] * length[b]
        if last < m - 1:
            ahead = min(ahead, room)
        gain = 2.0 * ramp[i] * length[i]
        out = np.sqrt(min(ahead, first * first + gain, nominal[i] * nominal[i]))
        top = min(nominal[i], np.sqrt(0.5 * (first * first + out * out + gain)))
        entry[i], leave[i], peak[i] = first, out, max(top, first, out)
        speed = out
    return entry, peak, leave
