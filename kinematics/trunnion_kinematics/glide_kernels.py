"""Rows of the dynamic program that offer no choice: a whole candidate goes on, with all its windings at once.

After a row that was looked at in full, `value` holds what every state costs. While rows glide, each candidate only
keeps track of whose windings in `value` are now its own, shifted by how many turns, which of them are still inside the
limits, and what was paid since. `settle` writes the values out again.
"""

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_kinematics.winding_kernels import TURN, edge, nearest

ROOT, AT1, AT2, FROM1, TO1, FROM2, TO2 = range(7)
"""Columns of a candidate's track: its root in `value`, the windings at which winding 0 of the root now is, and the
root's windings, first and past the last, that are still inside the limits."""
WORTH = 1e-10
"""s. An exchange of candidates that gains less is rounding."""


@njit(cache=True, error_model="numpy")
def glide_alone(
    whole: IntArray,
    candidates: FloatArray,
    here: int,
    there: int,
    many: int,
    many_before: int,
    base: FloatArray,
    base_before: FloatArray,
    ends: IntArray,
    track: IntArray,
    track_before: IntArray,
    gain: FloatArray,
    gain_before: FloatArray,
    source: IntArray,
    speed: FloatArray,
    widths: tuple[float, float, float],
    floor: float,
    costs: FloatArray,
    free1: bool,
    free2: bool,
    per: int,
    count2: int,
) -> bool:
    """Glide an extruding row if every candidate is reached without a jump from one candidate and winding at most."""
    sines, sine2, sweep_limit = widths
    alive = False
    for b in range(many):
        track[b, TO1] = track[b, FROM1] = 0
        if ends[b, 0] == 0 or ends[b, 1] == 0:
            continue
        found = False
        for a in range(many_before):
            if track_before[a, TO1] <= track_before[a, FROM1] or track_before[a, TO2] <= track_before[a, FROM2]:
                continue
            step1, step2 = nearest(base[b, 0] - base_before[a, 0]), nearest(base[b, 1] - base_before[a, 1])
            sweep = 0.5 * sines * abs(step1) + sine2 * abs(step2)
            if sweep > sweep_limit:
                continue
            further1 = np.inf if free1 else 0.5 * sines * (TURN - 2 * abs(step1))
            further2 = np.inf if free2 else sine2 * (TURN - 2 * abs(step2))
            if found or sweep + min(further1, further2) <= sweep_limit:
                return False
            found = True
            go_on(
                whole, candidates, here + b, there + a, b, a, step1, step2, base, base_before, ends, track,
                track_before, gain, gain_before, source, speed, False, floor, costs, free1, free2, per, count2,
            )  # fmt: skip
        if track[b, TO1] > track[b, FROM1] and track[b, TO2] > track[b, FROM2]:
            alive = True
    return alive


@njit(cache=True, error_model="numpy")
def glide_free(
    whole: IntArray,
    candidates: FloatArray,
    here: int,
    there: int,
    many: int,
    base: FloatArray,
    base_before: FloatArray,
    ends: IntArray,
    track: IntArray,
    track_before: IntArray,
    gain: FloatArray,
    gain_before: FloatArray,
    source: IntArray,
    rise: FloatArray,
    kept: FloatArray,
    speed: FloatArray,
    widths: tuple[float, float, float],
    travels: bool,
    floor: float,
    costs: FloatArray,
    free1: bool,
    free2: bool,
    per: int,
    count2: int,
) -> bool:
    """Glide a row within a run of free rows if staying at its angle of rotary 1 is best for every state.

    A turn by d costs at least weight floor + u(d), u(d) = weight max(0, d / speed - floor) + preference d / speed. u is
    convex and u(0) = 0, so u(d1) + u(d2) <= u(d1 + d2): where no state gains by a turn of up to a whole turn, none
    gains by a longer one. That holds, too, with the turn of rotary 2, where rotary 1 takes longer.

    rise (many, many, 2): by how much the value rises, at most over the windings, from candidate a to the place of
    candidate b next above it, and from there down to a. kept (many,) is room for what staying costs.
    """
    sines, sine2, sweep_limit = widths
    weight = 1.0 if travels else costs[0]
    for b in range(many):
        if ends[b, 0] == 0 or ends[b, 1] != 1 or track_before[b, TO2] - track_before[b, FROM2] != 1:
            return False
        if ends[b, 0] != track_before[b, TO1] - track_before[b, FROM1]:
            return False
        step2 = nearest(base[b, 1] - base_before[b, 1])
        if sine2 * abs(step2) > sweep_limit:
            return False
        kept[b] = go_on(
            whole, candidates, here + b, there + b, b, b, 0.0, step2, base, base_before, ends, track,
            track_before, gain, gain_before, source, speed, travels, floor, costs, free1, free2, per, count2,
        )  # fmt: skip
        kept[b] -= weight * floor
    for a in range(many):
        for b in range(many):
            turn = above(base[a, 0], base[b, 0], free1) / speed[whole[0]]
            ahead = gain_before[b] - gain_before[a]
            for way in range(2):
                x, y = (a, b) if way == 0 else (b, a)
                gains = rise[a, b, way] + (ahead if way == 0 else -ahead) + kept[y]
                if gains <= weight * max(0.0, turn - floor) + costs[1] * turn + WORTH:
                    continue
                step2 = abs(nearest(base[y, 1] - base_before[x, 1]))
                if not travels and 0.5 * sines * turn * speed[whole[0]] + sine2 * step2 > sweep_limit:
                    continue
                turn2 = step2 / speed[whole[1]]
                longest = turn2
                for j in range(2, 5):
                    c = whole[j]
                    longest = max(longest, abs(candidates[here + y, c] - candidates[there + x, c]) / speed[c])
                if longest > max(turn, floor):
                    return False
                if gains > weight * max(0.0, turn - floor) + costs[1] * (turn + turn2) + WORTH:
                    return False
    return True


