"""Marlin's planner arithmetic, compiled: one block in, speeds of all queued blocks out.

Follows `planner.cpp` of Marlin 2.1.2.5 (`_populate_block`, `reverse_pass`, `forward_pass`): motion in whole steps, feed
by the rule of NIST RS274NGC 2.1.2.5 (XYZ length if that moves, else degrees), box limits of speed and acceleration per
axis, corners by classic jerk or junction deviation; kinematic builds, as those with tip control are, heed both.
Speeds are in mm/s of the block's own metric. All state is in three float arrays, so a call costs a microsecond. How the
steps of a block then fall is `stepper_kernel`'s.
"""

import math

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray
from trunnion_sim.firmware import stepper_kernel

MIN_SPEED = 0.05
"""mm/s: MINIMUM_PLANNER_SPEED."""
MIN_STEPS = 6.0
"""MIN_STEPS_PER_SEGMENT: shorter blocks are left to the next one."""
# Columns of a block.
MILLIMETERS, NOMINAL_SPEED, ACCELERATION, ENTRY, MAX_ENTRY, NOMINAL_RATE, EVENTS, STEP_ACCELERATION, LINE, STEPS = (
    range(10)
)
# Rows of the limits; the extruder is the last column.
STEPS_PER_UNIT, MAX_SPEED, MAX_ACCELERATION, JERK, ROTARY = range(5)
# Places in the state, followed by previous speed, previous unit vector, and the planned position in steps, per axis.
(
    TAIL,
    HEAD,
    BUSY,
    PREVIOUS_NOMINAL,
    PREVIOUS_SAFE,
    JUNCTION_DEVIATION,
    PRINT_ACCELERATION,
    TRAVEL_ACCELERATION,
    RETRACT_ACCELERATION,
    MIN_SEGMENT_TIME,
    JERK_TOO,
    VECTORS,
) = range(12)


@njit(cache=True)
def add_block(
    blocks: FloatArray,
    limits: FloatArray,
    state: FloatArray,
    target: FloatArray,
    flow: float,
    feed: float,
    line: float,
    length: float,
    way: FloatArray,
) -> bool:
    """Queue the motion to `target` (n,) in mm, degrees and mm of filament; False where it is too short to be a block.

    `feed` is in mm/s or degrees/s as the F word counts, `flow` the factor on filament. With a `length` F is read over
    that, and junction deviation looks at `way` (n,), what the words change; without, both follow from the steps.
    """
    n = limits.shape[1]
    e = n - 1
    position = VECTORS + 2 * n
    row = blocks[int(state[HEAD])]
    events = 0.0
    linear2 = 0.0
    rotary2 = 0.0
    moving_axes = 0
    for i in range(n):
        wanted = min(max(target[i] * limits[STEPS_PER_UNIT, i], -2147483648.0), 2147483647.0)
        wanted = math.floor(wanted + 0.5)
        delta = wanted - state[position + i]
        if i == e:
            delta = math.floor(delta * flow + 0.5) if delta > 0 else -math.floor(-delta * flow + 0.5)
        row[STEPS + i] = delta
        events = max(events, abs(delta))
        units = delta / limits[STEPS_PER_UNIT, i]
        if i < e:
            if abs(delta) >= MIN_STEPS:
                moving_axes += 1
            if limits[ROTARY, i] > 0:
                rotary2 += units * units
            else:
                linear2 += units * units
    if events < MIN_STEPS:
        return False
    millimeters = math.sqrt(linear2 if linear2 >= 1e-6 else rotary2)
    if moving_axes == 0:
        millimeters = abs(row[STEPS + e]) / limits[STEPS_PER_UNIT, e]
    elif length > 0:
        millimeters = length
    for i in range(n):
        wanted = min(max(target[i] * limits[STEPS_PER_UNIT, i], -2147483648.0), 2147483647.0)
        state[position + i] = math.floor(wanted + 0.5)

    size = blocks.shape[0]
    queued = (int(state[HEAD]) - int(state[TAIL])) % size
    waiting = queued - int(state[BUSY])
    inverse_secs = max(feed, 1e-3) / millimeters
    if 2 <= waiting <= size // 2 - 1:
        segment = 1.0 / inverse_secs
        if segment < state[MIN_SEGMENT_TIME]:
            inverse_secs = 1.0 / (segment + 2.0 * (state[MIN_SEGMENT_TIME] - segment) / waiting)
    factor = 1.0
    for i in range(n):
        speed = abs(row[STEPS + i]) / limits[STEPS_PER_UNIT, i] * inverse_secs
        if speed > limits[MAX_SPEED, i]:
            factor = min(factor, limits[MAX_SPEED, i] / speed)
    nominal_rate = math.floor(math.ceil(events * inverse_secs) * factor)
    inverse_secs *= factor
    nominal_speed = millimeters * inverse_secs

    steps_per_mm = events / millimeters
    only_filament = True
    for i in range(e):
        if row[STEPS + i] != 0:
            only_filament = False
    if only_filament:
        acceleration = state[RETRACT_ACCELERATION] * steps_per_mm
    else:
        wanted_acceleration = state[PRINT_ACCELERATION] if row[STEPS + e] != 0 else state[TRAVEL_ACCELERATION]
        acceleration = wanted_acceleration * steps_per_mm
        for i in range(n):
            if row[STEPS + i] != 0:
                possible = limits[MAX_ACCELERATION, i] * limits[STEPS_PER_UNIT, i] * events / abs(row[STEPS + i])
                acceleration = min(acceleration, possible)
    acceleration = math.ceil(acceleration)

    row[MILLIMETERS] = millimeters
    row[NOMINAL_SPEED] = nominal_speed
    row[NOMINAL_RATE] = max(nominal_rate, 1.0)
    row[EVENTS] = events
    row[STEP_ACCELERATION] = acceleration
    row[ACCELERATION] = acceleration / steps_per_mm
    row[ENTRY] = MIN_SPEED * MIN_SPEED
    row[LINE] = line
    if state[JUNCTION_DEVIATION] > 0:
        unit = np.empty(n)
        for i in range(n):
            change = way[i] if length > 0 else row[STEPS + i] / limits[STEPS_PER_UNIT, i]
            unit[i] = change / millimeters
        corner2 = _junction_deviation(row, limits, state, waiting, unit)
        if state[JERK_TOO] > 0:
            corner2 = min(corner2, _classic_jerk(row, limits, state, waiting, inverse_secs))
    else:
        corner2 = _classic_jerk(row, limits, state, waiting, inverse_secs)
    row[MAX_ENTRY] = corner2
    state[PREVIOUS_NOMINAL] = nominal_speed
    for i in range(n):
        state[VECTORS + i] = row[STEPS + i] / limits[STEPS_PER_UNIT, i] * inverse_secs
    state[HEAD] = (int(state[HEAD]) + 1) % size
    _look_ahead(blocks, state)
    return True


