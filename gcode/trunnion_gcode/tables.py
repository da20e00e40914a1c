"""Which machines a controller with tip control can drive: a turning table on a tilting table, a head in X, Y, Z."""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import Joint, MachineProfile

DIRECTIONS: dict[str, FloatArray] = dict(zip("XYZABC", np.vstack([np.eye(3), np.eye(3)]), strict=True))
SAME = 1e-9
"""Parallel unit vectors differ by no more."""


def table_problem(profile: MachineProfile) -> str | None:
    """Why the machine is no XYZAC or XYZBC table-table, whichever way its rotaries turn; None where it is one."""
    rotary = [profile.joints[column] for column in profile.rotary]
    if [joint.letter for joint in rotary] not in (["A", "C"], ["B", "C"]):
        letters = " and ".join(joint.letter for joint in rotary) or "none"
        return f"tip control knows tilting tables A or B that carry a turning table C; the rotary joints are {letters}"
    if any(joint.side != "work" for joint in rotary):
        return "tip control knows tables only; this machine turns its head"
    if not all(_along(joint) for joint in rotary):
        return "tip control wants A along X or B along Y, and C along Z, with all joints at zero"
    linear = [joint for joint in profile.joints if not joint.rotary]
    if {joint.letter for joint in linear} != set("XYZ"):
        return "tip control wants the linear joints to be called X, Y and Z"
    for joint in linear:
        forward = joint.axis if joint.side == "tool" else -joint.axis
        if np.abs(forward - DIRECTIONS[joint.letter]).max() > SAME:
            return f"tip control wants a growing {joint.letter} to move the tip along +{joint.letter} over the table"
    work = [joint.rotary for joint in profile.joints if joint.side == "work"]
    if work != sorted(work):
        return "tip control wants the linear joints below the tables, not on them"
    if np.abs(profile.tool_axis - DIRECTIONS["Z"]).max() > SAME:
        return "tip control wants the tool upright with all joints at zero"
    return None


def turning_signs(profile: MachineProfile) -> set[int]:
    """1 where a growing angle turns the table right-handed about +X, +Y or +Z, -1 where it turns it the other way."""
    rotary = [profile.joints[column] for column in profile.rotary]
    return {int(np.sign(joint.axis @ DIRECTIONS[joint.letter])) for joint in rotary}


def pivots(profile: MachineProfile) -> tuple[FloatArray, FloatArray]:
    """(3,) mm values of X, Y, Z that bring the tip to the turning axis, at the part's height zero, and (3,) mm from
    there to the tilting axis; what lies along an axis is left as it is."""
    tilting, turning = (profile.joints[column] for column in profile.rotary)
    zero = np.array([turning.point[0], turning.point[1], profile.origin[2]]) - profile.tip
    offset = tilting.point - profile.tip - zero
    return zero, np.where(DIRECTIONS[tilting.letter] != 0, 0.0, offset)


def _along(joint: Joint) -> bool:
    return bool(np.abs(np.abs(joint.axis) - DIRECTIONS[joint.letter]).max() <= SAME)
