"""Why a pose is out of reach: the joint that gave up, and by how much."""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.errors import UnreachableError
from trunnion_core.profile import MachineProfile
from trunnion_kinematics.chain import JointChain

LIMIT_SLACK = 1e-7
"""mm or rad by which a joint may pass its limit: rounding, far below a motor step."""


def outside_limits(profile: MachineProfile, joints: FloatArray) -> BoolArray:
    """(n, k) which joints are past a limit, or NaN."""
    low, high = profile.array("min") - LIMIT_SLACK, profile.array("max") + LIMIT_SLACK
    return np.asarray(~((joints >= low) & (joints <= high)))


def unreachable(
    chain: JointChain, profile: MachineProfile, row: int, points: FloatArray, tool_axes: FloatArray
) -> UnreachableError:
    """The error to raise for that row, naming the joint of the best solution that is furthest past its limit."""
    point, tool_axis = np.array(points[row]), np.array(tool_axes[row])
    joint, reason = _reason(chain, profile, point, tool_axis)
    return UnreachableError(row, point, tool_axis, joint, reason)


def _reason(chain: JointChain, profile: MachineProfile, point: FloatArray, tool_axis: FloatArray) -> tuple[str, str]:
    if not chain.reachable(tool_axis[None])[0]:
        return _orientation_reason(chain, tool_axis)
    solutions = chain.inverse(point[None], tool_axis[None])[:, 0]
    if not np.isfinite(solutions).all(axis=1).any():
        letter = chain.letters[chain.linear[-1]]
        return letter, "cannot bring the tip there: with the rotaries so turned, the linear joints lie in a plane"
    low, high = profile.array("min"), profile.array("max")
    nearest = _nearest_windings(chain, solutions, low, high)
    excess = np.maximum(np.maximum(low - nearest, nearest - high), 0.0) * profile.to_shown
    best = int(np.argmin(np.where(np.isfinite(nearest).all(axis=1), excess.max(axis=1), np.inf)))
    column = int(np.argmax(excess[best]))
    joint = profile.joints[column]
    value = nearest[best, column]
    limit = joint.max if value > joint.max else joint.min
    letter, name = joint.letter, joint.unit
    return letter, f"would need {letter} = {joint.shown(value):.2f} {name}, limit {joint.shown(limit):g}"


def _nearest_windings(chain: JointChain, solutions: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The solutions with rotaries wound to where they pass their limits least."""
    wound = solutions.copy()
    for column in chain.rotary:
        if np.isfinite(low[column]):
            middle = (low[column] + high[column]) / 2
            wound[:, column] -= 2 * np.pi * np.rint((wound[:, column] - middle) / (2 * np.pi))
    return wound


def _orientation_reason(chain: JointChain, tool_axis: FloatArray) -> tuple[str, str]:
    if not chain.rotary.size:
        lean = np.degrees(np.arccos(np.clip(tool_axis @ chain.tool_axis, -1, 1)))
        return chain.letters[-1], f"has no rotary joint beside it, and the pose leans {lean:.2f} degrees from its tool"
    w1, w2 = chain.rotary_axes
    first, second = (chain.letters[column] for column in chain.rotary)
    to_axis = np.degrees(np.arccos(np.clip(tool_axis @ w1, -1, 1)))
    apart = np.degrees(np.arccos(np.clip(w1 @ w2, -1, 1)))
    to_tool = np.degrees(np.arccos(np.clip(w2 @ chain.tool_axis, -1, 1)))
    least, most = abs(apart - to_tool), min(apart + to_tool, 360 - apart - to_tool)
    return second, (
        f"can bring the tool to {least:.2f} to {most:.2f} degrees from the axis of {first}, "
        f"and this pose needs {to_axis:.2f}"
    )
