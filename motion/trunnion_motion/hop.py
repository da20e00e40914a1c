"""Turn two joint states into a safe way between them: up along the tool, over, down along the tool.

Used where the machine has to turn far without printing: from home to the first point, where a rotary is rewound, where
the machine changes from one joint solution to the other, and to leave the part upright at the end. Over means: the
rotaries turn while the tip stays on a straight line at the clear height; where the linear joints are too short for
that, all joints go straight and the tip is checked to stay high.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_kinematics.chain import JointChain

HOP_CHORD = 0.05
"""mm. How far the tip may leave its straight way over the part at the clear height, where nothing is printed."""
CLEARANCE = 2.0
"""mm between the highest thing printed so far and the tip when the machine turns above it."""
HOME_CLEARANCE = 5.0
"""mm over the bed on the way from home to the first point: more than clips and screws stick out."""
_SHORTER = np.array([1.0, 0.75, 0.5, 0.25, 0.1, 0.0])
_MIN_RISE = 0.2
"""Least vertical part of the tool axis that is trusted to gain height; a flatter tool leaves five times the height."""
_LIMIT_SLACK = 1e-7
"""mm or rad by which a joint may pass its limit: rounding, as in `trunnion_kinematics.reach`."""


@dataclass(frozen=True, eq=False)
class Machine:
    """A profile with what every hop needs of it."""

    profile: MachineProfile
    chain: JointChain
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, profile: MachineProfile, chain: JointChain) -> "Machine":
        """Collect the limits once."""
        return cls(profile, chain, profile.array("min") - _LIMIT_SLACK, profile.array("max") + _LIMIT_SLACK)

    def inside(self, joints: FloatArray) -> bool:
        """Whether every row (n, k) is inside the joints' limits."""
        return bool(((joints >= self.low) & (joints <= self.high)).all())


@dataclass(frozen=True, eq=False)
class Hop:
    """Joint states (n, k) with tips and tool axes (n, 3) in `part`; the last one is where the hop should end."""

    joints: FloatArray
    points: FloatArray
    tool_axes: FloatArray
    clear: bool
    """Whether the tip stayed at the clear height while the machine turned."""


def hop(machine: Machine, start: FloatArray, end: FloatArray, clear_z: float) -> Hop:
    """From joints `start` (k,) to joints `end` (k,), turning with the tip at `clear_z` mm or higher over the part.

    Leaves and returns along the tool axis, as far as the limits allow. Never leaves the limits; where no clear way
    exists the shortest one in joint space is taken and `clear` is False.
    """
    up = leave(machine, start, clear_z)
    down = leave(machine, end, clear_z)
    over, clear = _over(machine, up, down, clear_z)
    joints = np.concatenate([up[None], over, down[None], end[None]])
    before = np.concatenate([start[None], joints[:-1]])
    joints = joints[(joints != before).any(axis=1)]
    if not len(joints):
        joints = end[None]
    points, tool_axes = machine.chain.forward(joints)
    return Hop(joints, points, tool_axes, clear)


def upright(machine: Machine, joints: FloatArray, clear_z: float) -> Hop | None:
    """From joints (k,) up along the tool to `clear_z`, and there the rotaries to zero or whole turns of it.

    With the tip where it is, else over the middle of the bed, else where all joints are at home. None where none of
    these ways is clear.
    """
    profile, chain = machine.profile, machine.chain
    up = leave(machine, joints, clear_z)
    level = up.copy()
    for column in profile.rotary:
        zero = 2 * np.pi * np.round(up[column] / (2 * np.pi))
        level[column] = zero if machine.low[column] <= zero <= machine.high[column] else profile.joints[column].home
    here = chain.forward(up[None])[0][0]
    home = profile.array("home").copy()
    home[list(profile.rotary)] = level[list(profile.rotary)]
    middle = np.array([0.0, 0.0, max(here[2], clear_z)])
    for end in (*_at(chain, np.stack([here, middle]), level), home):
        if machine.inside(end[None]):
            way = hop(machine, joints, end, clear_z)
            if way.clear:
                return way
    return None


