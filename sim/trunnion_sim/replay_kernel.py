r"""The planner of Marlin as compiled loops: nominal speeds, corner speeds, look-ahead, trapezoids.

        cruise  ______________
               /              \          acceleration and deceleration are equal,
        entry /                \ exit    the area is the length of the block
              <---- duration --->

Marlin: `module/planner.cpp` (2.1.2.5), `_populate_block`: the joints' speeds and accelerations scale the whole block; a
corner is limited by classic jerk, or by junction deviation over all axes in mixed units, in kinematic builds by both. A
move from a standstill begins from zero, since no pass looks at the first entry (`reverse_pass`).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]
STILL = 1e-9
"""Changes of joints smaller than this, in mm or degrees, are none."""
LARGEST = 1e12
"""Stands for an unlimited acceleration."""


@njit(cache=True)
def plan(
    delta: _F,
    length: _F,
    linear: NDArray[np.bool_],
    feed: _F,
    inverse: NDArray[np.bool_],
    homing: NDArray[np.bool_],
    stops: NDArray[np.bool_],
    which: NDArray[np.int64],
    speed_limit: _F,
    acceleration_limit: _F,
    corner_limit: _F,
    path_limit: _F,
    deviation: float,
    blocks: int,
    slowest: float,
    slowest_limit: _F,
    both_rules: bool,
    seen: _F,
    named: _F,
    drive_limit: _F,
) -> tuple[_F, _F, _F, _F, _F, _F, _F]:
    """Length, asked speed, entry, cruise, exit, acceleration and duration of every row.

    `length` (n,) is what F is read over; `delta`, `seen` and `named` (n, k + 1) are what joints and filament change,
    the same as the corners see it, and what the words change. `drive_limit` (n,) mm/s² of filament.
    """
    n, columns = delta.shape
    k = columns - 1
    asked = np.zeros(n)
    nominal = np.zeros(n)
    acceleration = np.ones(n)
    ratio = np.zeros((n, columns))
    way = np.zeros((n, columns))
    kind = np.zeros(n, np.uint8)  # 1 joints move, 2 linear joints move, 4 filament moves
    for i in range(n):
        moves = False
        straight = False
        for j in range(k):
            if abs(delta[i, j]) > STILL:
                moves = True
                straight = straight or linear[j]
        kind[i] = (1 if moves else 0) | (2 if straight else 0) | (4 if delta[i, k] != 0 else 0)
        d = length[i]
        if d <= 0:
            continue
        lim = which[i]
        asked[i] = feed[i] * d if inverse[i] else feed[i]
        v = max(asked[i], slowest_limit[lim, 0])
        a = path_limit[lim, 2] if not moves else (path_limit[lim, 0] if delta[i, k] > 0 else path_limit[lim, 1])
        a = min(a, LARGEST)
        for j in range(columns):
            r = delta[i, j] / d
            ratio[i, j] = seen[i, j] / d
            way[i, j] = named[i, j] / d
            r = abs(r)
            if r > 0:
                v = min(v, speed_limit[lim, j] / r)
                a = min(a, acceleration_limit[lim, j] / r)
        if delta[i, k] != 0:
            a = min(a, drive_limit[i] * d / abs(delta[i, k]))
        nominal[i] = v
        acceleration[i] = a
    corner, start = _corners(
        length, nominal, acceleration, ratio, way, kind, stops, which, corner_limit, acceleration_limit,
        deviation, slowest, both_rules,
    )  # fmt: skip
    entry, cruise, leave, duration = _trapezoids(length, nominal, acceleration, corner, start, stops, blocks)
    for i in range(n):
        if homing[i]:
            duration[i] = 0.0
            entry[i] = cruise[i] = leave[i] = 0.0
            for j in range(k):
                duration[i] = max(duration[i], abs(delta[i, j]) / speed_limit[which[i], j])
            if duration[i] > 0:
                entry[i] = cruise[i] = leave[i] = length[i] / duration[i]
    return length, asked, entry, cruise, leave, acceleration, duration


@njit(cache=True)
def _corners(
    length: _F,
    nominal: _F,
    acceleration: _F,
    ratio: _F,
    way: _F,
    kind: NDArray[np.uint8],
    stops: NDArray[np.bool_],
    which: NDArray[np.int64],
    corner_limit: _F,
    acceleration_limit: _F,
    deviation: float,
    slowest: float,
    both_rules: bool,
) -> tuple[_F, _F]:
    """Squared speed allowed where a row begins, coming from the row before; and speed when it begins from rest."""
    n, columns = ratio.shape
    corner = np.zeros(n)
    start = np.zeros(n)
    last = -1
    last_safe = 0.0
    for i in range(n):
        if length[i] <= 0:
            continue
        limit = corner_limit[which[i]]
        safe = nominal[i]
        for j in range(columns):
            r = abs(ratio[i, j])
            if r * safe > limit[j]:
                safe = limit[j] / r
        start[i] = min(nominal[i], slowest)
        if last >= 0 and not stops[i]:
            v = min(nominal[i], nominal[last])
            if deviation <= 0 or both_rules:
                v = _jerk(nominal[last], nominal[i], ratio[last], ratio[i], limit)
                if last_safe > 0.99 * v and safe > 0.99 * v:
                    v = safe
            if deviation > 0:
                across = acceleration_limit[which[i]]
                before, after = _direction(way[last], kind[last]), _direction(way[i], kind[i])
                v = min(v, _junction(length[i], across, acceleration[i], before, after, deviation), nominal[i])
                v = min(v, nominal[last])
            corner[i] = v * v
        last = i
        last_safe = safe
    return corner, start


@njit(cache=True)
def _jerk(nominal_before: float, nominal: float, before: _F, after: _F, limit: _F) -> float:
    """Classic jerk of Marlin: the common speed at which no axis jumps too far, reversals counted by the larger side."""
    v = min(nominal, nominal_before)
    smaller = v / nominal_before
    factor = 1.0
    for j in range(len(limit)):
        leave = before[j] * nominal_before * smaller * factor
        enter = after[j] * nominal * factor
        if leave > enter:
            jump = leave - enter if (enter > 0 or leave < 0) else max(leave, -enter)
        else:
            jump = enter - leave if (enter < 0 or leave > 0) else max(-leave, enter)
        if jump > limit[j]:
            factor *= limit[j] / jump
    return v * factor


@njit(cache=True)
def _direction(way: _F, kind: int) -> _F:
    """Marlin's unit vector of a block: one only where filament moves, else the change of axes per unit of length.

    A travel that moves X and turns A makes it longer than one, and its corners look straighter than they are.
    """
    if kind & 4 == 0:
        return way.copy()
    return way / math.sqrt((way * way).sum())


@njit(cache=True)
def _junction(length: float, limit: _F, acceleration: float, before: _F, after: _F, deviation: float) -> float:
    """Junction deviation of Marlin, with its limit on short segments that form an arc."""
    cosine = -(before * after).sum()
    if cosine > 0.999999:
        return 0.0
    cosine = max(cosine, -0.999999)
    change = after - before
    size = math.sqrt((change * change).sum())
    across = acceleration
    if size > 0:
        for j in range(len(after)):
            share = abs(change[j]) / size
            if share * across > limit[j]:
                across = limit[j] / share
    sine = math.sqrt(0.5 * (1.0 - cosine))
    squared = across * deviation * sine / (1.0 - sine)
    if length < 1.0 and cosine < -0.7071067812:
        squared = min(squared, length * across / (0.5 * math.pi - _arc_sine(-cosine)))
    return math.sqrt(squared)


@njit(cache=True)
def _arc_sine(t: float) -> float:
    """Marlin's polynomial for it, 0.033 short of a right angle at 1 (JD_HANDLE_SMALL_SEGMENTS)."""
    power = 1.0
    total = 0.0
    for factor in (0.032843707, -1.451838349, 29.66153956, -131.1123477, 262.8130562, -242.7199627, 84.31466202):
        total += factor * power
        power *= t
    return total


