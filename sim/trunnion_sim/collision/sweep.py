"""Walk through a program's motion and find where bodies of the machine enter each other or what is printed by then.

Between two rows the machine moves linearly in its joints. For every pair of bodies `pairs` carries a proof that they
are apart along the motion, and looks closer where it ends. The part is paired as well, as the box around what is
printed so far; where that is not enough, `field` measures the true heights along the row.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_sim.collision.distance import CONTACT
from trunnion_sim.collision.field import FAR, FLOOR, empty_field, enter
from trunnion_sim.collision.material import raise_bead
from trunnion_sim.collision.pairs import approach, make_pairs, touch
from trunnion_sim.collision.scene import Scene
from trunnion_sim.collision.solids import ball_of

CHUNK = 20_000
"""Rows between two collections of hits: what every row keeps for every pair is kept for so many only."""
OVER = 1e-3
"""mm kept around the box of what is printed: heights are held in single precision."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Where bodies enter something: one entry for each row and pair that does."""

    rows: IntArray
    body: IntArray
    """(h,) the body that moves in, as in the scene's names."""
    other: IntArray
    """(h,) what it moves into."""
    depth: FloatArray
    """(h,) mm, the deepest point; 0 where bodies only touch."""
    points: FloatArray
    """(h, 3) mm in `part`: where it is deepest."""
    clearance: float
    """mm: the smallest distance from what is printed that was measured; infinite where nothing ever came near."""
    poses: int
    """How many poses of a pair were looked at."""


def sweep(
    scene: Scene,
    joints: FloatArray,
    tips: FloatArray,
    tool_axes: FloatArray,
    width: FloatArray,
    height: FloatArray,
    checked: BoolArray,
    first: tuple[FloatArray, FloatArray, FloatArray] | None = None,
) -> Hits:
    """Hits along joints (n, k): row i moves from joints[i-1] to joints[i] and lays a bead where width[i] > 0.

    tips (n, 3) mm and tool_axes (n, 3) in `part` belong to the rows' ends; width, height (n,) mm. Rows that are not
    `checked` (n,) are passed over, such as homing. Row 0 moves from `first` (its joints, tip and tool axis); without
    it, row 0 is only where row 1 starts.
    """
    n, begin = len(joints), 1 if first is None else 0
    start = (joints[:1], tips[:1], tool_axes[:1]) if first is None else tuple(array[None] for array in first)
    field = empty_field(scene.low, scene.high)
    bodies = scene.bodies._replace(
        rows=scene.bodies.rows.copy(), middles=scene.bodies.middles.copy(), radii=scene.bodies.radii.copy()
    )
    box = bodies.rows[scene.part]
    box[1:7] = _all_printed(tips, start[1], width)
    bodies.middles[scene.part], bodies.radii[scene.part] = ball_of(box, bodies.corners)
    reach = np.abs(np.concatenate([start[0], joints])).max(axis=0)
    pairs = make_pairs(scene.pairs, scene.chain, bodies, reach)
    box[1:7] = [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]
    normals, gaps = np.zeros((len(scene.pairs), 3)), np.full(len(scene.pairs), -1.0)
    parts = [(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty((0, 3)))]
    clearance, poses = FAR, 0
    for low in range(begin, n if len(scene.pairs) else 0, CHUNK):
        rows = slice(low, low + CHUNK)
        before = start if low == begin else (joints[low - 1 : low], tips[low - 1 : low], tool_axes[low - 1 : low])
        count = len(joints[rows])
        worst = np.full((count + 1, len(scene.pairs)), FAR)
        where = np.zeros((count + 1, len(scene.pairs), 3))
        near, looked = _sweep(
            np.concatenate([before[0], joints[rows]]),
            np.concatenate([before[1], tips[rows]]),
            np.concatenate([before[2], tool_axes[rows]]),
            np.append(0.0, width[rows]),
            np.append(0.0, height[rows]),
            np.append(False, checked[rows]),
            scene.chain,
            bodies,
            pairs,
            field,
            normals,
            gaps,
            worst,
            where,
        )
        clearance, poses = min(clearance, near), poses + looked
        row, pair = np.nonzero(worst <= 0.0)
        parts.append((row.astype(np.int64) - 1 + low, pair.astype(np.int64), -worst[row, pair], where[row, pair]))
    hit = np.concatenate([part[1] for part in parts])
    return Hits(
        rows=np.concatenate([part[0] for part in parts]),
        body=scene.pairs[hit, 0],
        other=scene.pairs[hit, 1],
        depth=np.concatenate([part[2] for part in parts]),
        points=np.concatenate([part[3] for part in parts]),
        clearance=math.inf if clearance >= FAR else float(clearance),
        poses=int(poses),
    )


