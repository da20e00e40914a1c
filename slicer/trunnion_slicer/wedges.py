"""Where a line turns back on itself at a sharp angle, its two branches share the room of the wedge between them.

A zig-zag turns along the boundary. Where that runs nearly along the lines, the way to the end of the next line and the
way back lie over each other for millimetres, and two whole beads would go where there is room for one. Both are made
thinner there: `g` mm apart, at a pitch of s, they have room for g + s, so each gets (1 + g / s) / 2 of a bead.
"""

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray

SHARPEST_TURN = np.cos(np.radians(25.0))
"""Branches that leave a turn at less than 25 degrees lie over each other for 2 spacings or more."""

STEPS_A_SPACING = 2
"""How finely the wedge is measured."""

SAME_POINT = 1e-9
"""mm."""

LONGEST = 30.0
"""Spacings. Branches that have not parted after that run beside each other on purpose."""


def shared(line: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """The line (n, 2) mm with points (m, 2) added in wedges, and the share (m,) of a bead on the piece up to each.

    `spacing` in mm is that of two whole beads side by side. Shares are 1 outside of wedges and at least 1/2; the first
    counts for nothing and is the second's.
    """
    line = line[np.append(True, np.linalg.norm(np.diff(line, axis=0), axis=1) > SAME_POINT)]
    if len(line) < 3:
        return line, np.ones(len(line))
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    turns = _turns(line, along)
    if not turns.size:
        return line, np.ones(len(line))
    step = spacing / STEPS_A_SPACING
    table = _shares(line, along, turns, step, spacing)
    way = along[turns]
    ends = np.arange(1, table.shape[1] + 1) * step
    used = table < 1
    cuts = np.concatenate([(way[:, None] + sign * ends)[used] for sign in (1, -1)])
    cuts = _apart(cuts[(cuts > 0) & (cuts < along[-1])], along, step / 2)
    places = np.sort(np.concatenate([along, cuts]))
    points = np.column_stack([np.interp(places, along, line[:, axis]) for axis in (0, 1)])
    middle = (places[1:] + places[:-1]) / 2
    share = np.minimum(
        _looked_up(table, way, middle, np.searchsorted(way, middle) - 1, step),
        _looked_up(table, way, middle, np.searchsorted(way, middle), step),
    )
    return points, np.append(share[:1], share)


def laid_length(line: FloatArray, share: FloatArray) -> float:
    """mm of whole bead that a line (n, 2) mm with shares (n,) amounts to."""
    return float((np.linalg.norm(np.diff(line, axis=0), axis=1) * share[1:]).sum())


def _turns(line: FloatArray, along: FloatArray) -> IntArray:
    """Points at which the line turns back."""
    step = np.diff(line, axis=0) / np.diff(along)[:, None]
    return np.flatnonzero((step[1:] * -step[:-1]).sum(axis=1) > SHARPEST_TURN) + 1


def _shares(line: FloatArray, along: FloatArray, turns: IntArray, step: float, spacing: float) -> FloatArray:
    """(turns, k) share of a bead on both branches, k to k + 1 steps from each turn; 1 from where they have parted."""
    way = along[turns]
    limits = np.concatenate([[0.0], way, [along[-1]]])
    room = np.minimum(way - limits[:-2], limits[2:] - way)
    count = max(1, int(np.ceil(min(float(room.max()), LONGEST * spacing) / step)))
    t = (np.arange(count) + 0.5) * step
    ahead, behind = (
        np.stack([np.interp(way[:, None] + sign * t, along, line[:, axis]) for axis in (0, 1)], axis=2)
        for sign in (1, -1)
    )
    apart = np.linalg.norm(ahead - behind, axis=2) / spacing
    over = (apart >= 1) | (t > room[:, None])
    parted = np.logical_or.accumulate(over, axis=1)
    return np.asarray(np.where(parted, 1.0, (1 + np.minimum(apart, 1)) / 2))


def _apart(cuts: FloatArray, along: FloatArray, least: float) -> FloatArray:
    """The cuts that keep `least` mm from the line's own points and from each other."""
    nearest = np.searchsorted(along, cuts)
    gap = np.minimum(cuts - along[nearest - 1], along[nearest] - cuts)
    cuts = np.sort(cuts[gap > least])
    return cuts[np.diff(cuts, prepend=-np.inf) > least]


def _looked_up(table: FloatArray, way: FloatArray, middle: FloatArray, turn: IntArray, step: float) -> FloatArray:
    """Shares (n,) at `middle` (n,) mm along the line for the turns (n,), 1 where there is no such turn."""
    there = (turn >= 0) & (turn < len(way))
    turn = np.where(there, turn, 0)
    k = (np.abs(middle - way[turn]) / step).astype(np.int64)
    near = there & (k < table.shape[1])
    return np.where(near, table[turn, np.where(near, k, 0)], 1.0)
