"""Turn moves into the law that LinuxCNC makes of them: each from rest to rest, the next setting off before it ends.

Moves with rotary or filament words are joined by parabolic blends (LinuxCNC `src/emc/tp/tp.c`, 2.9): each has half its
acceleration, and while it slows down below its blend speed the next one already speeds up, so their velocities add.
Speeds change at servo cycles only, and a move of a few cycles feels that. So every move's own ramp is made cycle by
cycle and the ramps are laid over each other. One move ends and the next begins where as much is owed of the one as is
had of the other, in time at the speeds that they want; between two such places one trapezoid tells what happens.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray

CYCLE = 1e-3
"""s: SERVO_PERIOD of the configurations that LinuxCNC is shipped with."""
KINK = 0.1
"""Share of the acceleration that LinuxCNC lets a kink between moves of X, Y and Z ask for (ARC_BLEND_KINK_RATIO)."""
ON_ARC = math.sqrt(0.75)
"""Share of the acceleration that holds such a move on the arc that rounds its corner."""
NEARLY_HALF = 0.49
"""Share of a move that such an arc may take at either end."""
TURNS_BACK = -0.999
"""Cosine at which it stops instead."""
NEARLY_STRAIGHT = math.sin(1e-3)
"""Cosine of half the angle between moves under which no tolerance bounds the blend."""
HALVINGS = 30
"""Of the speeds' distance from the mean, where a trapezoid would be too steep."""
SAME = 1e-9
"""mm/s within which a ramp has reached the speed from which it can only slow down."""


@dataclass(frozen=True, eq=False)
class Path:
    """Moves along their leading length: mm of X, Y, Z, else of filament, else degrees."""

    length: FloatArray
    """(m,)."""
    wanted: FloatArray
    """(m,) speed, within what the axes can go."""
    push: FloatArray
    """(m,) acceleration that the axes can give."""
    direction: FloatArray
    """(m, 3) unit, of X, Y and Z; +X where they stand."""
    plain: BoolArray
    """(m,) whether X, Y and Z move and nothing else."""
    stops: BoolArray
    """(m,) whether the machine stands before the move."""


