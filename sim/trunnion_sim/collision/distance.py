"""How far two placed convex solids are apart, with a plane between them as proof, or how deep one is in the other.

Gilbert, Johnson and Keerthi 1988, "A fast procedure for computing the distance between complex objects in
three-dimensional space": the differences of their points are a convex set, and its point nearest to zero is closed in
on from inside, by simplices. Every direction v that comes up proves a distance as well, since no difference reaches
less far along v than the supporting one: what is promised here rests on that proof and not on the simplices.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from trunnion_sim.collision.solids import support

CONTACT = 0.02
"""mm. Solids that come nearer than this touch: less than any joint of a printer repeats to."""
ROUNDS = 100
"""Simplices at most; boxes take a handful, round bodies up to some twenty."""
SPREAD = 32
"""Directions over half the sphere that are tried for the shortest way out."""
CONVERGED = 1e-9
"""mm between what is proven and what is reached at which the distance is known."""


@njit(cache=True)
def proven_distance(
    row_p: Any,
    turn_p: Any,
    at_p: Any,
    row_q: Any,
    turn_q: Any,
    at_q: Any,
    corners: Any,
    wanted: Any,
    enough: Any,
    n: Any,
    place: Any,
) -> Any:
    """At least how far in mm solid p lies beyond solid q along n (3,) unit; 0 or less where they touch.

    n comes as a guess, or as zeros, and leaves as the direction that proves what is returned: at least `wanted`, or
    the share `enough` of the true distance. Where the distance is below CONTACT, less than that is returned, and
    `place` (3,) is a point of p that near to q.
    """
    simplex, on_p = np.empty((4, 3)), np.empty((4, 3))
    weight = np.empty(4)
    w, p, q, v = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    v[:] = n
    if v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
        v[:] = at_p - at_q
        if v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
            v[2] = 1.0
    best, reached, count = -1e300, 1e300, 0
    for _ in range(ROUNDS):
        long = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        support(row_p, corners, turn_p, at_p, -v[0], -v[1], -v[2], p)
        support(row_q, corners, turn_q, at_q, v[0], v[1], v[2], q)
        low = 0.0
        for c in range(3):
            w[c] = p[c] - q[c]
            low += v[c] * w[c] / long
        if low > best:
            best = low
            n[:] = v / long
        if best >= wanted or (best > CONTACT and best >= enough * reached):
            return best
        done = reached - best < CONVERGED
        for k in range(count):
            done |= simplex[k, 0] == w[0] and simplex[k, 1] == w[1] and simplex[k, 2] == w[2]
        if done:
            break
        simplex[count], on_p[count] = w, p
        count = _nearest_to_zero(simplex, on_p, count + 1, weight)
        v[:] = 0.0
        for k in range(count):
            v += weight[k] * simplex[k]
        reached = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if reached < CONTACT:
            best = 0.0
            break
    place[:] = 0.0
    for k in range(count):
        place += weight[k] * on_p[k]
    return best


@njit(cache=True)
def depth(row_p: Any, turn_p: Any, at_p: Any, row_q: Any, turn_q: Any, at_q: Any, corners: Any, n: Any) -> Any:
    """How far in mm p has to be moved to be clear of q, along the best direction found; 0 where it need not.

    Tried are n, the local axes of both and what is at right angles to two of them, which is all that matters for boxes
    (separating axes; Gottschalk 1996), directions all over the sphere, and from the best of them uphill.
    """
    w, best_n, tried = np.empty(3), np.empty(3), np.empty(3)
    best = -1e300
    for k in range(16 + SPREAD):
        if k == 0:
            tried[:] = n
        elif k < 4:
            tried[:] = turn_p[:, k - 1]
        elif k < 7:
            tried[:] = turn_q[:, k - 4]
        elif k < 16:
            _cross(turn_p[:, (k - 7) // 3], turn_q[:, (k - 7) % 3], tried)
        else:
            # a spiral from the pole to the equator; the other half is the other sign
            tried[2] = 1.0 - (k - 15.5) / SPREAD
            across = math.sqrt(1.0 - tried[2] * tried[2])
            tried[0], tried[1] = across * math.cos(2.39996323 * k), across * math.sin(2.39996323 * k)
        long = math.sqrt(tried[0] * tried[0] + tried[1] * tried[1] + tried[2] * tried[2])
        if long < 1e-6:
            continue
        for sign in (1.0, -1.0):
            along = _along(row_p, turn_p, at_p, row_q, turn_q, at_q, corners, tried * (sign / long), w)
            if along > best:
                best = along
                best_n[:] = tried * (sign / long)
    aside, beside = np.empty(3), np.empty(3)
    step = 0.25
    while step > 1e-4:
        _cross(best_n, turn_p[:, int(np.argmin(np.abs(best_n @ turn_p)))], aside)
        aside /= math.sqrt(aside[0] * aside[0] + aside[1] * aside[1] + aside[2] * aside[2])
        _cross(best_n, aside, beside)
        here = best
        for k in range(6):
            angle = k * math.pi / 3.0
            tried[:] = best_n + step * (math.cos(angle) * aside + math.sin(angle) * beside)
            tried /= math.sqrt(tried[0] * tried[0] + tried[1] * tried[1] + tried[2] * tried[2])
            along = _along(row_p, turn_p, at_p, row_q, turn_q, at_q, corners, tried, w)
            if along > best:
                best = along
                best_n[:] = tried
                break
        if best == here:
            step /= 2.0
    return max(-best, 0.0)


@njit(cache=True)
def _along(row_p: Any, turn_p: Any, at_p: Any, row_q: Any, turn_q: Any, at_q: Any, corners: Any, n: Any, w: Any) -> Any:
    """How far p lies beyond q along n, and the difference of points (3,) that says so."""
    p, q = np.empty(3), np.empty(3)
    support(row_p, corners, turn_p, at_p, -n[0], -n[1], -n[2], p)
    support(row_q, corners, turn_q, at_q, n[0], n[1], n[2], q)
    w[:] = p - q
    return n[0] * w[0] + n[1] * w[1] + n[2] * w[2]


@njit(cache=True)
def _nearest_to_zero(simplex: Any, other: Any, count: Any, weight: Any) -> Any:
    """Weights of the point of a simplex that is nearest to zero; corners without weight are dropped. New count."""
    if count == 1:
        weight[0] = 1.0
    elif count == 2:
        _on_segment(simplex[0], simplex[1], weight)
    elif count == 3:
        _on_triangle(simplex[0], simplex[1], simplex[2], weight)
    else:
        _in_tetrahedron(simplex, weight)
    kept = 0
    for k in range(count):
        if weight[k] > 0.0:
            simplex[kept], other[kept] = simplex[k], other[k]
            weight[kept] = weight[k]
            kept += 1
    return kept


@njit(cache=True)
def _on_segment(a: Any, b: Any, weight: Any) -> Any:
    along = square = 0.0
    for c in range(3):
        along -= a[c] * (b[c] - a[c])
        square += (b[c] - a[c]) ** 2
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    weight[0], weight[1] = 1.0 - share, share


@njit(cache=True)
def _on_triangle(a: Any, b: Any, c: Any, weight: Any) -> Any:
    """By the regions of a triangle (Ericson 2005, "Real-Time Collision Detection", section 5.1.5)."""
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = b[k] - a[k], c[k] - a[k]
        d1 -= ab * a[k]
        d2 -= ac * a[k]
        d3 -= ab * b[k]
        d4 -= ac * b[k]
        d5 -= ab * c[k]
        d6 -= ac * c[k]
    weight[0] = weight[1] = weight[2] = 0.0
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        weight[0] = 1.0
    elif d3 >= 0.0 and d4 <= d3:
        weight[1] = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0 and d1 > d3:
        weight[1] = d1 / (d1 - d3)
        weight[0] = 1.0 - weight[1]
    elif d6 >= 0.0 and d5 <= d6:
        weight[2] = 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0 and d2 > d6:
        weight[2] = d2 / (d2 - d6)
        weight[0] = 1.0 - weight[2]
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0 and d4 - d3 + d5 - d6 > 0.0:
        weight[2] = (d4 - d3) / (d4 - d3 + d5 - d6)
        weight[1] = 1.0 - weight[2]
    elif va + vb + vc > 0.0:
        weight[1], weight[2] = vb / (va + vb + vc), vc / (va + vb + vc)
        weight[0] = 1.0 - weight[1] - weight[2]
    else:
        weight[0] = 1.0


@njit(cache=True)
def _in_tetrahedron(simplex: Any, weight: Any) -> Any:
    """Zero lies behind every face, or nearest to one of those that it lies before."""
    own, normal = np.empty(4), np.empty(3)
    least, outside = 1e300, False
    for k in range(4):
        a, b, c, d = simplex[(k + 1) % 4], simplex[(k + 2) % 4], simplex[(k + 3) % 4], simplex[k]
        _cross(b - a, c - a, normal)
        zero = far = 0.0
        for m in range(3):
            zero -= a[m] * normal[m]
            far += (d[m] - a[m]) * normal[m]
        own[k] = zero / far if far != 0.0 else -1.0
        if own[k] > 0.0:
            continue
        outside = True
        on = np.zeros(3)
        _on_triangle(a, b, c, on)
        square = 0.0
        for m in range(3):
            square += (on[0] * a[m] + on[1] * b[m] + on[2] * c[m]) ** 2
        if square < least:
            least = square
            weight[k] = 0.0
            weight[(k + 1) % 4], weight[(k + 2) % 4], weight[(k + 3) % 4] = on[0], on[1], on[2]
    if not outside:
        weight[:] = own


@njit(cache=True)
def _cross(a: Any, b: Any, out: Any) -> Any:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
