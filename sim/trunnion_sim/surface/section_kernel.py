"""The section of a bead over a gap: how far its plastic spreads to either side, and how much of it has to rise.

Between the floor and the nozzle's plane the plastic spreads from the path to both sides, half of it to each, behind a
round front of half the gap as radius. `_spread` is the area behind a front; the front stands where that area is the
plastic of its side. Over an open floor the result is a stadium. Where a neighbour stands the front runs over its
shoulder, and the groove above and the pore below fill, until all room is taken: at the pitch of `core.bead` that is the
very moment at which the plastic is used up.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]

REACH = 1.5
"""In thread diameters: gap up to which a thread falls onto what is below."""
LEAST = 0.1
"""In thread diameters: least height of a section, however little gap there is."""
THROAT = 0.1
"""Of the height: where a gap as narrow as this opens again, no plastic gets through."""
SAME_LAYER = 0.95
"""Of the height: a floor above this depth is a neighbour's shoulder; the pore under it can be reached from the side."""
WIDEN = 1.25
"""How far a bead that has no room on one side may grow on the other, relative to its half width."""
ASIDE = 0.5
"""Share of the plastic without room that goes to the free side; the rest rises behind the nozzle. All of it aside would
hand the same lack on from line to line for ever."""
SLIT = 1 / 3
"""Of the bore: a slit in the air beside a neighbour that is no wider than this is closed by a web."""
CLOSE = 1e-4
"""Share of a side's plastic to which its front is found."""


class Section(NamedTuple):
    """One bead's section; pairs are right and left of the path (`across` points left)."""

    front_right: float
    """mm from the path to where the plastic ends."""
    front_left: float
    throat_right: float
    """mm from the path to where a neighbour lets no plastic through."""
    throat_left: float
    round_right: float
    """mm from the path to where the bead ends that is compared with the model, open grooves beside it."""
    round_left: float
    web_right: float
    """mm from the path to a neighbour across a slit; places deeper than the bead is high are closed up to there."""
    web_left: float
    height_right: float
    """mm between floor and nozzle: twice the radius of the round front."""
    height_left: float
    thread: float
    """mm, diameter of the plastic as a round thread: deeper than this it follows no floor."""
    shift: float
    """mm by which the bead lies below the nozzle (negative): a thread that fell onto the floor."""
    lift: float
    """mm by which it stands above the nozzle."""
    gap: float
    """mm under the path."""
    unsupported: float
    """1 where nothing is below within reach and no neighbour beside."""
    bulged: float
    """mm² that found no room and rose."""


