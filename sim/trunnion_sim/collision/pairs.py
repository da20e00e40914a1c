"""Two bodies, one row of motion: do they touch anywhere along the way?

A plane between two convex bodies proves that they are apart, and it goes on proving it while they move: along its
normal n, linear joints bring them nearer by exactly their part of the way, and a rotary joint by at most the angle
times the lever, which is the largest distance from its axis of any point of the body that it carries, since the other
body's side may be taken as still. So the gap that a plane proves is carried from row to row as a number, and only where
it is used up a new plane is looked for, at the place where the old one ends (conservative advancement with a directed
bound; Mirtich 1996, chapter 3). Steps never go beyond what is proven, so no contact is missed, however short.

Joints that carry both bodies move neither against the other and are left out, as if they stood at zero.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_sim.collision.distance import CONTACT, depth, proven_distance
from trunnion_sim.collision.field import FAR, SMALLEST_STEP
from trunnion_sim.collision.place import Bodies, Chain, link, place
from trunnion_sim.collision.solids import farthest_from

ENOUGH = 0.6
"""Share of the distance that has to be proven where the solids are clear of each other."""
LEAST_LOOKS = 8
"""Looks at a row on which two bodies are in contact already, for the deepest place."""


class Pairs(NamedTuple):
    """Which bodies can touch, and how fast each joint can bring them together."""

    first: IntArray
    """(p,) rows of `Bodies`."""
    second: IntArray
    """(p,)."""
    slides: FloatArray
    """(p, k, 3) how a linear joint moves the first against the second, per mm; 0 for other joints."""
    levers: FloatArray
    """(p, k) mm per rad of a rotary joint, 1 for a linear joint beyond one; 0 for other joints."""


def make_pairs(chosen: IntArray, chain: Chain, bodies: Bodies, reach: FloatArray) -> Pairs:
    """The pairs `chosen` (p, 2) with the levers that hold while no joint is farther from zero than `reach` (k,)."""
    slides = np.zeros((len(chosen), len(reach), 3))
    levers = np.zeros((len(chosen), len(reach)))
    for number, (first, second) in enumerate(chosen.tolist()):
        for j in np.flatnonzero(bodies.carried[first] != bodies.carried[second]).tolist():
            one = first if bodies.carried[first, j] else second
            own = bodies.carried[one] & (bodies.carried[first] != bodies.carried[second])
            if chain.rotary[j]:
                levers[number, j] = _lever(j, one, own, chain, bodies, reach)
            elif (own & chain.rotary)[:j].any():
                levers[number, j] = 1.0
            else:
                slides[number, j] = chain.axes[j] if one == first else -chain.axes[j]
    return Pairs(chosen[:, 0].copy(), chosen[:, 1].copy(), slides, levers)


def _lever(j: int, b: int, own: Any, chain: Chain, bodies: Bodies, reach: FloatArray) -> float:
    """At least the distance in mm of any point of body b from the axis of rotary j, wherever the joints beyond stand.

    A rotary beyond (no machine has more than one) keeps distances from every point of its own axis, so from the one
    that lies nearest to the first axis; a linear joint beyond adds what it moves.
    """
    beyond = [m for m in np.flatnonzero(own).tolist() if m > j]
    turning = [m for m in beyond if chain.rotary[m]]
    extra = float(sum(reach[m] for m in beyond if not chain.rotary[m]))
    place_of = bodies.turns[b], bodies.places[b]
    if not turning:
        point, axis = (chain.pivots[j] - place_of[1]) @ place_of[0], chain.axes[j] @ place_of[0]
        return farthest_from(bodies.rows[b], bodies.corners, point, axis) + extra
    near, point = _nearest_points(chain, j, turning[0])
    centre = place_of[0] @ bodies.middles[b] + place_of[1]
    return float(np.linalg.norm(centre - point) + bodies.radii[b] + np.linalg.norm(point - near)) + extra


def _nearest_points(chain: Chain, i: int, j: int) -> tuple[FloatArray, FloatArray]:
    """Points of the axes of two rotaries that lie nearest to each other."""
    across = np.stack([chain.axes[i], -chain.axes[j]], axis=1)
    along = np.linalg.lstsq(across, chain.pivots[j] - chain.pivots[i], rcond=None)[0]
    return chain.pivots[i] + along[0] * chain.axes[i], chain.pivots[j] + along[1] * chain.axes[j]


@njit(cache=True)
def approach(before: Any, after: Any, pair: Any, pairs: Any, n: Any, free: Any) -> Any:
    """How much of a gap along n (3,) the whole row may use up, mm; negative where the gap must grow.

    free (2,) receives the row's linear and turning motion of the one body against the other, mm.
    """
    along = moved_x = moved_y = moved_z = turned = 0.0
    for j in range(len(before)):
        step = after[j] - before[j]
        if step == 0.0:
            continue
        turned += pairs.levers[pair, j] * abs(step)
        moved_x += pairs.slides[pair, j, 0] * step
        moved_y += pairs.slides[pair, j, 1] * step
        moved_z += pairs.slides[pair, j, 2] * step
    along = n[0] * moved_x + n[1] * moved_y + n[2] * moved_z
    free[0], free[1] = math.sqrt(moved_x * moved_x + moved_y * moved_y + moved_z * moved_z), turned
    return turned - along


@njit(cache=True)
def touch(
    before: Any, after: Any, pair: Any, pairs: Any, chain: Any, bodies: Any, until_contact: Any, n: Any, found: Any
) -> Any:
    """Walk two bodies through a row whose plane is used up; n (3,) is that plane's normal, or zeros.

    Returns the gap that n proves at the end of the row (0 where there is none), minus the deepest contact (FAR where
    they never touch), and how many poses were looked at. found (3,) receives the deepest place, in `part`. With
    `until_contact` it stops at the first contact, of which nothing more is said.
    """
    p, q = pairs.first[pair], pairs.second[pair]
    k = len(before)
    here = np.empty(k)
    own_p, own_q = np.empty(k, np.bool_), np.empty(k, np.bool_)
    for j in range(k):
        own_p[j] = bodies.carried[p, j] and not bodies.carried[q, j]
        own_q[j] = bodies.carried[q, j] and not bodies.carried[p, j]
    turn_p, at_p, turn_q, at_q = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    spot, free = np.empty(3), np.empty(2)
    worst, poses, t = FAR, 0, 0.0
    while True:
        for j in range(k):
            here[j] = before[j] + t * (after[j] - before[j])
        place(here, own_p, p, chain, bodies, turn_p, at_p)
        place(here, own_q, q, chain, bodies, turn_q, at_q)
        poses += 1
        wanted = max(approach(before, after, pair, pairs, n, free) * (1.0 - t), 0.0) + 2.0 * CONTACT
        row_p, row_q = bodies.rows[p], bodies.rows[q]
        gap = proven_distance(row_p, turn_p, at_p, row_q, turn_q, at_q, bodies.corners, wanted, ENOUGH, n, spot)
        if gap < CONTACT:
            if until_contact:
                return 0.0, 0.0, poses
            deep = depth(row_p, turn_p, at_p, row_q, turn_q, at_q, bodies.corners, n)
            if -deep < worst:
                worst = -deep
                _seen_from_part(here, spot, p, own_p, chain, bodies, found)
            n[:] = 0.0
            if t >= 1.0:
                return 0.0, worst, poses
            whole = free[0] + free[1]
            t += max(SMALLEST_STEP / whole, 1.0 / LEAST_LOOKS) if whole > 0.0 else 1.0
            t = min(t, 1.0)
            continue
        used = approach(before, after, pair, pairs, n, free)
        left = gap - used * (1.0 - t)
        if left >= CONTACT:
            return left, worst, poses
        t += (gap - CONTACT / 2.0) / used
        if t >= 1.0:
            t = 1.0


@njit(cache=True)
def _seen_from_part(q: Any, point: Any, b: Any, own: Any, chain: Any, bodies: Any, out: Any) -> Any:
    """A point of body b, where it would be if only its joints `own` carried it, in `part` at q."""
    turn, at, back, off = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    others = np.empty(len(q), np.bool_)
    for j in range(len(q)):
        others[j] = bodies.carried[b, j] and not own[j]
    link(q, others, chain, turn, at)
    link(q, chain.work_side, chain, back, off)
    for r in range(3):
        out[r] = -chain.origin[r]
        for m in range(3):
            moved = turn[m, 0] * point[0] + turn[m, 1] * point[1] + turn[m, 2] * point[2] + at[m]
            out[r] += back[m, r] * (moved - off[m])
