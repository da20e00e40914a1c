"""Plane centre lines become beads: the same width, height and upright tool all along."""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.layers import Bead
from trunnion_core.roles import Role


def flat_bead(line: FloatArray, z: float, width: float | FloatArray, height: float, role: Role) -> Bead:
    """A bead over `line` (n, 2) mm, `width` mm wide or (n,), whose upper surface lies at `z`; the tool is upright."""
    n = len(line)
    return Bead(
        points=np.column_stack([line, np.full(n, z)]),
        tool_axes=np.tile([0.0, 0.0, 1.0], (n, 1)),
        width=np.full(n, width),
        height=np.full(n, height),
        role=role,
    )


def reversed_bead(bead: Bead) -> Bead:
    """The same bead laid from its end to its start."""
    rows = np.arange(len(bead.points))[::-1]
    pieces = np.concatenate([[rows[0]], rows[:-1]])  # the piece that ends at point j began at point j - 1
    return Bead(bead.points[rows], bead.tool_axes[rows], bead.width[pieces], bead.height[pieces], bead.role)


def started_at(bead: Bead, place: FloatArray) -> Bead:
    """A closed bead that starts and ends at its point nearest to `place` (3,) mm, a new one if need be."""
    points = bead.points
    step = np.diff(points, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-18)
    share = np.clip(((place - points[:-1]) * step).sum(axis=1) / square, 0.0, 1.0)
    feet = points[:-1] + share[:, None] * step
    piece = int(((feet - place) ** 2).sum(axis=1).argmin())
    length = float(np.sqrt(square[piece]))
    if share[piece] * length < CLOSE_TO_POINT:
        return _rolled(bead, piece)
    if (1 - share[piece]) * length < CLOSE_TO_POINT:
        return _rolled(bead, piece + 1)
    axis = (1 - share[piece]) * bead.tool_axes[piece] + share[piece] * bead.tool_axes[piece + 1]
    split = Bead(
        np.insert(points, piece + 1, feet[piece], axis=0),
        np.insert(bead.tool_axes, piece + 1, axis / np.linalg.norm(axis), axis=0),
        np.insert(bead.width, piece + 1, bead.width[piece + 1]),
        np.insert(bead.height, piece + 1, bead.height[piece + 1]),
        bead.role,
    )
    return _rolled(split, piece + 1)


CLOSE_TO_POINT = 0.2
"""mm. A loop starts at a point it has rather than at a new one when it has one this near."""


def _rolled(bead: Bead, start: int) -> Bead:
    """A closed bead begun at its point `start`."""
    last = len(bead.points) - 1
    rows = np.concatenate([np.arange(start % last, last + 1), np.arange(1, start % last + 1)])
    pieces = np.concatenate([rows[1:2], rows[1:]])
    return Bead(bead.points[rows], bead.tool_axes[rows], bead.width[pieces], bead.height[pieces], bead.role)
