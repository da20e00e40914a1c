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
def jerk_corners(share: FloatArray, nominal: FloatArray, limit: FloatArray) -> FloatArray:
    """(m,) speed allowed into every move from the one before: Marlin's classic jerk.

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
    return corner


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

    With `ramps_of_block` as Marlin: the move's own ramp bounds the acceleration across the corner, short moves on an
    arc are held to its radius, and moves without filament keep vectors that are longer than one where joints turn
    besides. Without, as GRBL: every axis gives what it has.
    """
    m, columns = share.shape
    corner = np.zeros(m)
    size = np.sqrt((share * share).sum(axis=1))
    if ramps_of_block:
        size = np.where(share[:, columns - 1] != 0.0, size, 1.0)
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
            square = min(square, length[i] * across / marlin_angle(cosine))
        corner[i] = min(top, np.sqrt(square))
    return corner


@numba.njit(cache=True, error_model="numpy")
def marlin_angle(cosine: float) -> float:
    """Angle in rad, from a polynomial of Marlin's planner that is 0.03 off at most, and never less than that."""
    powers = cosine ** np.arange(7)
    sine = powers @ np.array(
        [0.032843707, -1.451838349, 29.66153956, -131.1123477, 262.8130562, -242.7199627, 84.31466202]
    )
    return float(0.5 * np.pi - sine)


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


@numba.njit(cache=True, error_model="numpy")
def square_corners(
    share: FloatArray,
    linear: BoolArray,
    nominal: FloatArray,
    length: FloatArray,
    ramp: FloatArray,
    kinematic: BoolArray,
    limit: FloatArray,
    deviation: float,
) -> FloatArray:
    """(m,) speed allowed into every move: Klipper's junction deviation over the linear columns.

    The circle through the corner touches neither move beyond its middle; every other column may jump by its `limit`.
    Moves without linear motion (`kinematic` false) begin and end at rest.
    """
    m, columns = share.shape
    corner = np.zeros(m)
    for i in range(1, m):
        if not (kinematic[i] and kinematic[i - 1]):
            continue
        square = min(nominal[i], nominal[i - 1]) ** 2
        cosine = 0.0
        for j in range(columns):
            if linear[j]:
                cosine += share[i, j] * share[i - 1, j]
            else:
                jump = abs(share[i, j] - share[i - 1, j])
                if jump > 0.0:
                    square = min(square, (limit[j] / jump) ** 2)
        half = np.sqrt(max(0.5 * (1.0 + cosine), 0.0))
        other = np.sqrt(max(0.5 * (1.0 - cosine), 0.0))
        if half < 1.0 and other > 0.0:
            radius = deviation * half / (1.0 - half)
            touch = 0.5 * half / other
            square = min(square, min(radius * ramp[i], radius * ramp[i - 1]))
            square = min(square, min(touch * length[i] * ramp[i], touch * length[i - 1] * ramp[i - 1]))
        corner[i] = np.sqrt(square)
    return corner


@numba.njit(cache=True, error_model="numpy")
def smoothed_ramps(
    length: FloatArray,
    nominal: FloatArray,
    ramp: FloatArray,
    corner: FloatArray,
    stops: BoolArray,
    gentle: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Entry, peak and leaving speed (m,) of every move, as Klipper's look-ahead gives them.

    Besides the ramps proper, a second, gentler pair of passes with the accelerations `gentle` (m,) finds the top that
    leaves room for cruising; runs of moves that only slow down gently are held to the top before them.
    """
    m = len(length)
    entry, peak, leave = np.zeros(m), np.zeros(m), np.zeros(m)
    gain, ease = 2.0 * ramp * length, 2.0 * gentle * length
    into, soft = np.zeros(m), np.zeros(m)
    for i in range(1, m):
        if not stops[i]:
            into[i] = min(corner[i] * corner[i], into[i - 1] + gain[i - 1])
            soft[i] = min(into[i], soft[i - 1] + ease[i - 1])
    begin, end = np.zeros(m), np.zeros(m)
    out, out_soft, top = 0.0, 0.0, 0.0
    waiting = m
    for i in range(m - 1, -1, -1):
        if i == m - 1 or stops[i + 1]:
            out, out_soft, top = 0.0, 0.0, 0.0
            waiting = i + 1
        begin[i], end[i] = min(into[i], out + gain[i]), out
        reach = out_soft + ease[i]
        start_soft = min(soft[i], reach)
        if start_soft < reach:
            if start_soft + ease[i] > out_soft or waiting > i + 1:
                top = min(nominal[i] * nominal[i], 0.5 * (start_soft + reach))
                held = top
                for w in range(i + 1, waiting):
                    held = min(held, begin[w])
                    entry[w], peak[w], leave[w] = held, held, min(end[w], held)
            waiting = i
            cruise = min(min(0.5 * (begin[i] + out + gain[i]), nominal[i] * nominal[i]), top)
            entry[i], peak[i], leave[i] = min(begin[i], cruise), cruise, min(out, cruise)
        out, out_soft = begin[i], start_soft
    return np.sqrt(entry), np.sqrt(peak), np.sqrt(leave)
