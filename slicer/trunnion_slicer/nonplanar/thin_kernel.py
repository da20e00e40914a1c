"""Which points of paths matter: Douglas and Peucker's algorithm over position, tool axis and thickness at once."""

from typing import Any

import numpy as np
from numba import njit


@njit(cache=True)
def thinned(
    points: Any, axes: Any, density: Any, starts: Any, chord: float, axis_chord: float, share: float, shortest: float
) -> Any:
    """(n,) whether a row stays. Ends of paths always do.

    A row between two that stay may be off the straight line between them by `chord` mm, its axis off the evenly
    turning one by `axis_chord`, its density by `share` of itself. Of rows closer than `shortest` mm the later goes.
    """
    keep = np.zeros(len(points), np.bool_)
    stack = np.empty((len(points) + 2, 2), np.int64)
    for path in range(len(starts) - 1):
        first, last = starts[path], starts[path + 1] - 1
        if last < first:
            continue
        keep[first] = True
        keep[last] = True
        depth = 1
        stack[0, 0], stack[0, 1] = first, last
        while depth > 0:
            depth -= 1
            a, b = stack[depth]
            worst, place = 1.0, -1
            step = points[b] - points[a]
            length = step @ step
            for i in range(a + 1, b):
                off = points[i] - points[a]
                t = min(max((off @ step) / length, 0.0), 1.0) if length > 0 else 0.0
                miss = np.sqrt(((off - t * step) ** 2).sum()) / chord
                turn = axes[i] - (1 - t) * axes[a] - t * axes[b]
                miss = max(miss, np.sqrt((turn**2).sum()) / axis_chord)
                expected = (1 - t) * density[a] + t * density[b]
                miss = max(miss, abs(density[i] - expected) / (share * abs(density[i]) + 1e-12))
                if miss > worst:
                    worst, place = miss, i
            if place >= 0:
                keep[place] = True
                stack[depth, 0], stack[depth, 1] = a, place
                stack[depth + 1, 0], stack[depth + 1, 1] = place, b
                depth += 2
        previous = first
        for i in range(first + 1, last):
            if keep[i]:
                near = ((points[i] - points[previous]) ** 2).sum() < shortest**2
                if near or (((points[i] - points[last]) ** 2).sum() < shortest**2 and i + 1 == last):
                    keep[i] = False
                else:
                    previous = i
    return keep
