"""Turn a polyline in joint space into times, as a firmware executes it: ramps on the rows, small jumps at corners.

Along a row the joints move in a fixed proportion, so one speed v says everything: a joint's speed is v times its
share q' of a millimetre of path. Rows cap v by the wanted tip speed and by every joint's speed; ramps obey every
joint's acceleration; a corner caps v so that no joint's speed jumps by more than its corner speed, and so that a row
of small corners, which is a curve, bends no joint faster than its acceleration. Two passes of look-ahead then find
the fastest speeds from which every later cap can still be met (the planners of GRBL and Marlin, with no end to the
look-ahead).

            v  |      cap of the row
               |   ____________________
               |  /                    \\___ corner
               | /                          \\
               |/____________________________\\__ path
"""

from dataclasses import dataclass

import numba
import numpy as np

from trunnion_core.arrays import FloatArray, IntArray

STILL_TIP = 1e-6
"""mm. A row whose tip moves less is measured by its joints' time, not by its tip; machines resolve 1e-3 mm."""
BY_WISH = -1
"""Who limits a row: nobody but the wanted speed."""


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """When the rows of a polyline are executed. Speeds are of the row's measure (`length` per s)."""

    duration: FloatArray
    """(n,) s."""
    length: FloatArray
    """(n,) the measure of the row: mm of tip path, or s at the slowest joint's full speed where the tip is still."""
    entry: FloatArray
    """(n,) speed at the row's start."""
    peak: FloatArray
    """(n,) highest speed within the row."""
    leave: FloatArray
    """(n,) speed at the row's end."""
    acceleration: FloatArray
    """(n,) of the row's ramps."""
    steady: FloatArray
    """(n,) the speed that the row could hold if it went on for ever: its own caps and those of its bends."""
    limited_by: IntArray
    """(n,) column of the joint that sets `steady` (columns as given), or BY_WISH."""

    @property
    def total(self) -> float:
        """s in all."""
        return float(self.duration.sum())


def time_law(
    steps: FloatArray,
    tip_length: FloatArray,
    tip_speed: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    corner_speed: FloatArray,
    *,
    path_acceleration: FloatArray | None = None,
    linear: FloatArray | None = None,
    junction_deviation: float = 0.0,
) -> TimeLaw:
    """The fastest trapezoids along a polyline that starts and ends at rest.

    `steps` (n, k): what every joint (and the extruder) moves in each row, mm or rad. `tip_length` (n,) mm over the
    part and `tip_speed` (n,) mm/s wanted (inf: as fast as the joints go). `speed`, `acceleration`, `corner_speed`
    (k,) are the joints' limits. `path_acceleration` (n,), where given, also limits the machine's linear motion,
    measured over the columns marked in `linear` (k,). With `junction_deviation` (mm; Sungeun Jeon's rule, as in GRBL
    and Marlin) corners follow that instead of `corner_speed`.

    Rows whose tip is still are measured in s of their slowest joint at full speed; for them `tip_speed` is the share
    of that speed, 1 at most. Where such rows meet others the machine stops. Rows in which nothing moves take no time.
    One loop over the rows, about 5 million a second.
    """
    n, k = steps.shape
    inertia = np.full(n, np.inf) if path_acceleration is None else np.ascontiguousarray(path_acceleration)
    moved = np.zeros(k) if linear is None else np.asarray(linear, dtype=np.float64)
    out = _law(
        np.ascontiguousarray(steps),
        np.ascontiguousarray(tip_length),
        np.ascontiguousarray(tip_speed),
        speed,
        acceleration,
        corner_speed,
        inertia,
        moved,
        junction_deviation,
    )
    return TimeLaw(*out)


