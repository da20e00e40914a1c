r"""The flow out of a nozzle behind what the drive pushes in, as compiled loops: first-order lag, exact in every phase.

Filament that is in but not yet out, x, is under pressure, and flow follows pressure: q = x / K. Nothing is sucked back
through the bore: while x is negative (filament drawn back) there is no flow, and what is pushed first fills the gap.

    x > 0:  dx/dt = p(t) - x / K        p(t) = c0 + c1 t in each phase of a trapezoid, so
            x(t) = a + K c1 t + (x(0) - a) exp(-t / K),  a = K (c0 - K c1)
    x <= 0: dx/dt = p(t)
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]
AT_ONCE, HELD, RAMPS = 0, 1, 2
"""What a firmware's own advance does between moves: it jumps with the speed, and to nothing where it does not apply
(Klipper); it jumps with the speed, and stays as it is where it does not apply (Marlin); it only follows ramps, and
jumps of speed count for nothing (RepRapFirmware)."""
STEPS = 60
"""Bisections for the time at which flow ceases: to the last bit."""
MOST_TURNS = 16
"""Times that flow may cease and begin in one phase: more than its speed, which is linear in time, has turns."""
NOTHING = 1e-12
"""mm on either side of none, so that a phase that has ceased does not begin again by rounding."""


@njit(cache=True)
def run(
    per_length: _F,
    entry: _F,
    cruise: _F,
    leave: _F,
    acceleration: _F,
    begin: _F,
    duration: _F,
    lag: _F,
    ahead: _F,
    between: int,
) -> tuple[_F, _F]:
    """(n, 3) mm of filament that leave the nozzle in each phase of each row, and (n,) in excess when it starts.

    `per_length` (n,) mm of filament to a unit of the rows' length, the next four (n,) their trapezoids in these units,
    `begin` and `duration` (n,) s. `lag` (n,) s is K of the plastic, 0 where flow follows at once; `ahead` (n,) s is K
    of the firmware's own advance, 0 where it applies none. What flows at rest between two rows belongs to neither.
    """
    n = len(begin)
    out, before = np.zeros((n, 3)), np.zeros(n)
    excess = 0.0
    own = 0.0
    end = begin[0] if n else 0.0
    for i in range(n):
        _, excess = _phase(excess, 0.0, 0.0, begin[i] - end, lag[i])
        end = begin[i] + duration[i]
        a, v0, v, v1 = acceleration[i], entry[i], cruise[i], leave[i]
        up, down = (v - v0) / a, (v - v1) / a
        flat = max(duration[i] - up - down, 0.0)
        r, k = per_length[i], ahead[i]
        if k > 0.0:
            if between != RAMPS:
                excess += k * r * v0 - own
            own = k * r * v1
        elif between == AT_ONCE:
            excess -= own
            own = 0.0
        before[i] = excess
        out[i, 0], excess = _phase(excess, r * (v0 + k * a), r * a, up, lag[i])
        out[i, 1], excess = _phase(excess, r * v, 0.0, flat, lag[i])
        out[i, 2], excess = _phase(excess, r * (v - k * a), -r * a, down, lag[i])
    return out, before


@njit(cache=True)
def flow_at(
    times: _F,
    row: NDArray[np.int64],
    per_length: _F,
    entry: _F,
    cruise: _F,
    leave: _F,
    acceleration: _F,
    begin: _F,
    duration: _F,
    lag: _F,
    ahead: _F,
    before: _F,
) -> _F:
    """(m,) mm/s of filament that leave the nozzle at `times` (m,) s, each within or after its `row` (m,)."""
    flow = np.zeros(len(times))
    for j in range(len(times)):
        i = row[j]
        left = times[j] - begin[i]
        if left < 0.0:
            continue
        a, v0, v, v1 = acceleration[i], entry[i], cruise[i], leave[i]
        up, down = (v - v0) / a, (v - v1) / a
        flat = max(duration[i] - up - down, 0.0)
        r, k, excess, pushed = per_length[i], ahead[i], before[i], 0.0
        for phase in range(4):
            if phase == 0:
                c0, c1, lasts = r * (v0 + k * a), r * a, up
            elif phase == 1:
                c0, c1, lasts = r * v, 0.0, flat
            elif phase == 2:
                c0, c1, lasts = r * (v - k * a), -r * a, down
            else:
                c0, c1, lasts = 0.0, 0.0, np.inf
            now = min(left, lasts)
            _, excess = _phase(excess, c0, c1, now, lag[i])
            pushed = c0 + c1 * now
            left -= now
            if left <= 0.0:
                break
        if lag[i] > 0.0:
            flow[j] = max(excess, 0.0) / lag[i]
        else:
            flow[j] = max(pushed, 0.0)
    return flow


@njit(cache=True)
def _phase(x: float, c0: float, c1: float, lasts: float, lag: float) -> tuple[float, float]:
    """mm that leave in `lasts` s of pushing c0 + c1 t mm/s, and mm in excess then, from `x` mm in excess."""
    out = 0.0
    for _ in range(MOST_TURNS):
        if not lasts > 0.0:
            return out, x
        if not (x > 0.0 or (x == 0.0 and (c0 > 0.0 or (c0 == 0.0 and c1 > 0.0)))):
            time = _until_full(x, c0, c1, lasts)
            x = x + c0 * time + 0.5 * c1 * time * time if time >= lasts else NOTHING
        elif lag <= 0.0:
            # No lag: what is in excess is out at once, and flow is what is pushed, until filament is drawn back.
            time = lasts if c0 + c1 * lasts >= 0.0 else (-c0 / c1 if c0 > 0.0 else 0.0)
            out += x + c0 * time + 0.5 * c1 * time * time
            x = 0.0
        else:
            time = _until_dry(x, c0, c1, lasts, lag)
            end = _excess(x, c0, c1, time, lag) if time >= lasts else -NOTHING
            out += x - end + c0 * time + 0.5 * c1 * time * time
            x = end
        c0 += c1 * time
        lasts -= time
    return out, x + c0 * lasts + 0.5 * c1 * lasts * lasts


@njit(cache=True)
def _excess(x: float, c0: float, c1: float, time: float, lag: float) -> float:
    """mm in excess after `time` s, from `x` mm, while there is flow."""
    gone = -math.expm1(-time / lag)
    return x * (1.0 - gone) + lag * ((c0 - lag * c1) * gone + c1 * time)


@njit(cache=True)
def _until_dry(x: float, c0: float, c1: float, lasts: float, lag: float) -> float:
    """s until the excess, now above 0, is spent; `lasts` where it is not."""
    # x(t) has one turning point at most; where it is a low one inside the phase, the crossing lies before it.
    low, high = 0.0, lasts
    if c1 != 0.0:
        part = (x - lag * (c0 - lag * c1)) / (lag * lag * c1)
        turn = lag * math.log(part) if part > 0.0 else -1.0
        if 0.0 < turn < lasts:
            if c1 > 0.0:
                high = turn
            else:
                low = turn
    if _excess(x, c0, c1, high, lag) >= 0.0:
        return lasts
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        if _excess(x, c0, c1, middle, lag) > 0.0:
            low = middle
        else:
            high = middle
    return high


@njit(cache=True)
def _until_full(x: float, c0: float, c1: float, lasts: float) -> float:
    """s until the gap -x >= 0 is filled by pushing c0 + c1 t; `lasts` where it is not."""
    # x + c0 t + c1 t² / 2 = 0, rising
    if c1 == 0.0:
        return min(-x / c0, lasts) if c0 > 0.0 else lasts
    square = c0 * c0 - 2.0 * c1 * x
    if square < 0.0:
        return lasts
    root = math.sqrt(square)
    # The crossing at which the sum rises has slope +root; written so that nothing cancels.
    time = (root - c0) / c1 if c0 <= 0.0 else -2.0 * x / (c0 + root)
    return time if 0.0 <= time < lasts else lasts
