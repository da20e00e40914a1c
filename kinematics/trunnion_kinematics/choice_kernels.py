"""The loops behind `branches.choose`: candidates of every row, and the dynamic program over them.

A state of a row is one candidate solution with one winding of each rotary inside its limits. A rotary whose windings
are free has one state: its step is then the turn to the nearest winding, which is the cheapest edge and leaves the same
future, so nothing is lost.

Most rows offer no choice: from each candidate there is one way on, the same for all its windings. Such a row *glides*:
what it costs is added to the candidate, not to its windings (`glide_kernels`), so that many windings cost no more than
one. Only the other rows, those where the joints may jump and those where candidates are worth exchanging, look at every
pair of states.
"""

import numpy as np
from numba import njit

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_kinematics.chain_kernels import lean, solve
from trunnion_kinematics.glide_kernels import (
    AT1,
    AT2,
    FROM1,
    FROM2,
    ROOT,
    TO1,
    TO2,
    glide_alone,
    glide_free,
    rises,
    settle,
)
from trunnion_kinematics.reach import LIMIT_SLACK
from trunnion_kinematics.winding_kernels import TURN, count, edge, lifted, nearest, opening, steepest, unwind

SLOPE_SLACK = 1 + 1e-9
"""Rounding of sums of times."""
GLIDES = -1
"""Stands in for the place of a row's sources where the row glides."""


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

    run (n,) and early (runs, a): what it costs to come to a travel within a run at each of its anchors. windings (2,)
    states of each rotary, 0 where they are free. low and high (2,) limits of the rotaries, speed (k,) of all joints.
    costs: weight of time while extruding, preference for still rotaries, cost of a rewind. start (k,) begins with NaN
    where there is none. pointer: first room for the sources of states. Returns -1, or the first row that has no state.

    All windings of a pair of candidates share the price of a step, so the step is priced once for each difference of
    windings, the least turn first, and no further once none can be better: O(candidates^2 x windings) a row. None can
    be better, too, where one turn more adds its whole time to the price, and the values of neighbouring windings differ
    by no more than that: then a source one turn nearer is at least as good. Rows that extrude are tried without jumps
    first, and with them only if no state is reached at all. A row that glides takes O(candidates^2).
    """
    n = offset.shape[0] - 1
    free1, free2 = windings[0] == 0, windings[1] == 0
    count1, count2 = max(1, windings[0]), max(1, windings[1])
    per = count1 * count2
    most = 0
    for i in range(n):
        most = max(most, offset[i + 1] - offset[i])
    value, before = np.empty(most * per), np.empty(most * per)
    least, slope, kept, rise = np.empty(most), np.empty(most), np.empty(most), np.empty((most, most, 2))
    base, base_before = np.empty((most, 2)), np.empty((most, 2))
    ends, ends_before = np.zeros((most, 2), np.int64), np.zeros((most, 2), np.int64)
    track, track_before = np.zeros((most, 7), np.int64), np.zeros((most, 7), np.int64)
    gain, gain_before = np.zeros(most), np.zeros(most)
    source, sources_at, used = np.empty(offset[n], np.int32), np.full(n, GLIDES, np.int64), 0
    for i in range(n):
        base, base_before = base_before, base
        ends, ends_before = ends_before, ends
        track, track_before = track_before, track
        gain, gain_before = gain_before, gain
        here, there = offset[i], offset[i - 1] if i > 0 else 0
        many, many_before = offset[i + 1] - here, here - there
        standing = False
        for b in range(many):
            base[b, 0] = lifted(candidates[here + b, whole[0]], low[0], free1)
            base[b, 1] = lifted(candidates[here + b, whole[1]], low[1], free2)
            ends[b, 0] = count(base[b, 0], high[0], count1, free1) if usable[here + b] else 0
            ends[b, 1] = count(base[b, 1], high[1], count2, free2) if usable[here + b] else 0
            if ends[b, 0] > 0 and ends[b, 1] > 0:
                standing = True
        if not standing:
            return i
        inside = i > 0 and run[i] >= 0 and run[i] == run[i - 1]
        if inside and travel[i]:
            for a in range(many_before):
                gain_before[a] += early[run[i], a]
        widths = sine[i - 1] + sine[i], sine2, sweep_limit[i]
        if inside:
            glides = glide_free(
                whole, candidates, here, there, many, base, base_before, ends, track, track_before, gain, gain_before,
                source, rise, kept, speed, widths, travel[i], floor[i], costs, free1, free2, per, count2,
            )  # fmt: skip
        else:
            glides = i > 0 and not travel[i] and run[i] < 0 and run[i - 1] < 0
            glides = glides and glide_alone(
                whole, candidates, here, there, many, many_before, base, base_before, ends, track, track_before, gain,
                gain_before, source, speed, widths, floor[i], costs, free1, free2, per, count2,
            )  # fmt: skip
        if glides:
            continue
        if used + many * per > pointer.shape[0]:
            larger = np.empty(2 * (used + many * per), pointer.dtype)
            larger[:used] = pointer[:used]
            pointer = larger
        place = pointer[used : used + many * per]
        sources_at[i] = used
        used += many * per
        if i > 0:
            settle(value, before, track_before, gain_before, many_before, count1, count2)
            for a in range(many_before):
                cells = before[a * per : a * per + per]
                least[a] = cells.min()
                slope[a] = steepest(cells, count1, count2) if count1 > 4 else np.inf
        value[: many * per] = np.inf
        arrived = False
        for attempt in range(2):
            may_jump = i == 0 or travel[i] or attempt == 1
            if arrived:
                break
            for b in range(many):
                m = here + b
                cells, sources = value[b * per : b * per + per], place[b * per : b * per + per]
                ends1, ends2 = ends[b]
                if ends1 == 0 or ends2 == 0:
                    continue
                if i == 0:
                    arrived = True
                    for s in range(per):
                        if s // count2 < ends1 and s % count2 < ends2:
                            full1, full2 = base[b, 0] + TURN * (s // count2), base[b, 1] + TURN * (s % count2)
                            cells[s] = opening(whole, candidates[m], full1, full2, free1, free2, start, speed, costs)
                    continue
                worst = np.inf
                for a in range(many_before):
                    if not least[a] < worst:
                        continue
                    old = before[a * per : a * per + per]
                    time0 = floor[i]
                    for j in range(2, 5):
                        c = whole[j]
                        time0 = max(time0, abs(candidates[m, c] - candidates[there + a, c]) / speed[c])
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
                            price = edge(time, time1 + time2, jumps, travel[i], costs)
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
                                            sources[w1 * count2 + w2] = a * per + v
                                            arrived = True
                                worst = 0.0
                                for w1 in range(ends1):
                                    for w2 in range(ends2):
                                        worst = max(worst, cells[w1 * count2 + w2])
                            if free1:
                                break
        for b in range(many):
            gain[b] = 0.0
            track[b, ROOT], track[b, AT1], track[b, AT2] = b, 0, 0
            track[b, FROM1], track[b, FROM2] = 0, 0
            track[b, TO1], track[b, TO2] = ends[b]
        if run[i] >= 0:
            rises(value, base, ends, many, per, count2, free1, rise)
    settle(value, before, track, gain, offset[n] - offset[n - 1], count1, count2)
    state = int(np.argmin(before[: (offset[n] - offset[n - 1]) * per]))
    for i in range(n - 1, -1, -1):
        m = offset[i] + state // per
        joints[i] = candidates[m]
        joints[i, whole[0]] = lifted(candidates[m, whole[0]], low[0], free1) + TURN * (state // count2 % count1)
        joints[i, whole[1]] = lifted(candidates[m, whole[1]], low[1], free2) + TURN * (state % count2)
        if i > 0:
            state = source[m] + state % per if sources_at[i] == GLIDES else pointer[sources_at[i] + state]
    return int(unwind(whole, joints, free1, free2, start, sine, sine2, sweep_limit, jump))
