"""The planner of RepRapFirmware 3 as a compiled loop: `Movement/DDA.cpp`, `InitStandardMove` and `MatchSpeeds` (3.6).

Everything is limited axis by axis along the length that F is read over: the linear axes if any moves, else the rotary
ones, else the filament. At a common speed no axis may jump by more than its M566. With jerk policy 0, the default,
moves are only melded with moves of their kind: those that move X or Y, those that print while they do, and those that
move filament otherwise; between two kinds the machine stands. M204 limits moves of X or Y alone.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_sim.replay_kernel import LARGEST, STILL, _trapezoids

_F = NDArray[np.float64]
_B = NDArray[np.bool_]
Law = tuple[_F, _F, _F, _F, _F, _F, _F]
"""Length, asked speed, entry, cruise, exit, acceleration, duration of every row."""
PLANE, PRINTS, FEEDS = 1, 2, 4
"""X or Y moves; filament is pushed while it does; filament moves otherwise."""


@njit(cache=True)
def duet(
    delta: _F,
    linear: _B,
    plane: _B,
    feed: _F,
    inverse: _B,
    stops: _B,
    which: NDArray[np.int64],
    speed_limit: _F,
    acceleration_limit: _F,
    corner_limit: _F,
    path_limit: _F,
    slowest: _F,
    blocks: int,
    drive_limit: _F,
) -> Law:
    """Every row as RepRapFirmware moves it.

    delta (n, k + 1) mm and degrees, the filament last; linear and plane (k + 1,) the linear axes, and X and Y. The
    limits are tables of which row i works under row which[i]: (m, k + 1) each, path (m, 3) mm/s² when printing,
    travelling and retracting, slowest (m, 1) units/s. `drive_limit` (n,) mm/s² of filament.
    """
    n, columns = delta.shape
    length, asked, nominal, acceleration, corner = np.zeros(n), np.zeros(n), np.zeros(n), np.ones(n), np.zeros(n)
    kind = np.zeros(n, np.uint8)
    ratio = np.zeros((n, columns))
    last = -1
    for i in range(n):
        straight, turned, level = 0.0, 0.0, False
        for j in range(columns - 1):
            if abs(delta[i, j]) > STILL:
                level = level or plane[j]
                if linear[j]:
                    straight += delta[i, j] ** 2
                else:
                    turned += delta[i, j] ** 2
        fed = delta[i, columns - 1]
        d = np.sqrt(straight) if straight > 0 else (np.sqrt(turned) if turned > 0 else abs(fed))
        if d <= 0:
            continue
        prints = level and fed > 0
        kind[i] = (PLANE if level else 0) | (PRINTS if prints else (FEEDS if fed != 0 else 0))
        row = which[i]
        length[i] = d
        asked[i] = feed[i] * d if inverse[i] else feed[i]
        v, a = max(asked[i], slowest[row, 0]), LARGEST
        if level:
            a = min(a, path_limit[row, 0] if prints else path_limit[row, 1])
        for j in range(columns):
            r = abs(delta[i, j]) / d
            ratio[i, j] = delta[i, j] / d
            if r > 0:
                v = min(v, speed_limit[row, j] / r)
                a = min(a, acceleration_limit[row, j] / r)
        if fed != 0:
            a = min(a, drive_limit[i] * d / abs(fed))
        nominal[i], acceleration[i] = v, a
        if last >= 0 and not stops[i] and kind[i] == kind[last]:
            v = min(nominal[i], nominal[last])
            for j in range(columns):
                jump = abs(ratio[i, j] - ratio[last, j])
                if jump * v > corner_limit[row, j]:
                    v = corner_limit[row, j] / jump
            corner[i] = v * v
        last = i
    entry, cruise, leave, duration = _trapezoids(length, nominal, acceleration, corner, np.zeros(n), stops, blocks)
    return length, asked, entry, cruise, leave, acceleration, duration