@njit(cache=True)
def section(
    gaps: _F, pores: _F, du: float, area: float, waits: float, due: float, flat: float, bore: float, nearest: float
) -> Section:
    """The section of `area` mm² over `gaps` (2n + 1) mm, `du` mm apart across the path, the middle one under it.

    `pores` (2n + 1): mm of pore under what is there. `flat` is half the nozzle's flat end, `nearest` the smallest gap
    right under the path. `waits` mm² of the area found no room before; they fill room, but leave the grooves as they
    are. Of plastic without room at most `due` mm² rise; the rest stays in the nozzle.
    """
    mid = len(gaps) // 2
    thread = math.sqrt(4 * area / math.pi)
    inner = min(mid, max(1, round(bore / 4 / du)))
    right, left = _depth(gaps, inner, -1), _depth(gaps, inner, 1)
    gap = (right + left) / 2
    shift = thread - gap if thread < gap <= REACH * thread else 0.0
    h_right = min(max(right + shift, LEAST * thread), thread)
    h_left = min(max(left + shift, LEAST * thread), thread)
    room_right, pore_right, throat_right = _room(gaps, pores, du, -1, shift, thread, h_right)
    room_left, pore_left, throat_left = _room(gaps, pores, du, 1, shift, thread, h_left)
    half_right, half_left = _half(area / 2, h_right, thread), _half(area / 2, h_left, thread)
    most = (mid + 0.5) * du
    end_right = min(most, max(half_right, flat + h_right / 2))
    end_left = min(most, max(half_left, flat + h_left / 2))
    sum_right, sum_left = np.cumsum(room_right + pore_right) * du, np.cumsum(room_left + pore_left) * du
    plain = (area - waits) / 2
    lack_right = max(0.0, plain - _spread(end_right, room_right, pore_right, sum_right, du, h_right))
    lack_left = max(0.0, plain - _spread(end_left, room_left, pore_left, sum_left, du, h_left))
    front_right, got_right = _front(area / 2, end_right, room_right, pore_right, sum_right, du, h_right)
    front_left, got_left = _front(area / 2, end_left, room_left, pore_left, sum_left, du, h_left)
    to_right = to_left = area / 2
    if lack_left > 0 and lack_right == 0:
        end_right, to_right = min(most, max(front_right, WIDEN * half_right)), area / 2 + ASIDE * lack_left
        front_right, got_right = _front(to_right, end_right, room_right, pore_right, sum_right, du, h_right)
    if lack_right > 0 and lack_left == 0:
        end_left, to_left = min(most, max(front_left, WIDEN * half_left)), area / 2 + ASIDE * lack_right
        front_left, got_left = _front(to_left, end_left, room_left, pore_left, sum_left, du, h_left)
    bulged = max(0.0, area - got_right - got_left)
    if bulged < 2 * CLOSE * area:
        bulged = 0.0
    bulged = min(bulged, due)
    wide_right = _half(to_right - waits / 2, h_right, thread if lack_right > 0 else 0.0)
    wide_left = _half(to_left - waits / 2, h_left, thread if lack_left > 0 else 0.0)
    round_right, round_left = min(front_right, throat_right, wide_right), min(front_left, throat_left, wide_left)
    lift = 0.0
    if bulged > 0:
        round_right, round_left = max(round_right, thread / 2), max(round_left, thread / 2)
        filled_right, filled_left = min(front_right, throat_right), min(front_left, throat_left)
        lift = _lift(gaps, du, bulged, filled_right, filled_left, round_right, round_left)
    web_right = _web(gaps, du, -1, min(front_right, throat_right), SLIT * bore, h_right)
    web_left = _web(gaps, du, 1, min(front_left, throat_left), SLIT * bore, h_left)
    # what is there, for the checks
    reach = min(mid, round(0.8 * flat / du))
    low = nearest
    contact = False
    for k in range(-mid, mid + 1):
        g = gaps[mid + k]
        if abs(k) <= reach:
            low = min(low, g)
        u = abs(k) * du
        front, height = (front_right, h_right) if k < 0 else (front_left, h_left)
        if 0.5 * front < u < front + height / 2 and g < 0.6 * height:
            contact = True
    alone = low > REACH * thread and not contact
    return Section(
        front_right,
        front_left,
        throat_right,
        throat_left,
        round_right,
        round_left,
        web_right,
        web_left,
        h_right,
        h_left,
        thread,
        shift,
        lift,
        gap,
        1.0 if alone else 0.0,
        bulged,
    )


@njit(cache=True)
def drop(outside: float, radius: float) -> float:
    """mm by which a round edge of `radius` lies below the bead's plane, `outside` mm beyond its flat part."""
    y = min(outside, radius)
    return radius - math.sqrt(radius * radius - y * y) if y > 0 else 0.0


@njit(cache=True)
def free_front(area: float, height: float) -> float:
    """mm to the front of `area` mm² over an open floor: half a stadium, or less than a half-disc."""
    corner = 1 - math.pi / 4  # of the square around a quarter disc
    if area >= math.pi / 8 * height * height:
        return float((area + corner / 2 * height * height) / height)
    return float((height - math.sqrt(max(height * height - 8 * corner * area, 0.0))) / (4 * corner))


@njit(cache=True)
def _half(area: float, height: float, thread: float) -> float:
    """mm to the front of `area` mm² where it finds its place; where there is little, no flatter than half a thread."""
    return float(free_front(area, max(height, thread / 2)))


@njit(cache=True)
def _depth(gaps: _F, inner: int, sign: int) -> float:
    """Mean gap on one side of the path, over `inner` samples."""
    mid = len(gaps) // 2
    total = gaps[mid] / 2
    for k in range(1, inner + 1):
        total += gaps[mid + sign * k]
    return float(total / (inner + 0.5))