def _all_printed(tips: FloatArray, start: FloatArray, width: FloatArray) -> FloatArray:
    """(6,) mm, lowest and highest corner of a box that holds everything that is ever printed."""
    laid = np.flatnonzero(width > 0)
    ends = np.concatenate([tips[laid], np.where((laid > 0)[:, None], tips[laid - 1], start), [[0.0, 0.0, FLOOR]]])
    half = float(width.max(initial=0.0)) + 3 * OVER
    return np.concatenate([ends.min(axis=0) - half, ends.max(axis=0) + half])


@njit(cache=True)
def _sweep(
    joints: Any,
    tips: Any,
    tool_axes: Any,
    width: Any,
    height: Any,
    checked: Any,
    chain: Any,
    bodies: Any,
    pairs: Any,
    field: Any,
    normals: Any,
    gaps: Any,
    worst: Any,
    where: Any,
) -> Any:
    """The loop over rows. Row of `gaps` and `normals`: the gap that a plane proves at the end of the row before.

    Returns (smallest distance from the printed that was measured, poses looked at).
    """
    clearance, poses = FAR, 0
    part = len(bodies.rows) - 1
    box = bodies.rows[part]
    free = np.empty(2)
    for i in range(1, len(joints)):
        if not checked[i]:
            gaps[:] = -1.0
        elif (joints[i] != joints[i - 1]).any():
            for pair in range(len(gaps)):
                printed = pairs.second[pair] == part
                if printed and box[6] < box[3]:
                    continue
                if gaps[pair] >= CONTACT:
                    left = gaps[pair] - approach(joints[i - 1], joints[i], pair, pairs, normals[pair], free)
                    if left >= CONTACT:
                        gaps[pair] = left
                        continue
                gaps[pair], deepest, looked = touch(
                    joints[i - 1],
                    joints[i],
                    pair,
                    pairs,
                    chain,
                    bodies,
                    printed,
                    normals[pair],
                    where[i, pair],
                )
                poses += looked
                if printed and gaps[pair] < CONTACT:
                    deepest, looked = enter(
                        joints[i - 1], joints[i], pairs.first[pair], chain, bodies, field, where[i, pair]
                    )
                    poses += looked
                    clearance = min(clearance, deepest)
                worst[i, pair] = min(worst[i, pair], deepest)
        if width[i] > 0.0:
            raise_bead(field, tips[i - 1], tips[i], tool_axes[i], width[i], height[i])
            grown = _grow(box, tips[i - 1], tips[i], tool_axes[i], width[i])
            if grown > 0.0:
                for pair in range(len(gaps)):
                    if pairs.second[pair] == part:
                        gaps[pair] -= grown
    return clearance, poses


@njit(cache=True)
def _grow(box: Any, start: Any, end: Any, axis: Any, width: Any) -> Any:
    """Let the box around what is printed hold one more bead; at least how far any point of it moved, mm.

    FAR with the first bead. A bead rises to one side by what its upper plane leans across it.
    """
    half = width / 2.0 + OVER
    rise = half * math.hypot(axis[0], axis[1]) + OVER
    top = max(start[2], end[2]) + rise
    if box[6] < box[3]:
        for c in range(2):
            box[1 + c], box[4 + c] = min(start[c], end[c]) - half, max(start[c], end[c]) + half
        box[3], box[6] = FLOOR, max(top, FLOOR)
        return FAR
    grown = 0.0
    for c in range(2):
        low, high = min(start[c], end[c]) - half, max(start[c], end[c]) + half
        grown += max(box[1 + c] - low, 0.0) + max(high - box[4 + c], 0.0)
        box[1 + c], box[4 + c] = min(box[1 + c], low), max(box[4 + c], high)
    grown += max(top - box[6], 0.0)
    box[6] = max(box[6], top)
    return grown
