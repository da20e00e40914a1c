"""Faceted paths become smooth ones: the least bending of tool axes and of tips that cones and balls about them allow.

What costs a machine time are jumps in the rates at which its joints move along the path. So the axes sought have the
least integral of squared second derivatives by path length, each within a cone about the one it replaces, and so have
the points, each within a ball. The constraint is a weight: at the answer every row is held by a spring towards its
middle, of no force inside and of whatever force it takes on the edge (Karush-Kuhn-Tucker). Rounds of a banded linear
solve stiffen the springs of rows that are outside and slacken those inside; a last step inwards makes it exact.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_slicer.nonplanar.project import Lifted

ROUNDS = 60
"""Rounds of springs made stiffer or slacker; after that many an axis is a few hundredths of its cone off the best."""
SPACING = 0.2
"""mm. Rows are no farther apart while and after paths are smoothed, so that a turn is not a polygon of few corners."""
FAIRING = 0.004
"""mm. How far smoothing may move the tip: as little as thinning (`project.CHORD`) does, less than any printer shows."""
SHORTEST = 0.02
"""mm. Pieces shorter than this count as this long: what turns within them is not the curve's bending."""
CORNER = 0.02
"""What bending at a sharp corner of the path counts, as a share of that on a straight: the tip slows down anyway."""
REACH = 4.0
"""mm. Springs start so soft that an axis listens to the path this far on both sides."""
OVERLAP = 12.0
"""mm. A closed path is smoothed with this much of itself again before and behind, and so has no ends."""
INSIDE = 0.98
"""Share of the cone that is aimed at, so that the last step has next to nothing to do."""
SOFTEST, STIFFEST = 1e-1, 1e5
"""Bounds of the springs, as factors on what they start with."""


def smoothed(points: FloatArray, axes: FloatArray, starts: IntArray, tolerance: float) -> FloatArray:
    """Axes (n, 3) unit that turn as evenly along paths as cones of `tolerance` rad about the given ones let them.

    points (n, 3) mm; path i is rows starts[i] : starts[i + 1]; a path that ends where it starts is closed. Around
    corners of the path, at which the tip slows down anyway, evenness counts less. With a tolerance of 0, or fewer
    than three rows, the axes are returned as they are. Costs ROUNDS banded solves of all rows, some 5 us a row in all.
    """
    if tolerance <= 0 or len(points) < 3:
        return axes
    return _into_cone(_least_bending(points, axes, starts, tolerance, unit=True), axes, tolerance)


def faired(points: FloatArray, starts: IntArray) -> FloatArray:
    """Points (n, 3) mm, each at most FAIRING from the one it replaces, on paths that bend as evenly as that allows.

    Paths as in `smoothed`; their corners, which are meant, stay corners.
    """
    if len(points) < 3:
        return points
    moved = _least_bending(points, points, starts, FAIRING, unit=False) - points
    size = np.linalg.norm(moved, axis=1, keepdims=True)
    return np.asarray(points + moved * np.minimum(1.0, FAIRING / np.maximum(size, 1e-300)))


def refined(lifted: Lifted) -> Lifted:
    """The same paths with rows at most SPACING apart, what is laid on each piece shared out evenly."""
    length = np.linalg.norm(np.diff(lifted.points, axis=0), axis=1)
    parts = np.ones(len(lifted.points), np.int64)
    parts[1:] = np.maximum(np.ceil(length / SPACING), 1)
    parts[lifted.starts[:-1]] = 1
    row = np.repeat(np.arange(len(parts)), parts)
    end = np.cumsum(parts)
    share = (np.arange(len(row)) - (end - parts)[row] + 1) / parts[row]
    before = np.maximum(row - 1, 0)

    def between(values: FloatArray) -> FloatArray:
        middle = values[before] + share[:, None] * (values[row] - values[before])
        return np.where(share[:, None] < 1, middle, values[row])

    axes = between(lifted.axes)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axes[share == 1] = lifted.axes[row[share == 1]]
    starts = np.concatenate([[0], end])[lifted.starts]
    return Lifted(between(lifted.points), axes, (lifted.volume / parts)[row], (lifted.run / parts)[row], starts)


def _least_bending(
    points: FloatArray, values: FloatArray, starts: IntArray, tolerance: float, *, unit: bool
) -> FloatArray:
    """Values (n, 3), unit vectors if `unit`, that bend least while next to `tolerance` from those given."""
    rows, starts_in, mine, twin, share = _unrolled(points, starts)
    centres = values[rows]
    band = _bending(points[rows], starts_in)
    springs = soft = np.full(len(rows), REACH**-4) * _spans(points[rows], starts_in)
    now = centres
    for _ in range(ROUNDS):
        total = band.copy()
        total[2] += springs
        now = centres + solveh_banded(total, -_banded(band, centres), check_finite=False)
        if unit:
            now /= np.linalg.norm(now, axis=1, keepdims=True)
        off = np.linalg.norm(now - centres, axis=1)
        springs = np.clip(springs * np.clip(off / (INSIDE * tolerance), 0.3, 3.0), SOFTEST * soft, STIFFEST * soft)
    result = share[:, None] * now[mine] + (1 - share[:, None]) * now[twin]
    return result / np.linalg.norm(result, axis=1, keepdims=True) if unit else result


