"""The planners of Klipper and grblHAL as compiled loops; `replay_kernel` has Marlin, `duet_kernel`
RepRapFirmware and `blend_kernel` LinuxCNC.

Klipper (`klippy/toolhead.py`, `Move` and `LookAheadQueue`): everything in squared speeds; a corner is a circle through
X, Y and Z that may not leave it by the junction deviation, extra axes (`extras/manual_stepper.py`, the extruder) bound
the jump of their own ratio; a second, gentler look-ahead keeps part of every move for cruising.
grblHAL (`planner.c`, `plan_buffer_line`): length, acceleration and corner over all axes, mm and degrees mixed.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_sim.replay_kernel import LARGEST, STILL, _trapezoids

_F = NDArray[np.float64]
NOT_KINEMATIC = 1e-9
"""mm: Klipper takes moves with less of X, Y and Z for extrude-only ones."""
FREE = 99999999.9
"""mm/s² of an extrude-only move before its axes limit it."""
CRUISE_RATIO = 0.5
"""minimum_cruise_ratio."""
CREEP = 1.0 / 60.0
"""MINIMUM_FEED_RATE of grblHAL: 1 unit a minute."""
STRAIGHT = 0.999999
"""Cosine at which grblHAL takes two moves for one line."""
Law = tuple[_F, _F, _F, _F, _F, _F, _F]
"""Length, asked speed, entry, cruise, exit, acceleration, duration of every row."""


@njit(cache=True)
def klipper(
    delta: _F,
    linear: NDArray[np.bool_],
    z: int,
    feed: _F,
    stops: NDArray[np.bool_],
    speed_limit: _F,
    acceleration_limit: _F,
    corner_limit: _F,
    max_velocity: float,
    max_accel: float,
    square_corner_velocity: float,
) -> Law:
    """Every row as Klipper moves it; `z` is the column with its own limits, or -1."""
    n, columns = delta.shape
    deviation = square_corner_velocity**2 * (math.sqrt(2.0) - 1.0) / max_accel
    move_d, asked, accel = np.zeros(n), np.zeros(n), np.ones(n)
    ratio = np.zeros((n, columns))
    kinematic = np.zeros(n, np.bool_)
    cruise_v2, delta_v2, smooth_delta_v2 = np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        d = 0.0
        for j in range(columns):
            if linear[j]:
                d += delta[i, j] ** 2
        d = math.sqrt(d)
        kinematic[i] = d >= NOT_KINEMATIC
        v, a = feed[i], max_accel
        if kinematic[i]:
            v = min(v, max_velocity)
        else:
            d, a = 0.0, FREE
            for j in range(columns):
                if not linear[j] and abs(delta[i, j]) > STILL:
                    d = max(d, abs(delta[i, j]))
        if d <= 0:
            continue
        level = False
        for j in range(columns):
            level = level or (linear[j] and j != z and abs(delta[i, j]) > STILL)
        smooth = max_accel * (1.0 - CRUISE_RATIO)
        for j in range(columns):
            r = delta[i, j] / d
            ratio[i, j] = r
            # X and Y share the limits of the toolhead; the extruder has its own where they stand or it draws back
            # (`kinematics/extruder.py`, check_move).
            bound = j == z or (not linear[j] and (j < columns - 1 or not level or r < 0))
            if r != 0 and bound:
                v = min(v, speed_limit[j] / abs(r))
                a = min(a, acceleration_limit[j] / abs(r))
        move_d[i], asked[i], accel[i] = d, feed[i], a
        cruise_v2[i] = v * v
        delta_v2[i] = 2 * d * a
        smooth_delta_v2[i] = 2 * d * min(a, smooth)
    moving = np.flatnonzero(move_d > 0)
    m = len(moving)
    start_v2, smoothed_v2 = np.zeros(n), np.zeros(n)
    fresh = np.zeros(n, np.bool_)
    pending = True
    p = 0
    for i in range(n):
        pending = pending or stops[i]
        if move_d[i] > 0:
            fresh[i] = pending
            if not pending:
                b = moving[p - 1]
                start_v2[i] = _klipper_junction(b, i, move_d, accel, ratio, kinematic, linear, corner_limit, deviation)
                start_v2[i] = min(
                    min(start_v2[i], min(cruise_v2[i], cruise_v2[b])), start_v2[b] + delta_v2[b] if kinematic[b] else 0
                )
                smoothed_v2[i] = min(start_v2[i], smoothed_v2[b] + smooth_delta_v2[b])
            pending = False
            p += 1
    entry, cruise, leave, duration = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    last = m
    for first in range(m - 1, -1, -1):
        if fresh[moving[first]]:
            _flush(
                moving[first:last], start_v2, smoothed_v2, cruise_v2, delta_v2, smooth_delta_v2, entry, cruise, leave
            )
            last = first
    for i in range(n):
        if move_d[i] <= 0:
            continue
        a, v, v0, v1 = accel[i], cruise[i], entry[i], leave[i]
        accel_d, decel_d = (v * v - v0 * v0) / (2 * a), (v * v - v1 * v1) / (2 * a)
        duration[i] = (2 * v - v0 - v1) / a + max(0.0, move_d[i] - accel_d - decel_d) / v
    return move_d, asked, entry, cruise, leave, accel, duration


@njit(cache=True)
def _klipper_junction(
    b: int,
    i: int,
    move_d: _F,
    accel: _F,
    ratio: _F,
    kinematic: NDArray[np.bool_],
    linear: NDArray[np.bool_],
    corner_limit: _F,
    deviation: float,
) -> float:
    """Squared speed that the corner itself allows."""
    if not (kinematic[i] and kinematic[b]):
        return 0.0
    v2 = np.inf
    cos_theta = 0.0
    for j in range(ratio.shape[1]):
        if linear[j]:
            cos_theta -= ratio[i, j] * ratio[b, j]
        else:
            diff = abs(ratio[i, j] - ratio[b, j])
            if diff > 0:
                v2 = min(v2, (corner_limit[j] / diff) ** 2)
    sin_d2 = math.sqrt(max(0.5 * (1.0 - cos_theta), 0.0))
    cos_d2 = math.sqrt(max(0.5 * (1.0 + cos_theta), 0.0))
    if sin_d2 < 1.0 and cos_d2 > 0.0:
        r_jd = sin_d2 / (1.0 - sin_d2) * deviation
        quarter_tan = 0.25 * sin_d2 / cos_d2
        for which in (i, b):
            v2 = min(v2, r_jd * accel[which], 2 * move_d[which] * accel[which] * quarter_tan)
    return v2


@njit(cache=True)
def _flush(
    queue: NDArray[np.int64],
    max_start_v2: _F,
    max_smoothed_v2: _F,
    max_cruise_v2: _F,
    delta_v2: _F,
    smooth_delta_v2: _F,
    entry: _F,
    cruise: _F,
    leave: _F,
) -> None:
    """Look-ahead over moves that begin and end at rest, from the last to the first."""
    next_end_v2 = next_smoothed_v2 = peak_v2 = 0.0
    delayed = np.empty((len(queue), 2))
    held = np.empty(len(queue), np.int64)
    count = 0
    for q in range(len(queue) - 1, -1, -1):
        i = queue[q]
        reachable_start_v2 = next_end_v2 + delta_v2[i]
        start_v2 = min(max_start_v2[i], reachable_start_v2)
        reachable_smoothed_v2 = next_smoothed_v2 + smooth_delta_v2[i]
        smoothed_v2 = min(max_smoothed_v2[i], reachable_smoothed_v2)
        if smoothed_v2 < reachable_smoothed_v2:
            if smoothed_v2 + smooth_delta_v2[i] > next_smoothed_v2 or count > 0:
                peak_v2 = min(max_cruise_v2[i], (smoothed_v2 + reachable_smoothed_v2) * 0.5)
                mc_v2 = peak_v2
                while count > 0:
                    count -= 1
                    h = held[count]
                    mc_v2 = min(mc_v2, delayed[count, 0])
                    entry[h] = cruise[h] = math.sqrt(mc_v2)
                    leave[h] = math.sqrt(min(delayed[count, 1], mc_v2))
            v2 = min((start_v2 + reachable_start_v2) * 0.5, min(max_cruise_v2[i], peak_v2))
            entry[i] = math.sqrt(min(start_v2, v2))
            cruise[i] = math.sqrt(v2)
            leave[i] = math.sqrt(min(next_end_v2, v2))
        else:
            delayed[count, 0], delayed[count, 1], held[count] = start_v2, next_end_v2, i
            count += 1
        next_end_v2, next_smoothed_v2 = start_v2, smoothed_v2


@njit(cache=True)
def grbl(
    delta: _F,
    feed: _F,
    inverse: NDArray[np.bool_],
    stops: NDArray[np.bool_],
    speed_limit: _F,
    acceleration_limit: _F,
    deviation: float,
    blocks: int,
) -> Law:
    """Every row as grblHAL moves it."""
    n, columns = delta.shape
    length = np.sqrt((delta * delta).sum(axis=1))
    asked, nominal, acceleration, corner = np.zeros(n), np.zeros(n), np.ones(n), np.zeros(n)
    unit, before = np.zeros(columns), np.zeros(columns)
    last = -1
    for i in range(n):
        if length[i] <= STILL:
            length[i] = 0.0
            continue
        unit = delta[i] / length[i]
        asked[i] = feed[i] * length[i] if inverse[i] else feed[i]
        nominal[i] = max(min(asked[i], _by_axis(speed_limit, unit)), CREEP)
        acceleration[i] = _by_axis(acceleration_limit, unit)
        if last >= 0 and not stops[i]:
            cos_theta = -(before * unit).sum()
            v2 = min(nominal[i], nominal[last]) ** 2
            if cos_theta > STRAIGHT:
                v2 = 0.0
            elif cos_theta >= -STRAIGHT:
                across = unit - before
                across /= math.sqrt((across * across).sum())
                sine = math.sqrt(0.5 * (1.0 - cos_theta))
                v2 = min(v2, _by_axis(acceleration_limit, across) * deviation * sine / (1.0 - sine))
            corner[i] = v2
        before = unit
        last = i
    entry, cruise, leave, duration = _trapezoids(length, nominal, acceleration, corner, np.zeros(n), stops, blocks)
    return length, asked, entry, cruise, leave, acceleration, duration


@njit(cache=True)
def _by_axis(limit: _F, unit: _F) -> float:
    """The limit of a motion along `unit` under those of every axis."""
    value = LARGEST
    for j in range(len(unit)):
        if unit[j] != 0:
            value = min(value, abs(limit[j] / unit[j]))
    return value
