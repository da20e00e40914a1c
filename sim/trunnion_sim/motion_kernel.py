"""The modal state of a G-code interpreter as one compiled loop over words.

Meanings follow RS-274 as Marlin (`gcode/motion`, `gcode/geometry`, `gcode/units`) and RepRapFirmware
(`GCodes/GCodes2.cpp`) execute it. Linear joints are in mm and rotary ones in degrees throughout; inches (G20) apply to
linear joints, filament and feed.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_sim import reader_kernel as reading

RAPID, LINEAR, ARC, HOME = 0, 1, 2, 3
"""Kinds of row."""
INVERSE, RELATIVE = 1, 2
"""Bits of the row flags."""
NOT_A_COMMAND = reading.NAMED | reading.OVERLONG | reading.NO_COMMAND
SPOILED = reading.HUGE | reading.MALFORMED | reading.BINARY | reading.JUNK
PROBLEMS = {
    1: "a number that is none or too large",
    2: "an arc without a centre, or whose ends are not on one circle",
    3: "an arc outside the XY plane or without linear X and Y joints",
}
ARC_SEGMENT = 1.0
"""mm; chord of arcs, the default of Marlin's MM_PER_ARC_SEGMENT."""
ARC_TOLERANCE = 0.1
"""mm between the radii of the two ends of an arc: writers round I and J."""

_REL, _EREL, _INCH, _INV, _E, _FEED, _SPEED, _FLOW, _HOMED, _DWELL, _AREA, _VOLUME, _FIRST = range(13)


def fresh_state(k: int, filament_area: float) -> NDArray[np.float64]:
    """State before the first line: absolute, mm, standing at zero; positions and offsets follow the scalars.

    `filament_area` mm² is what volumetric extrusion (M200 S1) takes the filament for until M200 D says otherwise.
    """
    state = np.zeros(_FIRST + 2 * k)
    state[_SPEED] = 1.0
    state[_FLOW] = 1.0
    state[_AREA] = filament_area
    return state


class Rows(NamedTuple):
    """Rows as the loop makes them; joints in mm and degrees."""

    line: NDArray[np.int64]
    kind: NDArray[np.uint8]
    joints: NDArray[np.float64]
    filament: NDArray[np.float64]
    feed: NDArray[np.float64]
    flags: NDArray[np.uint8]
    homed: NDArray[np.uint8]
    dwell: NDArray[np.float64]
    bytes: NDArray[np.int32]


def fresh_rows(n: int, k: int) -> Rows:
    """Room for n rows."""
    return Rows(
        np.zeros(n, np.int64),
        np.zeros(n, np.uint8),
        np.zeros((n, k)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n, np.uint8),
        np.zeros(n, np.uint8),
        np.zeros(n),
        np.zeros(n, np.int32),
    )