def _unrolled(points: FloatArray, starts: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]:
    """Rows to smooth, closed paths with OVERLAP more at both ends, and their starts.

    For every row that was given also: where it is among them, where once more (the same place where nowhere), and the
    first one's share, which falls to a half at the seam of a closed path, so that both sides of the seam agree.
    """
    pieces, new_starts, count = [], [0], 0
    mine, twin, share = np.arange(len(points)), np.arange(len(points)), np.ones(len(points))
    for a, b in pairwise(starts):
        own = np.arange(a, b)
        before = behind = own[:0]
        if b - a > 3 and (points[a] == points[b - 1]).all():
            along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[a:b], axis=0), axis=1))])
            overlap = min(OVERLAP, 0.5 * along[-1])
            head, left = own[1:-1][along[1:-1] < overlap], along[-1] - along
            tail = own[1:-1][left[1:-1] < overlap]
            before, behind = tail, head
            first = count + len(before)
            last = first + len(own) - 1
            for near, at, distance in ((head, last + 1, along[head - a]), (tail, count, left[tail - a])):
                twin[near] = at + np.arange(len(near))
                share[near] = 0.5 + 0.5 * distance / overlap
            twin[a], twin[b - 1] = last, first
            share[a] = share[b - 1] = 0.5
        mine[a:b] = count + len(before) + np.arange(len(own))
        twin[a:b] = np.where(share[a:b] < 1, twin[a:b], mine[a:b])
        pieces += [before, own, behind]
        count += len(before) + len(own) + len(behind)
        new_starts.append(count)
    return np.concatenate(pieces), np.array(new_starts, dtype=np.int64), mine, twin, share


def _lengths(points: FloatArray, starts: IntArray) -> FloatArray:
    """(n - 1,) mm of every piece; inf between two paths."""
    length = np.maximum(np.linalg.norm(np.diff(points, axis=0), axis=1), SHORTEST)
    length[starts[1:-1] - 1] = np.inf
    return np.asarray(length)


def _spans(points: FloatArray, starts: IntArray) -> FloatArray:
    """(n,) mm of path that each row stands for."""
    length = _lengths(points, starts)
    length[~np.isfinite(length)] = 0.0
    return np.asarray(0.5 * (np.append(length, 0.0) + np.insert(length, 0, 0.0)) + SHORTEST)


def _bending(points: FloatArray, starts: IntArray) -> FloatArray:
    """(3, n) the upper band, as solveh_banded wants it, of the integral of squared second derivatives."""
    n = len(points)
    length = _lengths(points, starts)
    ahead, back = 1 / length[1:], 1 / length[:-1]
    span = 0.5 * (length[1:] + length[:-1])
    step = np.diff(points, axis=0) / length[:, None]
    straight = 0.5 * (1 + np.clip((step[1:] * step[:-1]).sum(axis=1), -1, 1))
    inner: NDArray[np.bool_] = np.isfinite(span)
    weight = np.where(inner, (CORNER + straight**4) / np.where(inner, span, 1.0), 0.0)
    middle = -(ahead + back)
    band = np.zeros((3, n))
    band[2, :-2] += weight * back**2
    band[2, 1:-1] += weight * middle**2
    band[2, 2:] += weight * ahead**2
    band[1, 1:-1] += weight * back * middle
    band[1, 2:] += weight * middle * ahead
    band[0, 2:] += weight * back * ahead
    return band


def _banded(band: FloatArray, values: FloatArray) -> FloatArray:
    """The symmetric matrix of that upper band times values (n, 3)."""
    product = band[2][:, None] * values
    for offset in (1, 2):
        side = band[2 - offset, offset:, None]
        product[:-offset] += side * values[offset:]
        product[offset:] += side * values[:-offset]
    return np.asarray(product)


def _into_cone(axes: FloatArray, centres: FloatArray, tolerance: float) -> FloatArray:
    """Axes moved along great circles to within `tolerance` rad of their centres."""
    cosine = np.clip((axes * centres).sum(axis=1, keepdims=True), -1.0, 1.0)
    side = axes - cosine * centres
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300)
    on_edge = np.cos(tolerance) * centres + np.sin(tolerance) * side
    return np.where(cosine < np.cos(tolerance), on_edge, axes)