def leave(machine: Machine, joints: FloatArray, clear_z: float) -> FloatArray:
    """(k,) joints with the tip drawn back along the tool to `clear_z`, or as far in that direction as limits allow."""
    points, tool_axes = machine.chain.forward(joints[None])
    distance = max(clear_z - points[0, 2], 0.0) / max(tool_axes[0, 2], _MIN_RISE)
    if distance <= 0:
        return joints
    candidates = _at(machine.chain, points + distance * _SHORTER[:, None] * tool_axes, joints)
    fits = ((candidates >= machine.low) & (candidates <= machine.high)).all(axis=1)
    return candidates[int(np.argmax(fits))] if fits.any() else joints


def same_pose_near(machine: Machine, joints: FloatArray, near: FloatArray) -> FloatArray:
    """(k,) the joint state inside the limits that makes the same pose as `joints` and is nearest to `near`.

    Looks at every branch and winding; nearest by the slowest joint's time.
    """
    points, tool_axes = machine.chain.forward(joints[None])
    found = machine.chain.inverse(points, tool_axes)[:, 0]
    found = np.concatenate([found[np.isfinite(found).all(axis=1)], joints[None]])
    for column in machine.profile.rotary:
        turns = np.round((near[column] - found[:, column]) / (2 * np.pi))[:, None] + np.arange(-1, 2)
        found = np.repeat(found, 3, axis=0)
        found[:, column] += 2 * np.pi * turns.ravel()
    found = found[((found >= machine.low) & (found <= machine.high)).all(axis=1)]
    cost = np.max(np.abs(found - near) / machine.profile.array("speed"), axis=1)
    return np.asarray(found[int(np.argmin(cost))])


def _over(machine: Machine, up: FloatArray, down: FloatArray, clear_z: float) -> tuple[FloatArray, bool]:
    """States between two, both left out, and whether the tip stays clear between them."""
    if (up == down).all():
        return np.empty((0, len(up))), True
    (first, last), _ = machine.chain.forward(np.stack([up, down]))
    high_enough = min(first[2], last[2], clear_z) - HOP_CHORD
    held = _tip_held(machine.chain, up, down, first, last)
    if machine.inside(held):
        return held[1:-1], bool(min(first[2], last[2]) >= clear_z - HOP_CHORD)
    fraction = np.linspace(0, 1, 65)[:, None]
    points, _ = machine.chain.forward(up + fraction * (down - up))
    clear = points[:, 2].min() >= high_enough and min(first[2], last[2]) >= clear_z - HOP_CHORD
    return np.empty((0, len(up))), bool(clear)


def _tip_held(chain: JointChain, up: FloatArray, down: FloatArray, first: FloatArray, last: FloatArray) -> FloatArray:
    """States from `up` to `down` whose rotaries go straight while the tip goes straight, within HOP_CHORD."""
    pieces = 1
    while True:
        fraction = np.linspace(0, 1, pieces + 1)[:, None]
        joints = _at(chain, first + fraction * (last - first), up + fraction * (down - up))
        joints[0], joints[-1] = up, down
        middle = fraction[:-1] + 0.5 / pieces
        tips, _ = chain.forward(0.5 * (joints[1:] + joints[:-1]))
        if pieces >= 4096 or np.linalg.norm(tips - first - middle * (last - first), axis=1).max() <= HOP_CHORD:
            return joints
        pieces *= 2


def _at(chain: JointChain, points: FloatArray, joints: FloatArray) -> FloatArray:
    """(n, k) joints with the rotaries of `joints` ((k,) or (n, k)) and the tip on `points` (n, 3)."""
    angles = np.broadcast_to(joints, (len(points), joints.shape[-1]))[:, chain.rotary]
    return chain.at_angles(points, np.ascontiguousarray(angles))
