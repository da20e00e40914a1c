"""Find a shift and a turn on the bed at which a machine can take all poses of a part.

The rotaries follow from a pose's direction alone and the linear joints are affine in the shift, so for each turn three
inverse solutions say everything about every shift. The grid of shifts is looked at for a few extreme poses; what is
left is tried on all poses, and poses that fail join the few until a place holds or none is left. So a place is found
whenever trying every grid place with every pose would find one.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.errors import PlacementError
from trunnion_core.profile import MachineProfile
from trunnion_kinematics.chain import JointChain
from trunnion_motion.fit import Poses, fits, joint_states, limit_excess, over_bed

SHIFT_STEP = 5.0
"""mm between the shifts that are tried."""
TURN_STEP_DEG = 5
"""Degrees between the turns that are tried; divides 360."""
_FIRST_LOOK = 26
"""Directions in which the most extreme points are looked at first."""


@dataclass(frozen=True, eq=False)
class Placement:
    """Turn the part about the vertical through `center`, then shift it."""

    turn_deg: float
    shift: tuple[float, float]
    """mm."""
    center: tuple[float, float]
    """mm: the middle of the poses' extent, before the turn."""

    def of(self, poses: Poses) -> Poses:
        """The poses where this puts them."""
        return _placed(poses, np.array(self.center), self.turn_deg, np.array(self.shift))


def place(poses: Poses, profile: MachineProfile) -> Placement:
    """The least turn, and for it the least shift, on the grid at which `fits` holds.

    The grid: shifts in SHIFT_STEP along x and y from where the part stands, turns in TURN_STEP_DEG. Raises
    PlacementError where no place holds, saying which joint gives up where: as the part stands, or in the middle of the
    bed if it stands beside it. No poses fit as they are.
    """
    if not len(poses.points):
        return Placement(0.0, (0.0, 0.0), (0.0, 0.0))
    chain = JointChain.from_profile(profile)
    low, high = poses.points[:, :2].min(axis=0), poses.points[:, :2].max(axis=0)
    center = (low + high) / 2
    few = _extremes(poses)
    shifts = _shifts(center, profile)
    turns = sorted(range(-180 + TURN_STEP_DEG, 181, TURN_STEP_DEG), key=lambda turn: (abs(turn), -turn))
    for turn in turns:
        turned = _placed(poses, center, turn, np.zeros(2))
        left = shifts
        while len(left):
            some = Poses(turned.points[few], turned.tool_axes[few])
            left = left[_possible(chain, profile, some, left)]
            if not len(left):
                break
            failing = _failing(chain, profile, turned, left[0])
            if not failing.size:
                x, y = (float(value) for value in left[0])
                return Placement(float(turn), (x, y), (float(center[0]), float(center[1])))
            few = np.union1d(few, failing)
    where, stands = "as it stands", poses
    if not over_bed(poses.points, profile).all():
        where, stands = "in the middle of the bed", _placed(poses, center, 0.0, -center)
    reasons = "; ".join(finding.message for finding in fits(stands, profile).findings)
    raise PlacementError(
        f"the part does not fit {profile.name} at any shift (every {SHIFT_STEP:g} mm) and turn (every {TURN_STEP_DEG} "
        f"degrees); {where}: {reasons}"
    )


def _placed(poses: Poses, center: FloatArray, turn_deg: float, shift: FloatArray) -> Poses:
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    pivot, step = np.append(center, 0.0), np.append(shift, 0.0)
    return Poses((poses.points - pivot) @ matrix.T + (pivot + step), poses.tool_axes @ matrix.T)


def _shifts(center: FloatArray, profile: MachineProfile) -> FloatArray:
    """(m, 2) shifts that keep the center over the bed, shortest first."""
    bed = profile.bed
    if bed.min is not None and bed.max is not None:
        low, high = np.array(bed.min), np.array(bed.max)
    else:
        high = np.full(2, 0.5 * (bed.diameter or 0.0))
        low = -high
    sides = [
        SHIFT_STEP
        * np.arange(np.ceil((low[k] - center[k]) / SHIFT_STEP), np.floor((high[k] - center[k]) / SHIFT_STEP) + 1)
        for k in range(2)
    ]
    grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(grid[np.argsort(np.hypot(*grid.T), kind="stable")])


def _extremes(poses: Poses) -> IntArray:
    """Rows of the poses that stick out furthest: of the tip, and of the tool a hand's breadth up, each way."""
    number = np.arange(_FIRST_LOOK) + 0.5
    z = 1 - 2 * number / _FIRST_LOOK
    around = number * np.pi * (1 + np.sqrt(5))
    r = np.sqrt(1 - z**2)
    ways = np.stack([r * np.cos(around), r * np.sin(around), z], axis=1)
    reach = np.stack([poses.points, poses.points + 80 * poses.tool_axes])
    found = [np.argmax(place @ ways.T, axis=0) for place in reach]
    return np.unique(np.concatenate([*found, np.argmax(poses.tool_axes @ ways.T, axis=0)]))


def _possible(chain: JointChain, profile: MachineProfile, poses: Poses, shifts: FloatArray) -> BoolArray:
    """(m,) which shifts keep all of a few poses inside the limits and over the bed."""
    alive = np.ones(len(shifts), dtype=np.bool_)
    for point in poses.points:
        moved = np.column_stack([point[:2] + shifts, np.full(len(shifts), point[2])])
        alive &= over_bed(moved, profile)
    here, right, behind = (
        joint_states(chain, Poses(poses.points + np.array(step), poses.tool_axes))
        for step in ([0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0])
    )
    for row in range(len(poses.points)):
        rows = np.flatnonzero(alive)
        if not rows.size:
            break
        dx, dy = shifts[rows, 0], shifts[rows, 1]
        origin = here[:, row, None, :]
        states = (
            origin + dx[:, None] * (right[:, row, None, :] - origin) + dy[:, None] * (behind[:, row, None, :] - origin)
        )
        alive[rows] = (limit_excess(states, profile).max(axis=2) <= 0).any(axis=0)
    return alive


def _failing(chain: JointChain, profile: MachineProfile, turned: Poses, shift: FloatArray) -> IntArray:
    """A few rows that fail at this shift: the worst of every joint, or the furthest off the bed; none if it fits."""
    poses = Poses(turned.points + np.append(shift, 0.0), turned.tool_axes)
    outside = np.flatnonzero(~over_bed(poses.points, profile))
    if outside.size:
        return outside[[int(np.argmax(np.hypot(*poses.points[outside, :2].T)))]]
    excess = limit_excess(joint_states(chain, poses), profile)
    best = excess[np.argmin(excess.max(axis=2), axis=0), np.arange(len(poses.points))]
    failing = best.max(axis=1) > 0
    return np.unique(np.argmax(best, axis=0)) if failing.any() else np.empty(0, dtype=np.int64)