@njit(cache=True)
def _classic_jerk(row: FloatArray, limits: FloatArray, state: FloatArray, moves: int, inverse_secs: float) -> float:
    """Square of the speed allowed where this block meets the one before; what may jump is given per axis."""
    n = limits.shape[1]
    nominal = row[NOMINAL_SPEED]
    safe = nominal
    for i in range(n):
        speed = abs(row[STEPS + i]) / limits[STEPS_PER_UNIT, i] * inverse_secs
        if speed > limits[JERK, i]:
            safe = min(safe, nominal * limits[JERK, i] / speed)
    previous = state[PREVIOUS_NOMINAL]
    if moves > 0 and previous > 1e-6:
        smaller = 1.0
        corner = previous
        if nominal < previous:
            corner = nominal
            smaller = corner / previous
        factor = 1.0
        limited = False
        for i in range(n):
            leaving = state[VECTORS + i] * smaller
            entering = row[STEPS + i] / limits[STEPS_PER_UNIT, i] * inverse_secs
            if limited:
                leaving *= factor
                entering *= factor
            if leaving > entering:
                jump = leaving - entering if entering > 0 or leaving < 0 else max(leaving, -entering)
            else:
                jump = entering - leaving if entering < 0 or leaving > 0 else max(-leaving, entering)
            if jump > limits[JERK, i]:
                factor *= limits[JERK, i] / jump
                limited = True
        if limited:
            corner *= factor
        threshold = corner * 0.99
        if state[PREVIOUS_SAFE] > threshold and safe > threshold:
            corner = safe
    else:
        corner = safe
    state[PREVIOUS_SAFE] = safe
    return float(corner * corner)