def speeds_at(law: TimeLaw, fraction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Time since the row's start (s) and speed inside each row, both (n, m), at `fraction` (m,) of its length."""
    entry, peak, leave = (value[:, None] for value in (law.entry, law.peak, law.leave))
    a = np.maximum(law.acceleration, np.finfo(float).tiny)[:, None]
    length = law.length[:, None]
    s = fraction[None, :] * length
    up = (peak**2 - entry**2) / (2 * a)
    down = length - (peak**2 - leave**2) / (2 * a)
    v = np.where(
        s < up,
        np.sqrt(np.maximum(entry**2 + 2 * a * s, 0)),
        np.where(s > down, np.sqrt(np.maximum(leave**2 + 2 * a * (length - s), 0)), peak),
    )
    safe = np.maximum(peak, np.finfo(float).tiny)
    cruise = np.maximum(down - up, 0) / safe
    t = np.where(
        s < up,
        (v - entry) / a,
        np.where(s > down, (peak - entry) / a + cruise + (peak - v) / a, (peak - entry) / a + (s - up) / safe),
    )
    return np.where(peak > 0, t, 0.0), np.where(peak > 0, v, 0.0)


@numba.njit(cache=True, error_model="numpy")
def _law(
    steps: FloatArray,
    tip_length: FloatArray,
    tip_speed: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    corner_speed: FloatArray,
    inertia: FloatArray,
    linear: FloatArray,
    junction_deviation: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    n, k = steps.shape
    length = np.empty(n)
    ramp = np.empty(n)
    cap = np.empty(n)
    steady = np.empty(n)
    limited = np.full(n, BY_WISH)
    entry = np.empty(n)
    by_tip = np.empty(n, dtype=np.bool_)

    for i in range(n):
        by_tip[i] = tip_length[i] > STILL_TIP
        rate = 0.0
        strain = 0.0
        stretch = 0.0
        slowest = 0
        for j in range(k):
            step = abs(steps[i, j])
            if step / speed[j] > rate:
                rate = step / speed[j]
                slowest = j
            strain = max(strain, step / acceleration[j])
            stretch += linear[j] * step * step
        strain = max(strain, np.sqrt(stretch) / inertia[i])
        length[i] = tip_length[i] if by_tip[i] else rate
        if length[i] <= 0.0:
            cap[i] = 0.0
            ramp[i] = 0.0
        else:
            cap[i] = length[i] / rate if rate > 0 else np.inf
            ramp[i] = length[i] / strain if strain > 0 else np.inf
            limited[i] = slowest
            if tip_speed[i] <= cap[i]:
                cap[i] = tip_speed[i]
                limited[i] = BY_WISH
        steady[i] = cap[i]

    # Corners: `entry` holds the highest speed at the start of each row. Rows in which nothing moves are passed over.
    before = -1
    for i in range(n):
        entry[i] = 0.0
        if length[i] <= 0.0:
            continue
        b = before
        before = i
        if b < 0 or by_tip[b] != by_tip[i]:
            continue
        limit = min(cap[b], cap[i])
        dot = 0.0
        size_b = 0.0
        size_i = 0.0
        for j in range(k):
            share_b = steps[b, j] / length[b]
            share_i = steps[i, j] / length[i]
            dot += share_b * share_i
            size_b += share_b * share_b
            size_i += share_i * share_i
            jump = abs(share_b - share_i)
            if junction_deviation <= 0.0 and jump * limit > corner_speed[j]:
                limit = corner_speed[j] / jump
            # The bend is met halfway: from the middle of one row to the middle of the next.
            bend = np.sqrt(0.5 * (length[b] + length[i]) * acceleration[j] / jump) if jump > 0.0 else np.inf
            if bend < limit:
                limit = bend
            if bend < steady[b]:
                steady[b] = bend
                limited[b] = j
            if bend < steady[i]:
                steady[i] = bend
                limited[i] = j
        if junction_deviation > 0.0:
            size = np.sqrt(size_b * size_i)
            half = np.sqrt(max(0.5 * (1.0 + dot / size), 0.0)) if size > 0.0 else 1.0
            if half < 1.0 - 1e-12:
                # sin of half the angle between the rows, seen from the corner, is cos of half the turn.
                radius = junction_deviation * half / (1.0 - half)
                widest = np.sqrt(max(size_b, size_i))
                limit = min(limit, np.sqrt(min(ramp[b], ramp[i]) * radius / widest))
        entry[i] = limit

    leave = np.zeros(n)
    following = 0.0
    for i in range(n - 1, -1, -1):
        if length[i] <= 0.0:
            continue
        leave[i] = following
        entry[i] = min(entry[i], np.sqrt(following * following + 2.0 * ramp[i] * length[i]))
        following = entry[i]

    peak = np.zeros(n)
    duration = np.zeros(n)
    current = 0.0
    for i in range(n):
        if length[i] <= 0.0:
            entry[i] = 0.0
            continue
        v0 = min(entry[i], current)
        v1 = min(leave[i], np.sqrt(v0 * v0 + 2.0 * ramp[i] * length[i]))
        top = min(cap[i], np.sqrt(0.5 * (v0 * v0 + v1 * v1) + ramp[i] * length[i]))
        top = max(top, max(v0, v1))
        entry[i] = v0
        leave[i] = v1
        peak[i] = top
        if ramp[i] == np.inf:
            duration[i] = length[i] / top
        else:
            flat = length[i] - (2.0 * top * top - v0 * v0 - v1 * v1) / (2.0 * ramp[i])
            duration[i] = (2.0 * top - v0 - v1) / ramp[i] + max(flat, 0.0) / top
        current = v1
    return duration, length, entry, peak, leave, ramp, steady, limited