@njit(cache=True)
def execute(
    at: int,
    letter: NDArray[np.uint8],
    code: NDArray[np.int64],
    flags: NDArray[np.int64],
    word_start: NDArray[np.int64],
    word_letter: NDArray[np.uint8],
    word_value: NDArray[np.float64],
    source: NDArray[np.int64],
    length: NDArray[np.int64],
    letters: NDArray[np.int64],
    rotary: NDArray[np.bool_],
    home: NDArray[np.float64],
    g90_resets_e: bool,
    case_sensitive: bool,
    whole_percent: bool,
    feeder: int,
    state: NDArray[np.float64],
    out: Rows,
    row_of_command: NDArray[np.int64],
    problem: NDArray[np.int64],
    rows_before: int,
) -> tuple[int, int]:
    """Execute commands from `at` until the rows are full; returns the next command and the rows made."""
    k = len(letters)
    line, kind, joints, filament, feed, row_flags, homed, dwell, size = out
    room = len(line)
    q = state[_FIRST : _FIRST + k]
    offset = state[_FIRST + k : _FIRST + 2 * k]
    slot = np.full(91, -1, np.int64)
    for j in range(k):
        slot[letters[j]] = j
    value = np.full(91, np.nan)
    named = np.zeros(91, np.bool_)
    target = np.empty(k)
    made = 0
    for i in range(at, len(letter)):
        row_of_command[i] = rows_before + made
        if flags[i] & NOT_A_COMMAND or (case_sensitive and flags[i] & reading.LOWER):
            continue
        value[:] = np.nan
        named[:] = False
        for w in range(word_start[i], word_start[i + 1]):
            value[word_letter[w]] = word_value[w]
            named[word_letter[w]] = True
        c = code[i]
        if letter[i] == 77:  # M
            if c == 820:
                state[_EREL] = 0
            elif c == 830:
                state[_EREL] = 1
            elif c == 2200 and value[83] > 0:
                state[_SPEED] = max(math.floor(value[83]), 1.0) / 100 if whole_percent else value[83] / 100
            elif c == 2210 and value[83] > 0:
                state[_FLOW] = math.floor(value[83]) / 100 if whole_percent else value[83] / 100
            elif c == 2000:  # volumetric: E is mm³ of filament of that diameter
                if value[68] >= 0:
                    state[_AREA] = math.pi / 4 * value[68] ** 2
                    state[_VOLUME] = value[68] > 0
                if value[83] >= 0:
                    state[_VOLUME] = value[83] > 0
            elif (c in (0, 10, 1090, 1160, 1900, 1910, 4000, 6000)) and state[_DWELL] == 0:
                state[_DWELL] = np.nan
            continue
        if letter[i] != 71:
            continue
        if c == 900:
            state[_REL] = 0
            if g90_resets_e:
                state[_EREL] = 0
        elif c == 910:
            state[_REL] = 1
            if g90_resets_e:
                state[_EREL] = 1
        elif c == 200:
            state[_INCH] = 1
        elif c == 210:
            state[_INCH] = 0
        elif c == 930:
            state[_INV] = 1
        elif c == 940:
            state[_INV] = 0
        elif c == 40:
            wait = value[83] if not math.isnan(value[83]) else value[80] / 1000
            if wait > 0:
                state[_DWELL] = wait + (0 if math.isnan(state[_DWELL]) else state[_DWELL])
            elif state[_DWELL] == 0:
                state[_DWELL] = np.nan
        elif c == 920:
            unit = 25.4 if state[_INCH] else 1.0
            for j in range(k):
                v = value[letters[j]]
                if not math.isnan(v):
                    offset[j] = (v if rotary[j] else v * unit) - q[j]
            if not math.isnan(value[feeder]):
                state[_E] = value[feeder] * unit
        elif c == 280:
            if made + 1 > room:
                return i, made
            every = True
            for j in range(k):
                if named[letters[j]]:
                    every = False
            bits = int(state[_HOMED])
            for j in range(k):
                if every or named[letters[j]]:
                    q[j] = home[j]
                    offset[j] = 0
                    bits |= 1 << j
            state[_HOMED] = bits
            line[made] = source[i]
            kind[made] = HOME
            joints[made] = q
            homed[made] = bits
            size[made] = length[i]
            dwell[made] = np.nan if state[_DWELL] == 0 else state[_DWELL]
            state[_DWELL] = np.nan
            made += 1
        elif c == 0 or c == 10 or c == 20 or c == 30:
            if flags[i] & SPOILED:
                problem[i] = 1
                continue
            unit = 25.4 if state[_INCH] else 1.0
            if not math.isnan(value[70]) and value[70] > 0:
                state[_FEED] = value[70] if state[_INV] else value[70] * unit
            moved = False
            for j in range(k):
                v = value[letters[j]]
                target[j] = q[j]
                if not math.isnan(v):
                    if not rotary[j]:
                        v *= unit
                    target[j] = q[j] + v if state[_REL] else v - offset[j]
                    moved = moved or target[j] != q[j]
            words = e = 0.0
            if not math.isnan(value[feeder]):
                v = value[feeder] * unit
                words = v if state[_EREL] else v - state[_E]
                state[_E] += words
                e = words * state[_FLOW]
                if state[_VOLUME] > 0 and state[_AREA] > 0:
                    e /= state[_AREA]
            pieces = 1
            cx = cy = a0 = sweep = 0.0
            if c >= 20:
                x, y = slot[88], slot[89]
                if x < 0 or y < 0 or rotary[x] or rotary[y]:
                    problem[i] = 3
                    continue
                good, cx, cy, a0, sweep = _arc(
                    q[x], q[y], target[x], target[y], value[73] * unit, value[74] * unit, value[82] * unit, c == 20
                )
                if not good:
                    problem[i] = 2
                    continue
                radius = math.hypot(q[x] - cx, q[y] - cy)
                pieces = max(1, min(10000, math.ceil(abs(sweep) * radius / ARC_SEGMENT)))
            elif not moved and e == 0:
                continue
            if made + pieces > room:
                state[_E] -= words  # the command comes again with more room
                return i, made
            begin = q.copy()
            for p in range(1, pieces + 1):
                f = p / pieces
                for j in range(k):
                    q[j] = begin[j] + f * (target[j] - begin[j])
                if c >= 20 and p < pieces:
                    q[slot[88]] = cx + radius * math.cos(a0 + f * sweep)
                    q[slot[89]] = cy + radius * math.sin(a0 + f * sweep)
                line[made] = source[i]
                kind[made] = ARC if c >= 20 else (RAPID if c == 0 else LINEAR)
                joints[made] = q
                filament[made] = e / pieces
                feed[made] = state[_FEED] / 60 * state[_SPEED] * (pieces if state[_INV] else 1)
                row_flags[made] = (INVERSE if state[_INV] else 0) | (RELATIVE if state[_REL] else 0)
                homed[made] = int(state[_HOMED])
                dwell[made] = state[_DWELL]
                state[_DWELL] = 0
                size[made] = length[i] if p == 1 else 0
                made += 1
            q[:] = target
    return len(letter), made


