r"""The trajectory planner of LinuxCNC as a compiled loop over servo cycles: `src/emc/tp/tp.c` and `tc.c` of 2.9.

Every move has a trapezoid of its own from rest to rest. Moves with rotary or UVW words only get parabolic blends: each
is driven with half its acceleration, and the next one sets off while the one before it slows down, as soon as that is
below its blend velocity (`tpComputeBlendVelocity`); for some cycles both are under way and their velocities add.
Moves of X, Y and Z alone are joined by an arc inside G64 P, or by slowing down until the kink is harmless
(`tpSetupTangent`).

    one move after the other        what the tip does

      /---\  /--\                     /----------\
     /     \/    \         ->        /  \  /      \
    /      /\     \                 /    \/        \

A row ends where as much time is owed of its move as is had of the next, both at the speeds that they want: then the way
adds up to the rows before. The speeds there are those of both moves together.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]
_B = NDArray[np.bool_]
_I = NDArray[np.int64]
STILL = 1e-8
"""CART_FUZZ: changes of a word that are none."""
SLOWEST = 0.1 / 60.0
"""Units/s: G93 reads no less (`inverse_time_rate_straight`)."""
KINK = 0.1
"""ARC_BLEND_KINK_RATIO: share of the acceleration that a kink between tangent moves may ask for."""
ARC_NORMAL = 0.5 * math.sqrt(3.0)
"""BLEND_ACC_RATIO_NORMAL: share of the acceleration that holds a move on its blend arc."""
ARRIVED = 1e-12
"""TP_POS_EPSILON and TP_TIME_EPSILON, mm and s."""
CREEP = 1e-8
"""TP_VEL_EPSILON."""
BLENDED, JOINED, STOPPED = 0, 1, 2
"""How a move meets the next: both under way for a while, at a common speed, or at rest."""
LARGEST = 1e12
HALVINGS = 30
Law = tuple[_F, _F, _F, _F, _F, _F, _F]
"""Length, asked speed, entry, cruise, exit, acceleration, duration of every row."""


@njit(cache=True)
def linuxcnc(
    delta: _F,
    linear: _B,
    feed: _F,
    inverse: _B,
    stops: _B,
    speed_limit: _F,
    acceleration_limit: _F,
    tolerance: float,
    cycle: float,
) -> Law:
    """Every row as LinuxCNC moves it in servo cycles of `cycle` s. XYZ lead, else UVW (the filament), else the angles.

    delta (n, k + 1) mm and degrees, the filament last. Linear in the cycles: an hour of motion takes about a second.
    """
    n, columns = delta.shape
    length, asked, wanted, top, push = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.ones(n)
    leader = np.zeros(n, np.int64)
    direction = np.zeros((n, columns))
    for i in range(n):
        size = np.zeros(3)
        longest = np.zeros(3)
        for j in range(columns):
            group = 0 if linear[j] else (1 if j == columns - 1 else 2)
            size[group] += delta[i, j] ** 2
            longest[group] = max(longest[group], abs(delta[i, j]))
        if longest.max() < STILL:
            continue
        leader[i] = 0 if longest[0] >= STILL else (1 if longest[1] >= STILL else 2)
        d = math.sqrt(size[leader[i]])
        speed, a = LARGEST, LARGEST
        for j in range(columns):
            r = abs(delta[i, j])
            if r >= STILL:
                speed = min(speed, speed_limit[j] * d / r)
                a = min(a, acceleration_limit[j] * d / r)
            if leader[i] == 0 and linear[j]:
                direction[i, j] = delta[i, j] / d
        length[i], push[i] = d, a
        asked[i] = max(feed[i] * d, SLOWEST) if inverse[i] else feed[i]
        wanted[i] = min(asked[i], speed)
        top[i] = min(speed, d / cycle)
    moving = np.flatnonzero(length > 0)
    m = len(moving)
    meets = np.full(n, STOPPED)
    common = np.zeros(n)  # speed at the end of a joined move
    share = np.ones(n)  # of the acceleration that moves along the path
    cut, arc = np.zeros(n), np.zeros(n)  # mm that arcs take from a move, s on the arc at its end
    pending = True
    p = 0
    for i in range(n):
        pending = pending or stops[i]
        if length[i] > 0:
            if not pending:
                b = moving[p - 1]
                _meet(b, i, delta, direction, leader, linear, length, wanted, top, push, acceleration_limit, tolerance,
                      cycle, meets, common, share, cut, arc)  # fmt: skip
            pending = False
            p += 1
    # A move that is last before a stop is ready to blend like any other (its termination condition), at half.
    for q in range(m):
        i = moving[q]
        if meets[i] != JOINED:
            share[i] = min(share[i], 0.5)
    most = push
    push = push * share
    for q in range(m - 2, -1, -1):
        i, after = moving[q], moving[q + 1]
        if meets[i] == JOINED:
            reach = math.sqrt(common[after] ** 2 + 2.0 * push[after] * (length[after] - cut[after]))
            common[i] = min(min(common[i], reach), min(min(wanted[i], top[i]), min(wanted[after], top[after])))
    return _cycles(moving, length, asked, np.minimum(wanted, top), push, meets, common, direction, leader, tolerance,
                   cycle, length - cut, arc, most)  # fmt: skip


@njit(cache=True)
def _meet(
    b: int,
    i: int,
    delta: _F,
    direction: _F,
    leader: _I,
    linear: _B,
    length: _F,
    wanted: _F,
    top: _F,
    push: _F,
    acceleration_limit: _F,
    tolerance: float,
    cycle: float,
    meets: _I,
    common: _F,
    share: _F,
    cut: _F,
    arc: _F,
) -> None:
    """How row `b` meets row `i`: parabolic blends where anything but X, Y and Z moves (`tcRotaryMotionCheck`)."""
    meets[b] = BLENDED
    for j in range(delta.shape[1]):
        if not linear[j] and (abs(delta[b, j]) >= STILL or abs(delta[i, j]) >= STILL):
            return
    fastest = min(min(wanted[b], top[b]), min(wanted[i], top[i]))
    jump = fastest / cycle + push[i]
    scale = 0.0
    cosine = 0.0
    for j in range(delta.shape[1]):
        if linear[j]:
            scale = max(scale, jump * abs(direction[i, j] - direction[b, j]) / acceleration_limit[j])
            cosine += direction[i, j] * direction[b, j]
    if cosine < -0.999:  # SHARP_CORNER_DEG
        meets[b] = STOPPED
        return
    if scale < KINK:
        meets[b], common[b] = JOINED, fastest
        share[b], share[i] = min(share[b], 1.0 - scale), min(share[i], 1.0 - scale)
        return
    half = math.sqrt(max(0.5 * (1.0 + cosine), 0.0))
    lean = math.sqrt(max(1.0 - half * half, 0.0)) / half
    # No arc takes half of a move, so that something is left between two.
    radius = min(tolerance * half / max(1.0 - half, 1e-12), 0.49 * min(length[b], length[i]) / max(lean, 1e-12))
    around = min(fastest, math.sqrt(ARC_NORMAL * min(push[b], push[i]) * radius))
    meets[b], common[b] = JOINED, max(around, fastest * KINK / scale)
    if around >= common[b]:
        cut[b] += radius * lean
        cut[i] += radius * lean
        arc[b] = radius * math.acos(cosine) / around


@njit(cache=True)
def _blend_speed(length_b: float, length_i: float, wanted_b: float, wanted_i: float, push_b: float, push_i: float,
                 cosine: float, tolerance: float) -> float:  # fmt: skip
    """Speed of a move below which the next one sets off (`tpComputeBlendVelocity`)."""
    this = min(math.sqrt(push_b * length_b), wanted_b)
    after = min(math.sqrt(push_i * length_i), wanted_i)
    room = min(length_b / this, length_i / after)
    blend = min(room, max(this / push_b, after / push_i))
    speed = min(this, blend * push_b)
    lean = math.sqrt(max(0.5 * (1.0 - cosine), 0.0))  # cosine of half the angle between the moves
    if lean > math.sin(1e-3):
        speed = min(speed, 2.0 * math.sqrt(push_b * tolerance / lean))
    return speed


@njit(cache=True)
def _cycles(
    moving: _I,
    length: _F,
    asked: _F,
    wanted: _F,
    push: _F,
    meets: _I,
    common: _F,
    direction: _F,
    leader: _I,
    tolerance: float,
    cycle: float,
    leg: _F,
    arc: _F,
    most: _F,
) -> Law:
    """Run the servo cycles (`tpRunCycle`) and read off when every row begins and ends, and how fast."""
    n = len(length)
    m = len(moving)
    done, speed, arrives = np.zeros(n), np.zeros(n), np.zeros(n)
    span = np.full(n, cycle)  # of the next update of a move
    finished = np.zeros(n, np.bool_)
    entry, cruise, leave, duration = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    acceleration = push.copy()
    clock = 0.0
    began = 0.0
    for p in range(m):
        i = moving[p]
        after = moving[p + 1] if p + 1 < m and meets[i] != STOPPED else -1
        blend = 0.0
        cosine = 0.0
        if after >= 0:
            for j in range(direction.shape[1]):
                cosine += direction[i, j] * direction[after, j]
            # Without XYZ motion the planner's direction is +X.
            if leader[i] != 0 and leader[after] != 0:
                cosine = 1.0
            elif leader[i] != 0:
                cosine = direction[after, 0]
            elif leader[after] != 0:
                cosine = direction[i, 0]
            cosine = min(1.0, max(-1.0, cosine))
            if meets[i] == BLENDED:
                blend = _blend_speed(
                    leg[i], leg[after], wanted[i], wanted[after], push[i], push[after], cosine, tolerance
                )
        blending = False
        handed = -1.0  # when the row ended
        gap_was = 0.0
        final = common[i] if meets[i] == JOINED else 0.0
        while True:
            ended = finished[i]
            was, was_after = speed[i], speed[after] if after >= 0 else 0.0
            if not ended:
                span[i] = cycle
                slowing = _update(i, leg, done, speed, arrives, span, finished, wanted, push, final, cycle)
                blending = blending or (slowing and speed[i] < blend)
            elif meets[i] == JOINED:
                handed = clock + span[i] + 0.5 * arc[i]
                clock += arc[i]
                leave[i] = entry[after] = speed[after] = was_after = arrives[i]
                span[after] = cycle - span[i]
            elif meets[i] == STOPPED:
                handed = clock
            if after >= 0 and (blending or ended):
                ahead = common[after] if ended and meets[after] == JOINED else 0.0
                _update(after, leg, done, speed, arrives, span, finished, wanted, push, ahead, cycle)
            if meets[i] == BLENDED and (blending or ended) and handed < 0.0:
                # What is owed of this move and had of the next, in seconds at the speeds that they want.
                gap = (0.0 if ended else (leg[i] - done[i]) / wanted[i]) - done[after] / wanted[after]
                if gap <= 0.0:
                    part = gap_was / (gap_was - gap)
                    handed = clock + part * cycle
                    mine = was + part * ((0.0 if ended else speed[i]) - was)
                    other = was_after + part * (speed[after] - was_after)
                    pace = min(1.0, mine / wanted[i] + other / wanted[after])
                    leave[i], entry[after] = pace * wanted[i], pace * wanted[after]
            if meets[i] == BLENDED and not ended:
                gap_was = (leg[i] - done[i]) / wanted[i] - done[after] / wanted[after]
            clock += cycle
            if ended:
                break
        duration[i] = handed - began
        began = handed
    for i in moving:
        _fit(i, length, duration, wanted, most, entry, cruise, leave, acceleration)
    return length, asked, entry, cruise, leave, acceleration, duration


@njit(cache=True)
def _update(
    i: int,
    length: _F,
    done: _F,
    speed: _F,
    arrives: _F,
    span: _F,
    finished: _B,
    wanted: _F,
    push: _F,
    final: float,
    cycle: float,
) -> bool:
    """One move, one cycle (`tpCalculateTrapezoidalAccel`, `tcUpdateDistFromAccel`, `tpCheckEndCondition`).

    True while it slows down towards its end. `finished` is set when the end lies inside the next cycle, with the speed
    `arrives` there.
    """
    dt, a, v = span[i], push[i], speed[i]
    ahead = length[i] - done[i]
    half = 0.5 * a * dt
    inside = final * final + a * (2.0 * ahead - v * dt) + half * half
    reachable = -half
    if inside > half * half:
        reachable += math.sqrt(inside)
    target = max(min(reachable, wanted[i]), -wanted[i])
    rate = max(min((target - v) / max(dt, ARRIVED), a), -a)
    now = v + rate * dt
    if now < 0.0:
        now = 0.0
        if ahead < v * dt:
            done[i] = length[i]
    else:
        done[i] = min(length[i], done[i] + 0.5 * (now + v) * dt)
    speed[i] = now
    slowing = bool(abs(reachable - now) < CREEP and rate < 0.0)
    span[i] = cycle
    ahead = length[i] - done[i]
    if ahead <= ARRIVED:
        done[i] = length[i]
        finished[i], span[i], arrives[i] = True, 0.0, now
        return slowing
    mean = 0.5 * (now + final)
    left = 0.5 * ARRIVED
    if mean > CREEP:
        left = max(left, ahead / mean)
    elif ahead > mean * cycle:
        return slowing
    rate = (final - now) / left
    if abs(rate) > a:
        rate = math.copysign(a, rate)
        inside = (now / rate) ** 2 + 2.0 / rate * ahead
        if inside < 0.0:
            return slowing
        root = math.sqrt(inside) if inside >= ARRIVED * ARRIVED else 0.0
        left = -now / rate + (root if rate > 0 else -root)
        final = now + left * rate
    if left < ARRIVED:
        done[i] = length[i]
        finished[i], span[i], arrives[i] = True, 0.0, final
    elif left < cycle:
        finished[i], span[i], arrives[i] = True, left, final
    return slowing


@njit(cache=True)
def _fit(
    i: int,
    length: _F,
    duration: _F,
    wanted: _F,
    most: _F,
    entry: _F,
    cruise: _F,
    leave: _F,
    acceleration: _F,
) -> None:
    """The trapezoid of the row's own length and duration between its two speeds.

    Where it would be steeper than the axes are (`most`), though both moves together never are, the speeds at its ends
    give way towards the mean.
    """
    d, t = length[i], duration[i]
    if t <= 0.0:
        cruise[i] = max(entry[i], leave[i], wanted[i])
        return
    mean = d / t
    v0, v1, v, a = _trapezoid(entry[i], leave[i], mean, t, d, acceleration[i])
    if a > most[i]:
        stiff, soft = 0.0, 1.0
        for _ in range(HALVINGS):
            part = 0.5 * (stiff + soft)
            first, last = entry[i] + part * (mean - entry[i]), leave[i] + part * (mean - leave[i])
            if _trapezoid(first, last, mean, t, d, acceleration[i])[3] > most[i]:
                stiff = part
            else:
                soft = part
        first, last = entry[i] + soft * (mean - entry[i]), leave[i] + soft * (mean - leave[i])
        v0, v1, v, a = _trapezoid(first, last, mean, t, d, acceleration[i])
    entry[i], leave[i], cruise[i], acceleration[i] = v0, v1, max(v, v0, v1), a


@njit(cache=True)
def _trapezoid(v0: float, v1: float, mean: float, t: float, d: float, a: float) -> tuple[float, float, float, float]:
    """Entry, exit, cruise and acceleration, `a` if that is steep enough, of `d` in `t` s between two speeds."""
    low, high = min(v0, v1), max(v0, v1)
    if low >= mean:
        return mean, mean, mean, a
    if high > mean:
        # One ramp and a cruise at the greater of the two, as steep as the length asks for.
        v = min(high, 2.0 * mean - low)
        room = 2.0 * (v * t - d)
        steep = (v - low) ** 2 / room if room > 0.0 else LARGEST
        return min(v0, v), min(v1, v), v, steep
    both, squares = v0 + v1, v0 * v0 + v1 * v1
    room = (both + a * t) ** 2 - 4.0 * a * d - 2.0 * squares
    if room >= 0.0:
        return v0, v1, 0.5 * (both + a * t - math.sqrt(room)), a
    b = 4.0 * d - 2.0 * both * t
    a = (b + math.sqrt(max(b * b + 4.0 * t * t * (v0 - v1) ** 2, 0.0))) / (2.0 * t * t)
    return v0, v1, 0.5 * (both + a * t), a