def overlapping(
    path: Path, plane: FloatArray, tolerance: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Entry, peak and leaving speed and ramp (m,) of every move. Linear in the cycles.

    plane (3,) mm/s² of X, Y and Z; tolerance mm that a corner may be rounded by (G64 P).
    """
    m = len(path.length)
    wanted = np.minimum(path.wanted, path.length / CYCLE)
    meets = np.append(~path.stops[1:], False)
    following = np.minimum(np.arange(m) + 1, m - 1)
    cosine = np.clip(np.einsum("ij,ij->i", path.direction, path.direction[following]), -1.0, 1.0)
    joined = meets & path.plain & path.plain[following]
    meets &= ~(joined & (cosine < TURNS_BACK))
    joined &= meets
    corner, calm, cut, arc = _joints_of_plain_moves(path, wanted, following, cosine, joined, plane, tolerance)
    push = path.push * np.where(joined, calm, 0.5 * calm)
    leg = path.length - cut - np.append(0.0, cut[:-1])
    corner = _reachable(leg, push, wanted, corner, joined)
    blend = np.where(meets & ~joined, _blend_speeds(leg, wanted, push, following, cosine, tolerance), 0.0)
    seconds, entry, leave = _laid_over(leg, wanted, push, corner, joined, blend, meets, arc, CYCLE)
    return _trapezoids(path.length, seconds, entry, leave, push, path.push)


def _joints_of_plain_moves(
    path: Path,
    wanted: FloatArray,
    following: IntArray,
    cosine: FloatArray,
    joined: BoolArray,
    plane: FloatArray,
    tolerance: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Of moves that are joined: speed at the end, share of the acceleration, mm cut off there, s on the arc instead."""
    fastest = np.minimum(wanted, wanted[following])
    jump = np.abs(path.direction[following] - path.direction) / plane
    kink = (fastest / CYCLE + path.push[following]) * jump.max(axis=1)
    half = np.sqrt(0.5 * (1.0 + cosine))
    weaker = np.minimum(path.push, path.push[following])
    with np.errstate(divide="ignore", invalid="ignore"):
        lean = np.sqrt(1.0 - half**2) / half
        room = NEARLY_HALF * np.minimum(path.length, path.length[following]) / lean
        radius = np.minimum(tolerance * half / (1.0 - half), room)
        around = np.minimum(fastest, np.sqrt(ON_ARC * weaker * radius))
        slowed = fastest * KINK / kink
        rounded = joined & (kink >= KINK) & (around >= slowed)
        cut = np.where(rounded, radius * lean, 0.0)
        arc = np.where(rounded, radius * np.arccos(cosine) / around, 0.0)
        corner = np.where(joined, np.where(kink < KINK, fastest, np.where(rounded, around, slowed)), 0.0)
    spent = np.where(joined & (kink < KINK), kink, 0.0)
    return corner, 1.0 - np.maximum(spent, np.append(0.0, spent[:-1])), cut, arc


def _reachable(
    length: FloatArray, push: FloatArray, wanted: FloatArray, corner: FloatArray, joined: BoolArray
) -> FloatArray:
    """(m,) corner speeds from which the moves that follow can slow down in time."""
    reachable = corner.copy()
    for i in np.flatnonzero(joined)[::-1].tolist():
        ahead = math.sqrt(reachable[i + 1] ** 2 + 2.0 * push[i + 1] * length[i + 1])
        reachable[i] = min(corner[i], ahead, wanted[i], wanted[i + 1])
    return reachable


def _blend_speeds(
    length: FloatArray, wanted: FloatArray, push: FloatArray, following: IntArray, cosine: FloatArray, tolerance: float
) -> FloatArray:
    """(m,) speed of a slowing move below which the next one sets off: no blend longer than half of either move."""
    peak = np.minimum(np.sqrt(push * length), wanted)
    room = np.minimum(length / peak, (length / peak)[following])
    longest = np.maximum(peak / push, (peak / push)[following])
    blend = np.minimum(peak, np.minimum(room, longest) * push)
    lean = np.sqrt(0.5 * (1.0 - cosine))
    inside = 2.0 * np.sqrt(push * tolerance / np.maximum(lean, NEARLY_STRAIGHT))
    return np.asarray(np.where(lean > NEARLY_STRAIGHT, np.minimum(blend, inside), blend))


@numba.njit(cache=True, error_model="numpy")
def _laid_over(
    length: FloatArray,
    wanted: FloatArray,
    push: FloatArray,
    corner: FloatArray,
    joined: BoolArray,
    blend: FloatArray,
    meets: BoolArray,
    arc: FloatArray,
    cycle: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m,) s between the corners of every move, and the speeds there along it."""
    m = len(length)
    seconds, entry, leave = np.zeros(m), np.zeros(m), np.zeros(m)
    start, passed = 0.0, 0.0
    free = 0.0  # when the planner has done with the move before
    first = 0.0  # speed with which a move begins
    old_done, old_speed, old_start = np.zeros(1), np.zeros(1), 0.0
    for i in range(m):
        done, speed, slows, last = _ramp(length[i], first, corner[i], wanted[i], push[i], cycle)
        count = len(done) - 1
        at = start - (0.5 * arc[i - 1] if i > 0 else 0.0)
        if i > 0:
            if meets[i - 1] and not joined[i - 1]:
                # In seconds at the speeds that both want.
                owed, had = (length[i - 1] - old_done) / wanted[i - 1], done / wanted[i]
                at, mine, hers = _corner(owed, old_speed, old_start, had, speed, start, cycle)
                pace = min(1.0, mine / wanted[i - 1] + hers / wanted[i])
                leave[i - 1], entry[i] = pace * wanted[i - 1], pace * wanted[i]
            else:
                leave[i - 1] = entry[i] = first
            seconds[i - 1] = at - passed
            passed = at
        gone = max(start + count * cycle, free)
        after = gone
        if joined[i]:
            after = start + (count - 1) * cycle + last + arc[i]
        elif blend[i] > 0.0:
            for c in range(1, count + 1):
                if start + (c - 1) * cycle > free - 0.5 * cycle and slows[c] and speed[c] < blend[i]:
                    after = start + (c - 1) * cycle
                    break
        elif not meets[i]:
            after = gone + cycle
        first = corner[i] if joined[i] else 0.0
        free = gone + cycle
        if joined[i]:
            free = after
        old_done, old_speed, old_start = done, speed, start
        start = after
    if m:
        seconds[m - 1] = free - cycle - passed
    return seconds, entry, leave


@numba.njit(cache=True, error_model="numpy")
def _ramp(
    length: float, first: float, final: float, wanted: float, push: float, cycle: float
) -> tuple[FloatArray, FloatArray, BoolArray, float]:
    """A move by itself: way and speed after every cycle, whether it slows down for good, and s in the last cycle."""
    most = int((length / wanted + 2.0 * wanted / push) / cycle) + 50
    done, speed = np.zeros(most), np.zeros(most)
    slows = np.zeros(most, np.bool_)
    speed[0] = first
    half = 0.5 * push * cycle
    c = 0
    while c < most - 1:
        left, v = length - done[c], speed[c]
        c += 1
        square = half * half + final * final + push * (2.0 * left - v * cycle)
        stopping = math.sqrt(square) - half if square > half * half else -half
        now = min(max(min(stopping, wanted), v - push * cycle), v + push * cycle)
        slows[c] = now < v and abs(stopping - now) < 10 * SAME
        if now < 0.0:
            now = 0.0
            done[c] = length if left < v * cycle else done[c - 1]
        else:
            done[c] = min(length, done[c - 1] + 0.5 * (v + now) * cycle)
        speed[c] = now
        left = length - done[c]
        if left <= 1e-12:
            return done[: c + 1], speed[: c + 1], slows[: c + 1], cycle
        if now + final > 0.0:
            rest = 2.0 * left / (now + final)
            if abs(final - now) > push * rest:
                # Too little time to reach the final speed: slow down or speed up as hard as may be.
                sign = 1.0 if final > now else -1.0
                square = now * now + 2.0 * sign * push * left
                rest = sign * (math.sqrt(square) - now) / push if square >= 0.0 else cycle
            if rest < cycle:
                if final == 0.0:
                    return done[: c + 1], speed[: c + 1], slows[: c + 1], cycle
                c += 1
                done[c], speed[c] = length, final
                return done[: c + 1], speed[: c + 1], slows[: c + 1], rest
    return done[: c + 1], speed[: c + 1], slows[: c + 1], cycle


@numba.njit(cache=True, error_model="numpy")
def _corner(
    missing: FloatArray,
    old_speed: FloatArray,
    old_start: float,
    gone: FloatArray,
    speed: FloatArray,
    start: float,
    cycle: float,
) -> tuple[float, float, float]:
    """When as much time is `missing` of a move as is `gone` of the next, and the speeds of both then."""
    # After its last whole cycle a move is put at its end.
    missing, old_speed = np.append(missing, 0.0), np.append(old_speed, 0.0)
    shift = round((start - old_start) / cycle)
    before = missing[min(shift, len(missing) - 1)]
    for c in range(1, len(gone)):
        o = min(c + shift, len(missing) - 1)
        gap = missing[o] - gone[c]
        if gap <= 0.0:
            part = before / (before - gap)
            p = min(c - 1 + shift, len(missing) - 1)
            old = old_speed[p] + part * (old_speed[o] - old_speed[p])
            return start + (c - 1 + part) * cycle, old, speed[c - 1] + part * (speed[c] - speed[c - 1])
        before = gap
    return start + (len(gone) - 1) * cycle, old_speed[-1], speed[-1]


def _trapezoids(
    length: FloatArray, seconds: FloatArray, entry: FloatArray, leave: FloatArray, push: FloatArray, most: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Trapezoids of those lengths and times, between those speeds as far as the mean speed and `most` let them."""
    t = np.maximum(seconds, 1e-9)
    mean = length / t
    shape = _between(entry, leave, mean, t, length, push)
    stiff, soft = np.zeros(len(t)), np.where(shape[3] > most, 1.0, 0.0)
    for _ in range(HALVINGS if soft.any() else 0):
        part = 0.5 * (stiff + soft)
        steep = _between(entry + part * (mean - entry), leave + part * (mean - leave), mean, t, length, push)[3] > most
        stiff, soft = np.where(steep, part, stiff), np.where(steep, soft, part)
    return _between(entry + soft * (mean - entry), leave + soft * (mean - leave), mean, t, length, push)


def _between(
    entry: FloatArray, leave: FloatArray, mean: FloatArray, t: FloatArray, length: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Entry, peak and leaving speed and ramp (m,), whatever the ramp has to be."""
    low, high = np.minimum(entry, leave), np.maximum(entry, leave)
    # Both speeds below the mean: up, along and down, as steep as the move's own ramp if that is steep enough.
    total, squares = entry + leave, entry**2 + leave**2
    room = (total + push * t) ** 2 - 4.0 * push * length - 2.0 * squares
    hump = 4.0 * length - 2.0 * total * t
    steep = (hump + np.sqrt(hump**2 + 4.0 * (t * (entry - leave)) ** 2)) / (2.0 * t**2)
    ramp = np.where(room >= 0.0, push, steep)
    peak = 0.5 * (total + ramp * t - np.sqrt(np.maximum(room, 0.0)))
    # One of them above: one ramp, and along at the faster one.
    faster = np.minimum(high, 2.0 * mean - low)
    with np.errstate(divide="ignore", invalid="ignore"):
        single = (faster - low) ** 2 / (2.0 * (faster * t - length))
    between = (high > mean) & (low < mean)
    level = low >= mean
    peak = np.where(level, mean, np.where(between, faster, peak))
    ramp = np.where(level, push, np.where(between, np.where(single >= 0.0, single, np.inf), ramp))
    return np.minimum(entry, peak), peak, np.minimum(leave, peak), ramp