@njit(cache=True, error_model="numpy", inline="always")
def above(a: float, b: float, free: bool) -> float:
    """rad from a up to the next place of b above it; where windings are free, the shorter way."""
    gap = (b - a) % TURN
    if free:
        return float(min(gap, TURN - gap))
    return float(gap) if gap > 0.0 else TURN


@njit(cache=True, error_model="numpy")
def go_on(
    whole: IntArray,
    candidates: FloatArray,
    m: int,
    m_before: int,
    b: int,
    a: int,
    step1: float,
    step2: float,
    base: FloatArray,
    base_before: FloatArray,
    ends: IntArray,
    track: IntArray,
    track_before: IntArray,
    gain: FloatArray,
    gain_before: FloatArray,
    source: IntArray,
    speed: FloatArray,
    travels: bool,
    floor: float,
    costs: FloatArray,
    free1: bool,
    free2: bool,
    per: int,
    count2: int,
) -> float:
    """Let candidate b go on from candidate a by these steps of the rotaries; returns what it costs."""
    time1, time2 = abs(step1) / speed[whole[0]], abs(step2) / speed[whole[1]]
    time = max(floor, time1, time2)
    for j in range(2, 5):
        c = whole[j]
        time = max(time, abs(candidates[m, c] - candidates[m_before, c]) / speed[c])
    price = edge(time, time1 + time2, False, travels, costs)
    more1 = 0 if free1 else int(np.rint((step1 - base[b, 0] + base_before[a, 0]) / TURN))
    more2 = 0 if free2 else int(np.rint((step2 - base[b, 1] + base_before[a, 1]) / TURN))
    at1, at2 = track_before[a, AT1] + more1, track_before[a, AT2] + more2
    track[b, ROOT], track[b, AT1], track[b, AT2] = track_before[a, ROOT], at1, at2
    track[b, FROM1], track[b, TO1] = max(track_before[a, FROM1], -at1), min(track_before[a, TO1], ends[b, 0] - at1)
    track[b, FROM2], track[b, TO2] = max(track_before[a, FROM2], -at2), min(track_before[a, TO2], ends[b, 1] - at2)
    gain[b] = gain_before[a] + price
    source[m] = a * per - more1 * count2 - more2
    return float(price)


@njit(cache=True, error_model="numpy")
def settle(
    value: FloatArray, now: FloatArray, track: IntArray, gain: FloatArray, many: int, count1: int, count2: int
) -> None:
    """Fill `now` with what every state costs; inf outside the limits."""
    per = count1 * count2
    now[: many * per] = np.inf
    for b in range(many):
        root, at1, at2 = track[b, ROOT] * per, track[b, AT1], track[b, AT2]
        for r1 in range(track[b, FROM1], track[b, TO1]):
            for r2 in range(track[b, FROM2], track[b, TO2]):
                now[b * per + (r1 + at1) * count2 + r2 + at2] = value[root + r1 * count2 + r2] + gain[b]


@njit(cache=True, error_model="numpy")
def rises(
    value: FloatArray,
    base: FloatArray,
    ends: IntArray,
    many: int,
    per: int,
    count2: int,
    free1: bool,
    result: FloatArray,
) -> None:
    """Fill result (many, many, 2): see `glide_free`; -inf where there are no two such places."""
    for a in range(many):
        for b in range(many):
            result[a, b, 0] = result[a, b, 1] = -np.inf
            over = 0 if free1 or base[b, 0] > base[a, 0] else 1
            for w in range(min(ends[a, 0], ends[b, 0] - over)):
                low, high = value[a * per + w * count2], value[b * per + (w + over) * count2]
                if (low < np.inf or high < np.inf) and not (free1 and a == b):
                    result[a, b, 0] = max(result[a, b, 0], high - low)
                    result[a, b, 1] = max(result[a, b, 1], low - high)
