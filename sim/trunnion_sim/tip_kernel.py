"""Tip words and joint words into each other, one pose at a time, compiled: what firmware does with G43.4 on.

A *native* row holds the tip over the part under the letters X, Y, Z, as the joint values that bring the tip there with
the rotaries at zero, and the joint angles under the rotary letters; with the angles at zero it is the joints. With
the angles known the linear joints follow from one 3x3 system: the tool side and the work side must carry the tip and
the point of the part to the same place, and each linear joint moves one of them along its axis as the rotary joints
before it have turned it. All in mm and degrees, in profile order.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

_F = NDArray[np.float64]
SINGULAR = 1e-9
"""Determinant of the linear joints' directions below which they do not span space."""
SHORTEST = 1e-6
"""Squared length under which Marlin takes a distance for none (UNEAR_ZERO)."""
STILL = 1e-12
"""Squared degrees under which the rotary joints rest."""
MOST_PIECES = 65535
"""The fork counts the pieces of a move in 16 bits."""
REACH = 1e-4
"""mm or degrees that a joint may be past its end (Marlin's `fslop`)."""


class Geometry(NamedTuple):
    """The joint chain as arrays; `place` are the columns of X, Y and Z."""

    rotary: NDArray[np.bool_]
    tool: NDArray[np.bool_]
    axis: _F
    """(k, 3)."""
    point: _F
    """(k, 3) mm, machine frame, all joints at zero."""
    tip: _F
    """(3,)."""
    directions: _F
    """(3, 3) columns: how the tip moves over the part with X, Y and Z, rotaries at zero."""
    inverse: _F
    """(3, 3)."""
    low: _F
    """(k,) mm and degrees."""
    high: _F
    place: NDArray[np.int64]
    """(3,)."""


@njit(cache=True)
def to_joints(g: Geometry, native: _F, joints: _F) -> bool:
    """Write to `joints` (k,) what puts the tip where `native` (k,) says; False where a joint would leave its travel."""
    k = len(g.rotary)
    gap = np.zeros(3)
    sides = np.zeros((2, 3))
    matrix = np.zeros((3, 3))
    for c in range(3):
        sides[1, c] = g.tip[c]
        sides[0, c] = g.tip[c]
        for d in range(3):
            sides[0, c] += g.directions[c, d] * native[g.place[d]]
    for j in range(k - 1, -1, -1):
        if g.rotary[j]:
            side = 1 if g.tool[j] else 0
            _turn(g, j, native[j], sides[side], 1.0)
    for j in range(k):
        if g.rotary[j]:
            continue
        column = -1
        for c in range(3):
            if g.place[c] == j:
                column = c
        direction = np.array([g.axis[j, 0], g.axis[j, 1], g.axis[j, 2]])
        for b in range(j - 1, -1, -1):
            if g.rotary[b] and g.tool[b] == g.tool[j]:
                _turn(g, b, native[b], direction, 0.0)
        for c in range(3):
            matrix[c, column] = direction[c] if g.tool[j] else -direction[c]
    for c in range(3):
        gap[c] = sides[0, c] - sides[1, c]
    determinant = _determinant(matrix)
    if abs(determinant) < SINGULAR:
        return False
    for j in range(k):
        joints[j] = native[j]
    for c in range(3):
        replaced = matrix.copy()
        replaced[:, c] = gap
        joints[g.place[c]] = _determinant(replaced) / determinant
    reached = True
    for j in range(k):
        reached = reached and g.low[j] - REACH <= joints[j] <= g.high[j] + REACH
    return reached


@njit(cache=True)
def all_to_joints(g: Geometry, native: _F, joints: _F) -> None:
    """`to_joints` for every row of `native` (n, k)."""
    for i in range(len(native)):
        to_joints(g, native[i], joints[i])


@njit(cache=True)
def pieces(g: Geometry, begin: _F, goal: _F, filament: float, feed: float, per_second: float) -> tuple[int, float]:
    """Pieces that a move from one native row to another is cut into, and the length that F is read over.

    Only a move that turns a rotary is cut; none where nothing moves. The length is mm of X, Y, Z if any moves, else
    degrees, else filament (`get_move_distance`).
    """
    straight = 0.0
    turned = 0.0
    for j in range(len(g.rotary)):
        change = goal[j] - begin[j]
        if g.rotary[j]:
            turned += change * change
        else:
            straight += change * change
    length = math.sqrt(straight if straight >= SHORTEST else turned)
    if turned < STILL:
        return 1, length
    if length * length < SHORTEST:
        length = abs(filament)
        if length < SHORTEST:
            return 0, 0.0
    return max(1, min(MOST_PIECES, int(per_second * length / max(feed, 1e-3)))), length


@njit(cache=True)
def to_native(g: Geometry, joints: _F, native: _F) -> None:
    """Write to `native` (k,) where the tip is at `joints` (k,), and the angles."""
    k = len(g.rotary)
    p = np.array([g.tip[0], g.tip[1], g.tip[2]])
    for j in range(k - 1, -1, -1):
        if g.tool[j]:
            if g.rotary[j]:
                _turn(g, j, joints[j], p, 1.0)
            else:
                for c in range(3):
                    p[c] += joints[j] * g.axis[j, c]
    for j in range(k):
        if not g.tool[j]:
            if g.rotary[j]:
                _turn(g, j, -joints[j], p, 1.0)
            else:
                for c in range(3):
                    p[c] -= joints[j] * g.axis[j, c]
    for j in range(k):
        native[j] = joints[j]
    for c in range(3):
        native[g.place[c]] = 0.0
        for d in range(3):
            native[g.place[c]] += g.inverse[c, d] * (p[d] - g.tip[d])


@njit(cache=True)
def _turn(g: Geometry, j: int, degrees: float, p: _F, about_point: float) -> None:
    """Turn `p` (3,) in place about joint j (Rodrigues); a direction where `about_point` is 0."""
    angle = math.radians(degrees)
    sine, cosine = math.sin(angle), math.cos(angle)
    ax, ay, az = g.axis[j, 0], g.axis[j, 1], g.axis[j, 2]
    x = p[0] - about_point * g.point[j, 0]
    y = p[1] - about_point * g.point[j, 1]
    z = p[2] - about_point * g.point[j, 2]
    along = (ax * x + ay * y + az * z) * (1.0 - cosine)
    p[0] = x * cosine + (ay * z - az * y) * sine + ax * along + about_point * g.point[j, 0]
    p[1] = y * cosine + (az * x - ax * z) * sine + ay * along + about_point * g.point[j, 1]
    p[2] = z * cosine + (ax * y - ay * x) * sine + az * along + about_point * g.point[j, 2]


@njit(cache=True)
def _determinant(m: _F) -> float:
    return float(
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )
