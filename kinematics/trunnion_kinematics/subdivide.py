"""A joint path to one whose joint-linear pieces follow the tool path: rows inserted until the chord error is small.

Firmware without tool-centre-point control moves all joints linearly between two rows, so the tip bows and the tool
leaves the great circle between its two directions. Pieces are halved until the exact forward map, sampled inside every
piece, stays within the tolerances; their length is never taken as a measure.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, freeze
from trunnion_kinematics.chain import JointChain

DEFAULT_AXIS_TOLERANCE = np.radians(0.1)
"""rad. A nozzle flat of 1 mm dips 2 um at such an error, less than any machine repeats."""

SAMPLES = (0.25, 0.5, 0.75)
"""Where pieces are looked at; the bow of a short piece is a parabola, that of a seam between branches an S."""

DEEPEST = 16
"""Halvings at most: 65536 pieces a row."""

STILL = 1e-12
"""rad. With the rotaries so still, joint-linear is straight."""

POLE_ANGLE = 1e-8
"""rad to the pole below which rotary 1 is interpolated, not solved for."""

MARGIN = 0.02
"""rad. How far rotary 1, solved in the middle of a piece, may lie outside its two ends and still belong to them; not at
all on a piece that crosses between branches, or halving would creep round the pole to a turn by half a circle."""


@dataclass(frozen=True, eq=False)
class Subdivision:
    """A denser path. Every row of the old one is a row of it, unchanged, and the last with its source."""

    points: FloatArray
    """(m, 3) mm, `part`; inserted ones lie on the straight line."""
    tool_axes: FloatArray
    """(m, 3) unit, `part`; inserted ones lie on the great circle."""
    joints: FloatArray
    """(m, k) mm and rad, exact for points and tool_axes."""
    source: IntArray
    """(m,) old row whose motion the row is a part of."""

    def __post_init__(self) -> None:
        freeze(self.points, self.tool_axes, self.joints, self.source)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Ends of the pieces still looked at: fields of the first end, of the second, and where in which row they lie."""

    points: FloatArray
    """(2, n, 3)."""
    tool_axes: FloatArray
    """(2, n, 3)."""
    joints: FloatArray
    """(2, n, k)."""
    at: FloatArray
    """(2, n) fraction of the row's motion."""
    source: IntArray
    """(n,)."""


def subdivide(
    chain: JointChain,
    points: FloatArray,
    tool_axes: FloatArray,
    joints: FloatArray,
    tolerance: float,
    *,
    axis_tolerance: float = DEFAULT_AXIS_TOLERANCE,
    rewinds: IntArray | None = None,
) -> Subdivision:
    """Insert rows until every joint-linear piece keeps the tip and the tool where they should be.

    points (n, 3) mm, tool_axes (n, 3) unit in `part` and joints (n, k) that reach them, as `branches.choose` gives
    them; tolerance in mm between tip and straight line, axis_tolerance in rad between tool and great circle; rows in
    rewinds stay whole. Inserted rows stay on the branch and winding of their ends. Where a path crosses between
    branches beside the pole, the tool cannot follow the great circle; there the rotaries are interpolated, the tip
    stays exact, and tool_axes says where the tool goes.
    """
    n = len(points)
    whole = Subdivision(np.array(points), np.array(tool_axes), np.array(joints), np.arange(n))
    if n < 2 or not chain.rotary.size:
        return whole
    turning = np.abs(np.diff(joints[:, chain.rotary], axis=0)).max(axis=1) > STILL
    if rewinds is not None:
        turning[rewinds[rewinds > 0] - 1] = False
    last = np.flatnonzero(turning) + 1
    pieces = _Pieces(
        np.stack([points[last - 1], points[last]]),
        np.stack([tool_axes[last - 1], tool_axes[last]]),
        np.stack([joints[last - 1], joints[last]]),
        np.stack([np.zeros(len(last)), np.ones(len(last))]),
        last,
    )
    found = []
    for _ in range(DEEPEST):
        bent = _bent(chain, pieces, tolerance, axis_tolerance)
        if not bent.any():
            break
        pieces, inserted = _halved(chain, pieces, bent)
        found.append(inserted)
    if not found:
        return whole
    source = np.concatenate([whole.source, *(rows.source for rows in found)])
    at = np.concatenate([np.ones(n), *(rows.at[1] for rows in found)])
    order = np.lexsort((at, source))
    return Subdivision(
        np.concatenate([whole.points, *(rows.points[1] for rows in found)])[order],
        np.concatenate([whole.tool_axes, *(rows.tool_axes[1] for rows in found)])[order],
        np.concatenate([whole.joints, *(rows.joints[1] for rows in found)])[order],
        source[order],
    )


