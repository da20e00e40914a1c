"""The loops behind `branches.choose`: candidates of every row, and the dynamic program over them.

A state of a row is one candidate solution with one winding of each rotary inside its limits. A rotary whose windings
are free has one state: its step is then the turn to the nearest winding, which is the cheapest edge and leaves the same
future, so nothing is lost.
"""

import numpy as np
from numba import njit

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_kinematics.chain_kernels import lean, solve
from trunnion_kinematics.reach import LIMIT_SLACK
from trunnion_kinematics.winding_kernels import TURN, count, edge, lifted, nearest, opening, steepest, unwind

SLOPE_SLACK = 1 + 1e-9
"""Rounding of sums of times."""


@njit(cache=True, error_model="numpy")
def candidates_kernel(
    t: FloatArray,
    whole: IntArray,
    points: FloatArray,
    tool_axes: FloatArray,
    offset: IntArray,
    run: IntArray,
    anchors: FloatArray,
    low: FloatArray,
    high: FloatArray,
    candidates: FloatArray,
    usable: BoolArray,
) -> None:
    """Fill candidates (m, k) and whether linear limits allow them; row i owns offset[i] to offset[i+1].

    A row in no run of free rows (run -1) has both branches of inverse; another has one candidate for each of its run's
    anchors, angles of rotary 1 to which rotary 2 is then fitted.
    """
    for i in range(points.shape[0]):
        if run[i] < 0:
            solve(t, whole, points[i], tool_axes[i], candidates[offset[i]], candidates[offset[i] + 1])
        else:
            for a in range(offset[i + 1] - offset[i]):
                lean(t, whole, points[i], tool_axes[i], anchors[run[i], a], candidates[offset[i] + a])
        for m in range(offset[i], offset[i + 1]):
            good = True
            for j in range(2, 5):
                value = candidates[m, whole[j]]
                if not (low[whole[j]] - LIMIT_SLACK <= value <= high[whole[j]] + LIMIT_SLACK):
                    good = False
            usable[m] = good


