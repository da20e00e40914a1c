"""A machine as one chain from the part to the nozzle: poses to every joint solution, and back.

Both of a profile's chains start at the frame. Walked from the part down to the frame and up to the nozzle they are one
product of exponentials (Brockett 1984; Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation,
1994), in which a joint on the work side turns and moves the other way round:

    tip + origin = P0 + c1 + R1 (P1 + c2 - c1 + R2 (P2 + tip0 - c2)),      tool = R1 R2 tool0

R1 and R2 are the rotaries about the lines (c1, w1) and (c2, w2); Pg adds up the linear joints that are passed before R1
(g = 0), between R1 and R2 (1) or after R2 (2). Where a joint sits, which way it runs and what it carries is in these
numbers, so every machine of three linear and no or two rotary joints goes through the same few formulas.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.errors import ProfileError
from trunnion_core.profile import Joint, MachineProfile
from trunnion_core.tolerance import PARALLEL_AXES, SAME_TOOL_AXIS_DEG
from trunnion_kinematics.constants import chain_constants


@dataclass(frozen=True, eq=False)
class JointChain:
    """Forward and inverse kinematics of one machine. Rotaries count from the part: 1 is next to it, 2 to the nozzle.

    Joint limits are not applied here: they belong to `branches.choose`.
    """

    letters: tuple[str, ...]
    tool_axis: FloatArray
    """(3,) unit: the tool with all joints at zero, in `part` and `machine` alike."""
    tip: FloatArray
    """(3,) mm: the tip with all joints at zero, in `part`."""
    linear: IntArray
    """(3,) columns of the linear joints."""
    linear_axes: FloatArray
    """(3, 3): row j is the way that the tip moves over the part for a growing linear joint j, all joints at zero."""
    linear_group: IntArray
    """(3,) how many rotaries are passed between the part and linear joint j."""
    rotary: IntArray
    """Columns of rotary 1 and 2; empty on a machine that has none."""
    sign: FloatArray
    """-1 for a rotary on the work side, +1 on the tool side."""
    rotary_axes: FloatArray
    """Rows w1 and w2, unit."""
    rotary_points: FloatArray
    """Rows c1 and c2 in `part` with all joints at zero, mm."""

    @classmethod
    def from_profile(cls, profile: MachineProfile) -> "JointChain":
        """The chain of a machine. Raises ProfileError where a rotary only turns the tool about itself."""
        order = [(column, joint) for column, joint in enumerate(profile.joints) if joint.side == "work"][::-1]
        order += [(column, joint) for column, joint in enumerate(profile.joints) if joint.side == "tool"]
        rotary = [(column, joint) for column, joint in order if joint.rotary]
        linear = [(column, joint) for column, joint in order if not joint.rotary]
        places = [column for column, _ in order]
        group = [sum(places.index(c) < places.index(column) for c, _ in rotary) for column, _ in linear]
        if rotary and np.linalg.norm(np.cross(rotary[1][1].axis, profile.tool_axis)) < PARALLEL_AXES:
            letter = rotary[1][1].letter
            raise ProfileError(
                profile.file,
                [f"joint {letter}: its axis is parallel to tool.axis, so it turns the tool about itself only"],
            )
        return cls(
            letters=profile.letters,
            tool_axis=profile.tool_axis,
            tip=profile.tip - profile.origin,
            linear=np.array([column for column, _ in linear], dtype=np.int64),
            linear_axes=np.array([_sign(joint) * joint.axis for _, joint in linear]),
            linear_group=np.array(group, dtype=np.int64),
            rotary=np.array([column for column, _ in rotary], dtype=np.int64),
            sign=np.array([_sign(joint) for _, joint in rotary]),
            rotary_axes=np.array([joint.axis for _, joint in rotary]).reshape(-1, 3),
            rotary_points=np.array([joint.point - profile.origin for _, joint in rotary]).reshape(-1, 3),
        )

    @property
    def branches(self) -> int:
        """Joint solutions of a pose: two, or one on a machine without rotary joints."""
        return 2 if self.rotary.size else 1

    @cached_property
    def constants(self) -> tuple[FloatArray, IntArray]:
        """What the kernels read, laid out as `constants.py` says; only on a machine with rotary joints."""
        return chain_constants(self)

    def pole_sine(self, tool_axes: FloatArray) -> FloatArray:
        """(n,) sine of the angle between unit tool_axes (n, 3) and the axis of rotary 1, exact near the pole, too."""
        w1 = self.rotary_axes[0]
        aside = np.cross(w1, np.eye(3)[int(np.argmin(np.abs(w1)))])
        aside /= np.linalg.norm(aside)
        across = tool_axes @ np.stack([aside, np.cross(w1, aside)], axis=1)
        return np.asarray(np.hypot(across[:, 0], across[:, 1]))

    def forward(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where joints (n, k) in mm and rad put the tip, (n, 3) mm, and the tool, (n, 3) unit, in `part`."""
        joints = _rows(joints, len(self.letters))
        if not self.rotary.size:
            points = self.tip + joints[:, self.linear] @ self.linear_axes
            return points, np.tile(self.tool_axis, (len(joints), 1))
        from trunnion_kinematics.chain_kernels import forward_kernel

        points, tool_axes = np.empty((len(joints), 3)), np.empty((len(joints), 3))
        forward_kernel(*self.constants, joints, points, tool_axes)
        return points, tool_axes

    def inverse(self, points: FloatArray, tool_axes: FloatArray) -> FloatArray:
        """Every joint solution of each pose, (branches, n, k) in mm and rad; NaN where out of reach.

        points (n, 3) mm and tool_axes (n, 3) unit are in `part`. Rotaries are in (-pi, pi]. Where the tool is parallel
        to rotary 1 (the pole: a vertical tool over a platter) that joint is free: it is given as 0 in both branches and
        the choice is left to `branches.choose`.
        """
        points, tool_axes = _rows(points, 3), _rows(tool_axes, 3)
        n, k = len(points), len(self.letters)
        if not self.rotary.size:
            joints = np.empty((1, n, k))
            joints[0][:, self.linear] = (points - self.tip) @ np.linalg.inv(self.linear_axes)
            joints[0][~self.reachable(tool_axes)] = np.nan
            return joints
        from trunnion_kinematics.chain_kernels import inverse_kernel

        joints = np.empty((2, n, k))
        inverse_kernel(*self.constants, points, tool_axes, joints)
        return joints

    def reachable(self, tool_axes: FloatArray) -> BoolArray:
        """(n,) whether the tool can be turned that way, limits aside."""
        if not self.rotary.size:
            chord = np.linalg.norm(_rows(tool_axes, 3) - self.tool_axis, axis=1)
            return np.asarray(chord <= math.radians(SAME_TOOL_AXIS_DEG))
        return np.asarray(np.isfinite(self.singularity(tool_axes)))

    def singularity(self, tool_axes: FloatArray) -> FloatArray:
        """(n,) |det| of the Jacobian from the rotaries to the tool axis; 0 where singular, NaN where out of reach.

        It is |w1 . (w2 x tool)| with all three as they stand at the pose, the same in both branches. A machine without
        rotaries has an empty Jacobian, whose determinant is 1.
        """
        tool_axes = _rows(tool_axes, 3)
        if not self.rotary.size:
            return np.where(self.reachable(tool_axes), 1.0, np.nan)
        from trunnion_kinematics.chain_kernels import singularity_kernel

        result = np.empty(len(tool_axes))
        singularity_kernel(*self.constants, tool_axes, result)
        return result

    def at_angles(self, points: FloatArray, angles: FloatArray) -> FloatArray:
        """Joints (n, k) that put the tip on points (n, 3) with rotary 1 and 2 at the joint values `angles` (n, 2)."""
        points, angles = _rows(points, 3), _rows(angles, len(self.rotary))
        if not self.rotary.size:
            only: FloatArray = self.inverse(points, np.tile(self.tool_axis, (len(points), 1)))[0]
            return only
        from trunnion_kinematics.chain_kernels import at_angles_kernel

        joints = np.empty((len(points), len(self.letters)))
        at_angles_kernel(*self.constants, points, angles, joints)
        return joints

    def jacobian(self, joints: FloatArray) -> FloatArray:
        """(n, 6, k): how tip (rows 0 to 2, mm) and tool axis (3 to 5) in `part` change with each joint."""
        joints = _rows(joints, len(self.letters))
        n, k = joints.shape
        result = np.zeros((n, 6, k))
        turns = self._turns(joints)
        steps = joints[:, self.linear, None] * self.linear_axes
        for j in range(3):
            result[:, :3, self.linear[j]] = turns[self.linear_group[j]] @ self.linear_axes[j]
        if not self.rotary.size:
            return result
        before = steps[:, self.linear_group == 0].sum(axis=1)
        between = steps[:, self.linear_group == 1].sum(axis=1)
        c1, c2 = self.rotary_points
        pivot1 = before + c1
        pivot2 = pivot1 + np.einsum("nij,nj->ni", turns[1], between + c2 - c1)
        points, tool_axes = self.forward(joints)
        for j, pivot in enumerate((pivot1, pivot2)):
            axis = self.sign[j] * (turns[j] @ self.rotary_axes[j])
            result[:, :3, self.rotary[j]] = np.cross(axis, points - pivot)
            result[:, 3:, self.rotary[j]] = np.cross(axis, tool_axes)
        return result

    def _turns(self, joints: FloatArray) -> list[FloatArray]:
        """(n, 3, 3) rotations of the frames before rotary 1, between the two, and after rotary 2."""
        turns = [np.tile(np.eye(3), (len(joints), 1, 1))]
        for j, column in enumerate(self.rotary):
            w = self.rotary_axes[j]
            cross = np.cross(np.eye(3), w)
            angle = (self.sign[j] * joints[:, column])[:, None, None]
            turn = np.cos(angle) * np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * np.outer(w, w)
            turns.append(turns[-1] @ turn)
        return turns


def _sign(joint: Joint) -> float:
    return -1.0 if joint.side == "work" else 1.0


def _rows(array: FloatArray, width: int) -> FloatArray:
    """The array as the kernels take it: (n, width) float64, contiguous, writable."""
    array = np.require(array, dtype=np.float64, requirements=["C", "W"])
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"shape {array.shape}, should be (n, {width})")
    return array
