"""The loops of `access.py`, compiled: over poses of the head, over cubes of space, over the points in them."""

from typing import Any

import numpy as np
from numba import njit


@njit(cache=True)
def nearest(
    tips: Any,
    axes: Any,
    depth: float,
    bodies: Any,
    ignored: float,
    far: float,
    points: Any,
    sinks: Any,
    margins: Any,
    room_start: Any,
    room_ball: Any,
    cube_start: Any,
    cube_ball: Any,
) -> Any:
    """Smallest clearance (n,) of the head at each pose, the body and the point (rows of `points`) it belongs to.

    A point p counts where it stands more than `ignored` above the plane of the tip, `depth` times its sink lower
    than in `points`. Its clearance is the distance to the body less its margin. Cubes and rooms (bundles of cubes)
    whose ball cannot hold anything nearer than what is known, or than `far`, are passed over whole.
    """
    n = len(tips)
    least = np.full(n, far)
    body = np.full(n, -1, np.int64)
    point = np.full(n, -1, np.int64)
    most = margins.max() if len(margins) else 0.0
    for i in range(n):
        tx, ty, tz = tips[i]
        ax, ay, az = axes[i]
        for room in range(len(room_ball)):
            if not _may_matter(room_ball[room], tx, ty, tz, ax, ay, az, bodies, ignored, least[i] + most):
                continue
            for cube in range(room_start[room], room_start[room + 1]):
                if not _may_matter(cube_ball[cube], tx, ty, tz, ax, ay, az, bodies, ignored, least[i] + most):
                    continue
                for k in range(cube_start[cube], cube_start[cube + 1]):
                    dx, dy = points[k, 0] - tx, points[k, 1] - ty
                    dz = points[k, 2] - depth * sinks[k] - tz
                    over = ax * dx + ay * dy + az * dz
                    if over <= ignored:
                        continue
                    beside = np.sqrt(max(dx * dx + dy * dy + dz * dz - over * over, 0.0))
                    for b in range(len(bodies)):
                        gap = signed_distance(bodies[b], beside, over) - margins[k]
                        if gap < least[i]:
                            least[i], body[i], point[i] = gap, b, k
    return least, body, point


@njit(cache=True)
def signed_distance(frustum: Any, beside: float, over: float) -> Any:
    """Distance in mm from a frustum about the tool axis, negative inside, of a point `beside` and `over` the tip."""
    low, high, narrow, wide = frustum[0], frustum[1], frustum[2], frustum[3]
    height, grow = high - low, wide - narrow
    slant = np.hypot(height, grow)
    side = ((beside - narrow) * height - (over - low) * grow) / slant
    inside = max(side, max(low - over, over - high))
    if inside <= 0.0:
        return inside
    below = np.hypot(max(beside - narrow, 0.0), over - low)
    above = np.hypot(max(beside - wide, 0.0), over - high)
    t = ((beside - narrow) * grow + (over - low) * height) / (slant * slant)
    t = min(max(t, 0.0), 1.0)
    flank = np.hypot(beside - narrow - t * grow, over - low - t * height)
    return min(below, min(above, flank))


@njit(cache=True)
def _may_matter(
    ball: Any,
    tx: float,
    ty: float,
    tz: float,
    ax: float,
    ay: float,
    az: float,
    bodies: Any,
    ignored: float,
    want: float,
) -> bool:
    """Whether a ball (centre, radius) can hold a point above the tip's plane and nearer than `want` to a body."""
    dx, dy, dz = ball[0] - tx, ball[1] - ty, ball[2] - tz
    over = ax * dx + ay * dy + az * dz
    radius = ball[3]
    if over + radius <= ignored:
        return False
    beside = np.sqrt(max(dx * dx + dy * dy + dz * dz - over * over, 0.0))
    near = False
    for b in range(len(bodies)):
        if signed_distance(bodies[b], beside, over) - radius < want:
            near = True
            break
    return near