@njit(cache=True)
def _arc(
    x0: float, y0: float, x1: float, y1: float, i: float, j: float, r: float, clockwise: bool
) -> tuple[bool, float, float, float, float]:
    """Centre, first angle and signed sweep of an arc given by I and J, or by R."""
    if not math.isnan(r) and r != 0:
        dx, dy = x1 - x0, y1 - y0
        chord = math.hypot(dx, dy)
        if chord == 0 or chord > 2 * abs(r) + ARC_TOLERANCE:
            return False, 0.0, 0.0, 0.0, 0.0
        height = math.sqrt(max(0.0, r * r - chord * chord / 4))
        side = -1.0 if clockwise != (r < 0) else 1.0
        cx = (x0 + x1) / 2 - side * height * dy / chord
        cy = (y0 + y1) / 2 + side * height * dx / chord
    else:
        if math.isnan(i) and math.isnan(j):
            return False, 0.0, 0.0, 0.0, 0.0
        cx = x0 + (0.0 if math.isnan(i) else i)
        cy = y0 + (0.0 if math.isnan(j) else j)
    start = math.hypot(x0 - cx, y0 - cy)
    if start == 0 or abs(start - math.hypot(x1 - cx, y1 - cy)) > ARC_TOLERANCE:
        return False, 0.0, 0.0, 0.0, 0.0
    a0 = math.atan2(y0 - cy, x0 - cx)
    sweep = math.atan2(y1 - cy, x1 - cx) - a0
    if clockwise and sweep >= -1e-9:
        sweep -= 2 * math.pi
    elif not clockwise and sweep <= 1e-9:
        sweep += 2 * math.pi
    return True, cx, cy, a0, sweep