def _bent(chain: JointChain, pieces: _Pieces, tolerance: float, axis_tolerance: float) -> BoolArray:
    """(n,) whether a piece strays too far at one of the samples."""
    result = np.zeros(len(pieces.source), dtype=np.bool_)
    for t in SAMPLES:
        points, tool_axes = chain.forward(pieces.joints[0] * (1 - t) + pieces.joints[1] * t)
        middle = great_circle(pieces.tool_axes[0], pieces.tool_axes[1], t)
        result |= from_segment(points, pieces.points[0], pieces.points[1]) > tolerance
        result |= np.linalg.norm(tool_axes - middle, axis=1) > axis_tolerance
    return result


def _halved(chain: JointChain, pieces: _Pieces, bent: BoolArray) -> tuple[_Pieces, _Pieces]:
    """The halves of the bent pieces, and their first halves alone, whose second ends are the inserted rows."""
    points = pieces.points[:, bent].mean(axis=0)
    tool_axes = great_circle(pieces.tool_axes[0, bent], pieces.tool_axes[1, bent], 0.5)
    joints, tool_axes = _middle_joints(chain, points, tool_axes, pieces.joints[:, bent])
    at, source = pieces.at[:, bent].mean(axis=0), pieces.source[bent]
    middle = (points, tool_axes, joints, at)
    ends = (pieces.points[:, bent], pieces.tool_axes[:, bent], pieces.joints[:, bent], pieces.at[:, bent])
    left = [np.stack([end[0], new]) for end, new in zip(ends, middle, strict=True)]
    right = [np.stack([new, end[1]]) for end, new in zip(ends, middle, strict=True)]
    both = [np.concatenate([one, other], axis=1) for one, other in zip(left, right, strict=True)]
    return _pieces(both, np.tile(source, 2)), _pieces(left, source)


def _pieces(fields: list[FloatArray], source: IntArray) -> _Pieces:
    points, tool_axes, joints, at = fields
    return _Pieces(points, tool_axes, joints, at, source)


def _middle_joints(
    chain: JointChain, points: FloatArray, tool_axes: FloatArray, ends: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Joints (n, k) for the pose in the middle of two ends (2, n, k), and the tool axes that they give."""
    guide = ends.mean(axis=0)
    rotary = chain.rotary
    solutions = chain.inverse(points, tool_axes)
    turns = solutions[:, :, rotary]
    turns += 2 * np.pi * np.rint((guide[:, rotary] - turns) / (2 * np.pi))
    solutions[:, :, rotary] = turns
    away = np.abs(turns - guide[:, rotary]).sum(axis=2)
    away[np.isnan(away)] = np.inf
    joints = np.where((away[1] < away[0])[:, None], solutions[1], solutions[0])
    first = ends[:, :, rotary[0]]
    low, high = first.min(axis=0), first.max(axis=0)
    pole = turns[:, :, 1].mean(axis=0)
    crossing = ((ends[:, :, rotary[1]] - pole) > 0).sum(axis=0) == 1
    margin = np.where(crossing, 0.0, MARGIN + 0.25 * (high - low))
    belongs = (joints[:, rotary[0]] >= low - margin) & (joints[:, rotary[0]] <= high + margin)
    belongs &= chain.pole_sine(tool_axes) > POLE_ANGLE
    other = ~belongs
    joints[other] = chain.at_angles(points[other], guide[other][:, rotary])
    tool_axes[other] = chain.forward(joints[other])[1]
    return joints, tool_axes


def from_segment(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(n,) mm between points and the straight segments from start to end, all (n, 3)."""
    way = end - start
    length = np.maximum(np.einsum("ni,ni->n", way, way), 1e-300)
    t = np.clip(np.einsum("ni,ni->n", points - start, way) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - t[:, None] * way, axis=1))


def great_circle(start: FloatArray, end: FloatArray, t: float) -> FloatArray:
    """(n, 3) unit vectors a fraction t along the great circles from start to end (n, 3)."""
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(end - start, axis=1) / 2, 0, 1))
    angle = np.maximum(angle, 1e-12)[:, None]
    between = (np.sin((1 - t) * angle) * start + np.sin(t * angle) * end) / np.sin(angle)
    return np.asarray(between / np.linalg.norm(between, axis=1, keepdims=True))
