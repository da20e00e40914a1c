"""Paths become the matrix of their bending: the integral of squared second derivatives along all of them at once.

What costs a machine time are jumps in the rates at which things change along the path, so what is sought along paths
(`smooth`, `fair`) has the least such integral. It is a quadratic form that couples each row with two on either side:
five diagonals, kept as the upper three.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import FloatArray, IntArray

SHORTEST = 0.02
"""mm. Pieces shorter than this count as this long: what turns within them is not the curve's bending."""
CORNER = 0.02
"""What bending at a sharp corner of the path counts, as a share of that on a straight: the tip slows down anyway."""
OVERLAP = 12.0
"""mm. A closed path is smoothed with this much of itself again before and behind, and so has no ends."""


@dataclass(frozen=True, eq=False)
class Unrolled:
    """Rows to smooth, closed paths with OVERLAP more at both ends, and where the rows that were given are in them."""

    rows: IntArray
    """(m,) rows as given."""
    starts: IntArray
    """(paths + 1,) path i is rows starts[i] : starts[i + 1] of these."""
    mine: IntArray
    """(n,) where every row that was given is."""
    twin: IntArray
    """(n,) where it is once more; the same place where nowhere."""
    share: FloatArray
    """(n,) the first one's share, which falls to a half at the seam of a closed path, so that its sides agree."""

    def merged(self, values: FloatArray) -> FloatArray:
        """(n, 3) values of the rows that were given, from those (m, 3) of all."""
        share = self.share[:, None]
        return np.asarray(share * values[self.mine] + (1 - share) * values[self.twin])


def unrolled(points: FloatArray, starts: IntArray) -> Unrolled:
    """Paths starts[i] : starts[i + 1] over points (n, 3) mm; one that ends where it starts is closed."""
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
    return Unrolled(np.concatenate(pieces), np.array(new_starts, dtype=np.int64), mine, twin, share)


def spans(points: FloatArray, starts: IntArray) -> FloatArray:
    """(n,) mm of path that each row stands for."""
    length = _lengths(points, starts)
    length[~np.isfinite(length)] = 0.0
    return np.asarray(0.5 * (np.append(length, 0.0) + np.insert(length, 0, 0.0)) + SHORTEST)


def bending(points: FloatArray, starts: IntArray) -> FloatArray:
    """(3, n) the upper band, as solveh_banded wants it, of the integral of squared second derivatives.

    Around corners of the path, at which the tip slows down anyway, it counts less.
    """
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


def banded(band: FloatArray, values: FloatArray) -> FloatArray:
    """The symmetric matrix of that upper band times values (n,) or (n, k)."""
    band = band.reshape(3, -1, *(1,) * (values.ndim - 1))
    product = band[2] * values
    for offset in (1, 2):
        side = band[2 - offset, offset:]
        product[:-offset] += side * values[offset:]
        product[offset:] += side * values[:-offset]
    return np.asarray(product)


def _lengths(points: FloatArray, starts: IntArray) -> FloatArray:
    """(n - 1,) mm of every piece; inf between two paths."""
    length = np.maximum(np.linalg.norm(np.diff(points, axis=0), axis=1), SHORTEST)
    length[starts[1:-1] - 1] = np.inf
    return np.asarray(length)