@njit(cache=True)
def _junction_deviation(row: FloatArray, limits: FloatArray, state: FloatArray, moves: int, unit: FloatArray) -> float:
    """Square of the corner speed by centripetal acceleration; all axes in one vector, mm and degrees alike.

    `unit` (n,) is the change of every axis per mm of the block. Only that of a block that feeds is made a unit vector;
    turning travels count as longer than one, which makes their corners look straight (`_populate_block`).
    """
    n = limits.shape[1]
    if row[STEPS + n - 1] != 0:
        size = 0.0
        for i in range(n):
            size += unit[i] * unit[i]
        for i in range(n):
            unit[i] /= math.sqrt(size)
    corner2 = 0.0
    if moves > 0 and state[PREVIOUS_NOMINAL] > 1e-6:
        cosine = 0.0
        turn2 = 0.0
        for i in range(n):
            cosine -= state[VECTORS + n + i] * unit[i]
            turn2 += (unit[i] - state[VECTORS + n + i]) ** 2
        if cosine > 0.999999:
            corner2 = MIN_SPEED * MIN_SPEED
        else:
            cosine = max(cosine, -0.999999)
            acceleration = row[ACCELERATION]
            for i in range(n):
                part = abs(unit[i] - state[VECTORS + n + i])
                if part > 0 and acceleration * part > limits[MAX_ACCELERATION, i] * math.sqrt(turn2):
                    acceleration = limits[MAX_ACCELERATION, i] * math.sqrt(turn2) / part
            half = math.sqrt(0.5 * (1.0 - cosine))
            corner2 = acceleration * state[JUNCTION_DEVIATION] * half / (1.0 - half)
            if row[MILLIMETERS] < 1.0 and cosine < -0.7071067812:
                corner2 = min(corner2, row[MILLIMETERS] * acceleration / _small_angle(-cosine))
        corner2 = min(corner2, row[NOMINAL_SPEED] ** 2, state[PREVIOUS_NOMINAL] ** 2)
    for i in range(n):
        state[VECTORS + n + i] = unit[i]
    return float(corner2)


@njit(cache=True)
def _small_angle(t: float) -> float:
    """Angle in rad whose cosine is `t` > 0, by the polynomial that Marlin uses: never below 0.033."""
    sine = 0.032843707 + t * (
        -1.451838349 + t * (29.66153956 + t * (-131.1123477 + t * (262.8130562 + t * (-242.7199627 + t * 84.31466202))))
    )
    return math.pi / 2 - sine


@njit(cache=True)
def _look_ahead(blocks: FloatArray, state: FloatArray) -> None:
    """Entry speeds of every waiting block; that of the first is bound to what runs now."""
    size = blocks.shape[0]
    first = (int(state[TAIL]) + int(state[BUSY])) % size
    newest = (int(state[HEAD]) - 1) % size
    leaving2 = MIN_SPEED * MIN_SPEED
    b = newest
    while b != first:
        row = blocks[b]
        leaving2 = min(row[MAX_ENTRY], leaving2 + 2.0 * row[ACCELERATION] * row[MILLIMETERS])
        row[ENTRY] = leaving2
        b = (b - 1) % size
    while b != newest:
        row = blocks[b]
        b = (b + 1) % size
        reached2 = row[ENTRY] + 2.0 * row[ACCELERATION] * row[MILLIMETERS]
        if reached2 < blocks[b, ENTRY]:
            blocks[b, ENTRY] = reached2


@njit(cache=True)
def begin_block(blocks: FloatArray, state: FloatArray, trapezoid: FloatArray) -> float:
    """Fix the trapezoid of the oldest block in `trapezoid`, mark it as running; returns its duration in s."""
    size = blocks.shape[0]
    tail = int(state[TAIL])
    row = blocks[tail]
    following = (tail + 1) % size
    leaving2 = blocks[following, ENTRY] if following != int(state[HEAD]) else MIN_SPEED * MIN_SPEED
    state[BUSY] = 1.0
    stepper_kernel.shape(
        trapezoid,
        row[EVENTS],
        row[NOMINAL_RATE],
        row[STEP_ACCELERATION],
        math.sqrt(row[ENTRY]) / row[NOMINAL_SPEED],
        math.sqrt(leaving2) / row[NOMINAL_SPEED],
    )
    ticks, _ = stepper_kernel.run(trapezoid, stepper_kernel.NEVER)
    return ticks / stepper_kernel.TIMER_RATE


@njit(cache=True)
def end_block(
    blocks: FloatArray, state: FloatArray, motors: FloatArray, record: FloatArray, share: float, time: float
) -> None:
    """Take the oldest block off the queue when `share` of its steps are made; note where that leaves the machine.

    `motors` (3, n): steps counted, true position in mm and degrees, true steps per unit. `record` (n + 2): true
    position, line, time.
    """
    row = blocks[int(state[TAIL])]
    n = motors.shape[1]
    for i in range(n):
        steps = row[STEPS + i] if share == 1.0 else math.trunc(row[STEPS + i] * share)
        motors[0, i] += steps
        motors[1, i] += steps / motors[2, i]
        record[i] = motors[1, i]
    record[n] = row[LINE]
    record[n + 1] = time
    state[TAIL] = (int(state[TAIL]) + 1) % blocks.shape[0]
    state[BUSY] = 0.0
