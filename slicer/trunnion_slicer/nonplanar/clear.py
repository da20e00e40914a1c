"""Smoothed tool axes that would bring the head into the part go back towards their normals, as far as they must.

`access` decided with the normals what is printed along the skin. A smoothed axis leans a little, and with it the whole
head, so every row is tried again. First probes are, so close along the way that the head cannot come nearer between
them than it could move there; the rows around those that are near something are tried one by one. What has to go back
is eased in and out along the path.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray

Gap = Callable[[FloatArray, FloatArray, float], FloatArray]
"""From tips (n, 3) mm, tool axes (n, 3) unit and a distance in mm to the clearance (n,) mm of the head, negative where
it touches; beyond the distance it is not looked for, and that is returned."""

STEP = 0.5
"""mm. How far the head may move between two probes."""
ARM = 25.0
"""mm from the tip: how far what turns with the tool is taken to reach when its movement is measured."""
EASE = 2.0
"""mm of path over which an axis goes back all the way."""
HALVINGS = 7
"""Of the way back: it is then known to a hundredth."""
ROUNDS = 6
"""How often eased rows are tried again; what touches then goes back alone."""
SAME = 1e-6
"""mm by which a clearance may be less and count as the same."""


def kept_clear(points: FloatArray, axes: FloatArray, normals: FloatArray, starts: IntArray, gap: Gap) -> FloatArray:
    """The axes (n, 3) unit, moved along great circles to the normals (n, 3) where the head would touch otherwise.

    points (n, 3) mm; path i is rows starts[i] : starts[i + 1]. No row ends up nearer than it is with its normal, unless
    it is clear (its gap not negative).
    """
    if not len(points):
        return axes
    along = _along(points, starts)
    suspect = _near_something(points, axes, gap)
    share = np.zeros(len(points))
    least = np.full(len(points), np.nan)
    result = axes
    for turn in range(ROUNDS):
        rows = np.flatnonzero(suspect)
        rows = rows[_touching(points, result, normals, rows, least, gap)]
        if not rows.size:
            return result
        needed = _way_back(points, axes, normals, share, rows, least, gap)
        share[rows] = needed if turn < ROUNDS - 1 else 1.0
        if turn < ROUNDS - 1:
            share = _eased(share, points, along, starts)
        suspect |= share > 0
        result = _leant(axes, normals, share)
    rows = np.flatnonzero(suspect)
    share[rows[_touching(points, result, normals, rows, least, gap)]] = 1.0
    return _leant(axes, normals, share)


def _near_something(points: FloatArray, axes: FloatArray, gap: Gap) -> BoolArray:
    """(n,) whether the head can touch something at the row, by probes no farther apart than it moves STEP."""
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) + ARM * np.linalg.norm(np.diff(axes, axis=0), axis=1)
    stretch = np.floor(np.append(0.0, np.cumsum(moved)) / STEP).astype(np.int64)
    probe = np.flatnonzero(np.diff(stretch, prepend=-1))
    near = gap(points[probe], axes[probe], STEP) < STEP
    return np.asarray(np.repeat(near, np.diff(np.append(probe, len(points)))))


def _touching(
    points: FloatArray, axes: FloatArray, normals: FloatArray, rows: IntArray, least: FloatArray, gap: Gap
) -> BoolArray:
    """Which of the rows touch more than with their normals, whose clearance, at most 0, is kept in `least` (n,)."""
    now = gap(points[rows], axes[rows], 0.0)
    new = rows[(now < 0) & np.isnan(least[rows])]
    least[new] = np.minimum(gap(points[new], normals[new], 0.0), 0.0)
    return np.asarray((now < 0) & (now < least[rows] - SAME))


def _way_back(
    points: FloatArray,
    axes: FloatArray,
    normals: FloatArray,
    share: FloatArray,
    rows: IntArray,
    least: FloatArray,
    gap: Gap,
) -> FloatArray:
    """Shares (k,) of the way to the normals at which the rows no longer touch more than there."""
    low, high = share[rows], np.ones(len(rows))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        clear = gap(points[rows], _leant(axes[rows], normals[rows], middle), 0.0) >= least[rows] - SAME
        low, high = np.where(clear, low, middle), np.where(clear, middle, high)
    return high


def _leant(axes: FloatArray, normals: FloatArray, share: FloatArray) -> FloatArray:
    """Axes moved by shares (n,) of the great circles to the normals."""
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(axes - normals, axis=1) / 2, 0, 1))
    safe = np.maximum(np.sin(angle), 1e-12)
    here, there = np.sin((1 - share) * angle) / safe, np.sin(share * angle) / safe
    moved = here[:, None] * axes + there[:, None] * normals
    moved /= np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-300)
    moved = np.where((share >= 1)[:, None], normals, moved)
    return np.where(((share <= 0) | (angle < 1e-9))[:, None], axes, moved)


def _along(points: FloatArray, starts: IntArray) -> FloatArray:
    """(n,) mm of path before each row, with a gap of more than EASE between paths."""
    step = np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1))
    step[starts[1:-1]] = 2 * EASE
    return np.asarray(np.cumsum(step))


def _eased(share: FloatArray, points: FloatArray, along: FloatArray, starts: IntArray) -> FloatArray:
    """Shares (n,) no less than these that rise and fall smoothly along paths, from 0 to 1 within EASE."""
    way = 0.5 - np.sin(np.arcsin(1 - 2 * np.clip(share, 0, 1)) / 3)
    for first, last in pairwise(starts):
        if (points[first] == points[last - 1]).all() and way[first:last].any():
            turn = along[last - 1] - along[first]
            over = np.concatenate([along[first:last] - turn, along[first:last], along[first:last] + turn])
            way[first:last] = _envelope(np.tile(way[first:last], 3), over)[last - first : 2 * (last - first)]
    way = _envelope(way, along)
    return np.maximum(way * way * (3 - 2 * way), share)


def _envelope(way: FloatArray, along: FloatArray) -> FloatArray:
    """The least values (n,) no less than these that change by at most 1 in EASE mm."""
    up = np.maximum.accumulate(way + along / EASE) - along / EASE
    down = np.maximum.accumulate((way - along / EASE)[::-1])[::-1] + along / EASE
    return np.asarray(np.maximum(np.maximum(up, down), 0.0))