@njit(cache=True)
def _room(
    gaps: _F, pores: _F, du: float, sign: int, shift: float, thread: float, height: float
) -> tuple[_F, _F, float]:
    """(n + 1,) room above the floor and in reachable pores, outwards from the path; none behind the throat."""
    mid = len(gaps) // 2
    room, pore = np.zeros(mid + 1), np.zeros(mid + 1)
    least = np.inf
    for k in range(mid + 1):
        g = gaps[mid + sign * k] + shift
        if least < THROAT * height and g > max(least, 0.0) + THROAT / 10 * height:
            return room, pore, (k - 0.5) * du
        least = min(least, g)
        share = 0.5 if k == 0 else 1.0  # the sample under the path belongs to both sides
        room[k] = min(max(g, 0.0), thread) * share
        if g < SAME_LAYER * height:
            pore[k] = pores[mid + sign * k] * share
    return room, pore, (mid + 0.5) * du


@njit(cache=True)
def _web(gaps: _F, du: float, sign: int, front: float, slit: float, height: float) -> float:
    """mm from the path to the shoulder of a neighbour not farther than a slit from the front; `front` without one."""
    mid = len(gaps) // 2
    for k in range(math.ceil(front / du), min(mid, math.floor((front + slit) / du)) + 1):
        if gaps[mid + sign * k] < SAME_LAYER * height:
            return k * du
    return front


@njit(cache=True)
def _corner(y: float, radius: float) -> float:
    """mm² between the plane and a round edge, up to y mm beyond the flat part: the integral of `drop`."""
    y = min(max(y, 0.0), radius)
    slice_ = y * math.sqrt(radius * radius - y * y) + radius * radius * math.asin(y / radius)
    return float(radius * y - slice_ / 2)


@njit(cache=True)
def _spread(front: float, room: _F, pore: _F, total: _F, du: float, height: float) -> float:
    """mm² of plastic behind a round front `front` mm from the path; `total` is the running sum of room and pore."""
    radius = min(height / 2, front)
    if radius <= 0:
        return 0.0
    flat = front - radius
    first = max(0, math.floor(flat / du + 0.5))
    area = total[first - 1] if first > 0 else 0.0
    last = min(len(room) - 1, math.floor(front / du + 0.5))
    for k in range(first, last + 1):
        a = max(0.0, (k - 0.5) * du)
        b = min((k + 0.5) * du, front)
        if b <= a:
            break
        full = 2.0 if k == 0 else 1.0
        d = (_corner(b - flat, radius) - _corner(a - flat, radius)) / (b - a)
        g = room[k] * full
        low = min(g, height - d) if g <= height else g - d
        area += (max(0.0, low - d) + max(0.0, pore[k] * full - d)) * (b - a)
    return area


@njit(cache=True)
def _front(area: float, end: float, room: _F, pore: _F, total: _F, du: float, height: float) -> tuple[float, float]:
    """Where the front stands that has `area` mm² behind it, `end` at most; and the area that it has."""
    low, f_low = 0.0, -area
    high, f_high = end, _spread(end, room, pore, total, du, height) - area
    if f_high <= 0:
        return end, f_high + area
    at = min(free_front(area, height), end)
    for _ in range(30):
        f = _spread(at, room, pore, total, du, height) - area
        if abs(f) < CLOSE * area:
            break
        if f < 0:
            low, f_low, f_high = at, f, f_high / 2  # the Illinois rule
        else:
            high, f_high, f_low = at, f, f_low / 2
        at = (low * f_high - high * f_low) / (f_high - f_low)
    return at, area


@njit(cache=True)
def _lift(
    gaps: _F, du: float, area: float, filled_right: float, filled_left: float, right: float, left: float
) -> float:
    """mm above the nozzle of the level below which `area` mm² find room, over what is there once the fronts stand."""
    mid = len(gaps) // 2
    first, last = max(0, mid - round(right / du)), min(len(gaps) - 1, mid + round(left / du))
    level = np.inf
    for _ in range(last - first + 1):
        held, count = 0.0, 0.0
        for k in range(first, last + 1):
            u = (k - mid) * du
            there = max(0.0, -gaps[k]) if -filled_right < u < filled_left else -gaps[k]
            if there < level:
                share = max(0.0, min(u + du / 2, left) - max(u - du / 2, -right)) / du
                held += there * share
                count += share
        better = (area / du + held) / max(count, 1e-3)
        if better >= level - 1e-9:
            break
        level = better
    return max(level, 1e-9)