@njit(cache=True, error_model="numpy")
def choice_kernel(
    whole: IntArray,
    candidates: FloatArray,
    usable: BoolArray,
    offset: IntArray,
    run: IntArray,
    early: FloatArray,
    windings: IntArray,
    low: FloatArray,
    high: FloatArray,
    speed: FloatArray,
    sine: FloatArray,
    sine2: float,
    sweep_limit: FloatArray,
    travel: BoolArray,
    floor: FloatArray,
    start: FloatArray,
    costs: FloatArray,
    pointer: IntArray,
    joints: FloatArray,
    jump: BoolArray,
) -> int:
    """Fill joints (n, k) with the cheapest sequence of states and jump (n,) with where it jumps.

    run (n,) and early (runs, a): what each anchor of a row's run costs in the row. windings (2,) states of each rotary,
    0 where they are free. low and high (2,) limits of the rotaries, speed (k,) of all joints. costs: weight of time
    while extruding, preference for still rotaries, cost of a rewind. start (k,) begins with NaN where there is none.
    pointer: room for one number a state. Returns -1, or the first row that has no state.

    All windings of a pair of candidates share the price of a step, so the step is priced once for each difference of
    windings, the least turn first, and no further once none can be better: O(candidates^2 x windings) a row. None can
    be better, too, where one turn more adds its whole time to the price, and the values of neighbouring windings differ
    by no more than that: then a source one turn nearer is at least as good. Rows that extrude are tried without jumps
    first, and with them only if no state is reached at all.
    """
    n = offset.shape[0] - 1
    free1, free2 = windings[0] == 0, windings[1] == 0
    count1, count2 = max(1, windings[0]), max(1, windings[1])
    per = count1 * count2
    most = 0
    for i in range(n):
        most = max(most, offset[i + 1] - offset[i])
    value, before = np.empty(most * per), np.empty(most * per)
    least, slope = np.empty(most), np.empty(most)
    base, base_before = np.empty((most, 2)), np.empty((most, 2))
    ends, ends_before = np.zeros((most, 2), np.int64), np.zeros((most, 2), np.int64)
    for i in range(n):
        value, before = before, value
        base, base_before = base_before, base
        ends, ends_before = ends_before, ends
        standing = arrived = False
        for attempt in range(2):
            may_jump = travel[i] or attempt == 1
            if arrived or (attempt == 1 and not standing):
                break
            for b in range(offset[i + 1] - offset[i]):
                m = offset[i] + b
                cells, place = value[b * per : b * per + per], pointer[m * per : m * per + per]
                cells[:] = np.inf
                base[b, 0] = lifted(candidates[m, whole[0]], low[0], free1)
                base[b, 1] = lifted(candidates[m, whole[1]], low[1], free2)
                ends1 = count(base[b, 0], high[0], count1, free1) if usable[m] else 0
                ends2 = count(base[b, 1], high[1], count2, free2) if usable[m] else 0
                ends[b] = ends1, ends2
                if ends1 == 0 or ends2 == 0:
                    continue
                standing = True
                ahead = early[run[i], b] if run[i] >= 0 else 0.0
                if i == 0:
                    arrived = True
                    for s in range(per):
                        if s // count2 < ends1 and s % count2 < ends2:
                            full1, full2 = base[b, 0] + TURN * (s // count2), base[b, 1] + TURN * (s % count2)
                            cells[s] = ahead + opening(
                                whole, candidates[m], full1, full2, free1, free2, start, speed, costs
                            )
                    continue
                worst = np.inf
                for a in range(offset[i] - offset[i - 1]):
                    if not least[a] < worst:
                        continue
                    old = before[a * per : a * per + per]
                    time0 = floor[i]
                    for j in range(2, 5):
                        c = whole[j]
                        time0 = max(time0, abs(candidates[m, c] - candidates[offset[i - 1] + a, c]) / speed[c])
                    gap1, gap2 = base[b, 0] - base_before[a, 0], base[b, 1] - base_before[a, 1]
                    near1 = -int(np.rint(gap1 / TURN))
                    for more2 in range(1 - ends_before[a, 1], ends2):
                        step2 = abs(nearest(gap2) if free2 else gap2 + TURN * more2)
                        barred = 0
                        for out in range(2 * (count1 + abs(near1)) + 1):
                            more1 = near1 + ((out + 1) // 2 if out % 2 == 1 else -(out // 2))
                            if more1 <= -ends_before[a, 0] or more1 >= ends1:
                                continue
                            step1 = abs(nearest(gap1) if free1 else gap1 + TURN * more1)
                            time1, time2 = step1 / speed[whole[0]], step2 / speed[whole[1]]
                            sweep = 0.5 * (sine[i - 1] + sine[i]) * step1 + sine2 * step2
                            time = max(time0, time1, time2)
                            jumps = sweep > sweep_limit[i]
                            if jumps and not may_jump:
                                barred += 1
                                if barred == 2 or free1:
                                    break
                                continue
                            barred = 0
                            inner = step1 - 2 * TURN
                            if (
                                out >= 8
                                and slope[a] * speed[whole[0]] <= TURN * (1.0 if travel[i] else costs[0]) * SLOPE_SLACK
                                and inner / speed[whole[0]] >= max(time0, time2)
                                and jumps == (sweep - (sine[i - 1] + sine[i]) * TURN > sweep_limit[i])
                            ):
                                break
                            price = edge(time, time1 + time2, jumps, travel[i], costs) + ahead
                            if out % 2 == 1 and least[a] + max(time0, time1 - TURN / speed[whole[0]]) >= worst:
                                break
                            if least[a] + price < worst:
                                first1 = 0 if free1 else max(0, more1)
                                last1 = 1 if free1 else min(ends1, ends_before[a, 0] + more1)
                                for w1 in range(first1, last1):
                                    v1 = 0 if free1 else w1 - more1
                                    for w2 in range(max(0, more2), min(ends2, ends_before[a, 1] + more2)):
                                        v = v1 * count2 + w2 - more2
                                        if old[v] + price < cells[w1 * count2 + w2]:
                                            cells[w1 * count2 + w2] = old[v] + price
                                            place[w1 * count2 + w2] = a * per + v
                                            arrived = True
                                worst = 0.0
                                for w1 in range(ends1):
                                    for w2 in range(ends2):
                                        worst = max(worst, cells[w1 * count2 + w2])
                            if free1:
                                break
        if not standing:
            return i
        for b in range(offset[i + 1] - offset[i]):
            least[b] = np.inf
            for s in range(b * per, b * per + per):
                least[b] = min(least[b], value[s])
            slope[b] = steepest(value[b * per : b * per + per], count1, count2) if count1 > 4 else np.inf
    state = 0
    for s in range((offset[n] - offset[n - 1]) * per):
        if value[s] < value[state]:
            state = s
    for i in range(n - 1, -1, -1):
        m = offset[i] + state // per
        joints[i] = candidates[m]
        joints[i, whole[0]] = lifted(candidates[m, whole[0]], low[0], free1) + TURN * (state // count2 % count1)
        joints[i, whole[1]] = lifted(candidates[m, whole[1]], low[1], free2) + TURN * (state % count2)
        state = pointer[offset[i] * per + state]
    return int(unwind(whole, joints, free1, free2, start, sine, sine2, sweep_limit, jump))
