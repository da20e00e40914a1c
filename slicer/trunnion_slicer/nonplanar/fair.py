"""Faceted paths become fair ones: the least bending of the tip's way that a ball of a few microns about it allows.

The constraint is a weight: at the answer every row is held by a spring towards its middle, of no force inside and of
whatever force it takes on the edge (Karush-Kuhn-Tucker). Rounds of a banded linear solve stiffen the springs of rows
that are outside and slacken those inside; a last step inwards makes it exact.
"""

import numpy as np
from scipy.linalg import solveh_banded

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_slicer.nonplanar.bending import banded, bending, spans, unrolled
from trunnion_slicer.nonplanar.project import Lifted

FAIRING = 0.004
"""mm. How far smoothing may move the tip: as little as thinning (`project.CHORD`) does, less than any printer shows."""
SPACING = 0.2
"""mm. Rows are no farther apart while and after paths are smoothed, so that a turn is not a polygon of few corners."""
ROUNDS = 60
"""Rounds of springs made stiffer or slacker; after that many a row is a few hundredths of its ball off the best."""
REACH = 4.0
"""mm. Springs start so soft that a row listens to the path this far on both sides."""
INSIDE = 0.98
"""Share of the ball that is aimed at, so that the last step has next to nothing to do."""
SOFTEST, STIFFEST = 1e-1, 1e5
"""Bounds of the springs, as factors on what they start with."""


def faired(points: FloatArray, starts: IntArray) -> FloatArray:
    """Points (n, 3) mm, each at most FAIRING from the one it replaces, on paths that bend as evenly as that allows.

    Path i is rows starts[i] : starts[i + 1]; one that ends where it starts is closed. Corners, which are meant, stay
    corners. Costs ROUNDS banded solves of all rows, some 15 us a row in all.
    """
    if len(points) < 3:
        return points
    all_rows = unrolled(points, starts)
    centres = points[all_rows.rows]
    band = bending(centres, all_rows.starts)
    force = -banded(band, centres)
    springs = soft = REACH**-4 * spans(centres, all_rows.starts)
    moved = np.zeros_like(centres)
    for _ in range(ROUNDS):
        total = band.copy()
        total[2] += springs
        moved = solveh_banded(total, force, check_finite=False)
        off = np.linalg.norm(moved, axis=1)
        springs = np.clip(springs * np.clip(off / (INSIDE * FAIRING), 0.3, 3.0), SOFTEST * soft, STIFFEST * soft)
    moved = all_rows.merged(moved)
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