@njit(cache=True)
def _trapezoids(
    length: _F, nominal: _F, acceleration: _F, corner: _F, start: _F, stops: NDArray[np.bool_], blocks: int
) -> tuple[_F, _F, _F, _F]:
    """Entry, cruise, exit and duration with a look-ahead of `blocks` rows, the last of which must be able to stop."""
    n = len(length)
    entry = np.zeros(n)
    cruise = np.zeros(n)
    leave = np.zeros(n)
    duration = np.zeros(n)
    moving = np.flatnonzero(length > 0)
    m = len(moving)
    # whether something between two moving rows, or the later one itself, makes the machine stop
    stopped = np.zeros(n, np.bool_)
    pending = True
    for i in range(n):
        pending = pending or stops[i]
        if length[i] > 0:
            stopped[i] = pending
            pending = False
    speed = 0.0
    for p in range(m):
        i = moving[p]
        first = start[i] if stopped[i] else speed
        last = min(m - 1, p + blocks - 1)
        ahead = 0.0
        for b in range(p + 1, last + 1):
            if stopped[moving[b]]:
                last = b - 1
                break
        for b in range(last, p, -1):
            j = moving[b]
            ahead = min(corner[j], ahead + 2 * acceleration[j] * length[j])
        a, d = acceleration[i], length[i]
        out = math.sqrt(min(ahead, first * first + 2 * a * d, nominal[i] ** 2))
        peak = math.sqrt((2 * a * d + first * first + out * out) / 2)
        v = max(min(nominal[i], peak), first, out)
        up, down = (v * v - first * first) / (2 * a), (v * v - out * out) / (2 * a)
        flat = max(0.0, d - up - down)
        entry[i], cruise[i], leave[i] = first, v, out
        duration[i] = (v - first) / a + (v - out) / a + flat / v
        speed = out
    return entry, cruise, leave, duration
