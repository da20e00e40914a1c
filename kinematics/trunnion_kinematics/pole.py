"""A chosen joint path to one that passes the pole straight: rotary 1 pulled taut inside the tolerance of the tool axis.

Where the tool is nearly parallel to rotary 1 (a vertical tool over a platter) small turns of the tool cost large turns
of that joint. If the tool may lean a little, each row allows an interval of that joint's angle, the whole circle close
to the pole; the shortest path through these intervals has the least peak speed and the least travel at once. Rotary 2
then takes the tool as near to the wanted axis as it gets, and the linear joints keep the tip exactly where it was.
"""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.reach import outside_limits

FULL_USE = np.radians(20.0)
"""Angle from the pole up to which the tolerance is used in full, or twice the tolerance if that is more.

From twice this angle on it is not used: rotary 1 turns slowly there. Between the two it dwindles; the slower it does,
the less rotary 1 has to hurry back to the wanted axes."""

MOVED = 1e-12
"""rad. Rows whose angle changes less are left exactly as they were."""


def straighten(
    chain: JointChain,
    profile: MachineProfile,
    points: FloatArray,
    tool_axes: FloatArray,
    joints: FloatArray,
    together: BoolArray,
    axis_tolerance: float,
) -> FloatArray:
    """Joints (n, k) with rotary 1 pulled taut along every run of rows joined to the one before by `together` (n,).

    The ends of a run stay. The tool leans at most axis_tolerance rad from tool_axes (n, 3), the tip stays on points
    (n, 3). A run in which a joint would pass its limit stays as it was.
    """
    from trunnion_kinematics.pole_kernels import lean_kernel, string_kernel

    points = np.array(points, dtype=np.float64)
    low, high = tube(chain, points, tool_axes, joints, axis_tolerance)
    column = chain.rotary[0]
    limit = profile.joints[column]
    angles = joints[:, column].copy()
    low, high = np.maximum(low, np.minimum(limit.min, angles)), np.minimum(high, np.maximum(limit.max, angles))
    along = np.zeros(len(points))
    along[1:] = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) + MOVED)
    string_kernel(along, low, high, together, angles)
    moved = np.flatnonzero(np.abs(angles - joints[:, column]) > MOVED)
    result = joints.copy()
    taut = joints[moved]
    lean_kernel(*chain.constants, points[moved], np.array(tool_axes[moved]), angles[moved], taut)
    run = np.cumsum(~together)
    spoilt = np.unique(run[moved[outside_limits(profile, taut).any(axis=1)]])
    kept = ~np.isin(run[moved], spoilt)
    result[moved[kept]] = taut[kept]
    return result


def tube(
    chain: JointChain, points: FloatArray, tool_axes: FloatArray, joints: FloatArray, axis_tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest angle of rotary 1 (n,), about that in joints, which keep the tool within the tolerance.

    With rotary 1 at t1 the tool can go round a circle about w2(t1) with the half-angle f2 between w2 and the tool; its
    angle from the wanted axis q is |angle(w2(t1), q) - f2|, and cos angle(w2(t1), q) = g k1 + sine r cos(t1 - t0).
    """
    w1, w2 = chain.rotary_axes
    g = float(w1 @ w2)
    sine = float(np.linalg.norm(np.cross(w1, w2)))
    f2 = float(np.arccos(np.clip(w2 @ chain.tool_axis, -1, 1)))
    k1 = tool_axes @ w1
    r = np.maximum(chain.pole_sine(tool_axes), 1e-300)
    full = max(FULL_USE, 2 * axis_tolerance)
    tolerance = axis_tolerance * np.clip(2 - np.arcsin(np.minimum(r, 1.0)) / full, 0, 1)

    def half_width(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        cosine = (np.cos(np.clip(angle, 0, np.pi)) - g * k1) / (sine * r)
        return np.arccos(np.clip(cosine, -1, 1)), cosine

    middle, _ = half_width(np.full(len(r), f2))
    far, cos_far = half_width(f2 + tolerance)
    near, cos_near = half_width(f2 - tolerance)
    turn = chain.inverse(points, tool_axes)[:, :, chain.rotary]
    miss = np.abs(np.mod(turn - joints[:, chain.rotary] + np.pi, 2 * np.pi) - np.pi).sum(axis=2)
    second = miss[1] < miss[0]
    below = np.where(second, near - middle, middle - far)
    above = np.where(second, far - middle, middle - near)
    if chain.sign[0] < 0:
        below, above = -above, -below
    free = (cos_far <= -1) & (cos_near >= 1)
    angle = joints[:, chain.rotary[0]]
    return np.where(free, -np.inf, angle + below), np.where(free, np.inf, angle + above)
