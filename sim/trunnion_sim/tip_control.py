"""Tool centre point control of Marlin's five-axis fork: which machines have it, and what M665 sets.

DerAndere1/Marlin knows a table on a tilting table (`penta_axis_trt.cpp`) and a tilting head over a turning table
(`penta_axis_ht.cpp`). With G43.4 the words X, Y, Z are the tip over the part, in the coordinates that the joints have
with the rotaries at zero; the rotary words stay joint angles, F is the speed of the tip, and a move that turns a rotary
is cut into `segments_per_second` pieces (`motion.cpp`, `line_to_destination_kinematic`). The signs and lines of the
rotary joints come from the profile: the branches of the fork disagree on them.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_sim import tip_kernel
from trunnion_sim.tip_kernel import Geometry

SEGMENTS_PER_SECOND = 200.0
"""DEFAULT_SEGMENTS_PER_SECOND."""
ROTARY_ZERO_POINT = "XYZ"
JOINT_OFFSET = "IJK"


class TipControl:
    """The geometry that the firmware believes in."""

    def __init__(self, profile: MachineProfile) -> None:
        joints = profile.joints
        first, second = profile.rotary
        self.head = joints[first].side == "tool" or joints[second].side == "tool"
        tool = [column for column in profile.rotary if joints[column].side == "tool"]
        self._tilting = tool[0] if tool else first
        self._turning = next(column for column in profile.rotary if column != self._tilting)
        self.segments_per_second = SEGMENTS_PER_SECOND
        self.rotary = profile.rotary
        place = np.array([profile.letters.index(letter) for letter in "XYZ"])
        axis = np.array([joint.axis for joint in joints])
        tool_side = np.array([joint.side == "tool" for joint in joints])
        directions = np.ascontiguousarray((axis[place] * np.where(tool_side[place], 1.0, -1.0)[:, None]).T)
        self.geometry = Geometry(
            rotary=np.array([joint.rotary for joint in joints]),
            tool=tool_side,
            axis=axis,
            point=np.array([joint.point for joint in joints]),
            tip=np.array(profile.tip),
            directions=directions,
            inverse=np.linalg.inv(directions),
            low=np.array([joint.shown(joint.min) for joint in joints]),
            high=np.array([joint.shown(joint.max) for joint in joints]),
            place=place,
        )

    def joints(self, native: FloatArray) -> tuple[FloatArray, bool]:
        """(k,) joints that take the tip to `native` (k,), mm and degrees, and whether all are in their travel."""
        out = np.array(native, dtype=np.float64)
        return out, bool(tip_kernel.to_joints(self.geometry, out.copy(), out))

    def many(self, native: FloatArray) -> FloatArray:
        """(n, k) joints of n rows of native values, mm and degrees, whether they are in their travel or not."""
        out = np.empty_like(native)
        tip_kernel.all_to_joints(self.geometry, np.ascontiguousarray(native), out)
        return out

    def native(self, joints: FloatArray) -> FloatArray:
        """(k,) tip over the part and angles at `joints` (k,), mm and degrees."""
        out = np.empty(len(joints))
        tip_kernel.to_native(self.geometry, joints, out)
        return out

    @property
    def zero_point(self) -> FloatArray:
        """(3,) values of X, Y, Z that bring the tip to the turning table's axis, rotaries at zero."""
        g = self.geometry
        return np.asarray(g.inverse @ (g.point[self._turning] - g.tip))

    @property
    def joint_offset(self) -> FloatArray:
        """(3,) mm along X, Y, Z from the turning axis to the tilting axis."""
        g = self.geometry
        return np.asarray(g.inverse @ (g.point[self._tilting] - g.point[self._turning]))

    def set(self, words: Mapping[str, float | None]) -> None:
        """M665: S segments a second; X Y Z the rotary zero point and I J K the joint offset, or Z the head's arm."""
        g = self.geometry
        segments = words.get("S")
        if segments is not None and segments > 0:
            self.segments_per_second = segments
        if self.head:
            arm = words.get("Z")
            if arm is not None:
                along = g.tip - g.point[self._tilting]
                length = self._arm()
                if length > 0:
                    g.point[self._tilting] = g.tip - along * (arm / length)
            return
        zero, offset = self.zero_point, self.joint_offset
        for column, letters in enumerate(zip(ROTARY_ZERO_POINT, JOINT_OFFSET, strict=True)):
            for letter, values in zip(letters, (zero, offset), strict=True):
                number = words.get(letter)
                if number is not None:
                    values[column] = number
        g.point[self._turning] = g.tip + g.directions @ zero
        g.point[self._tilting] = g.point[self._turning] + g.directions @ offset

    def report(self) -> str:
        """M665 without words, as M503 shows it."""
        if self.head:
            return f"  M665 S{self.segments_per_second:.2f} Z{self._arm():.2f}"
        zero = "".join(f" {x}{v:.2f}" for x, v in zip(ROTARY_ZERO_POINT, self.zero_point, strict=True))
        offset = "".join(f" {x}{v:.2f}" for x, v in zip(JOINT_OFFSET, self.joint_offset, strict=True))
        return f"  M665 S{self.segments_per_second:.2f}{zero}{offset}"

    def _arm(self) -> float:
        g = self.geometry
        return float(np.linalg.norm(g.point[self._tilting] - g.tip))


def told(profile: MachineProfile, words: Sequence[Mapping[str, float]]) -> list[TipControl]:
    """The geometries that the firmware believes in after each of the M665 with these words."""
    believed = []
    for i in range(len(words)):
        control = TipControl(profile)
        for each in words[: i + 1]:
            control.set(each)
        believed.append(control)
    return believed


def tip_control_of(profile: MachineProfile) -> TipControl | None:
    """Tip control for this machine; None where the fork has none: no or three rotaries, a head that turns twice."""
    joints = profile.joints
    sides = [joints[column].side for column in profile.rotary]
    linear = {joint.letter for joint in joints if not joint.rotary}
    if len(sides) != 2 or sides == ["tool", "tool"] or linear != set("XYZ"):
        return None
    return TipControl(profile)
