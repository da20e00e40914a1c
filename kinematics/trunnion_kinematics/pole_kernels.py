"""The loops behind `pole.straighten`: a taut string in a tube, and the joints that follow from its angles."""

import numpy as np
from numba import njit

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_kinematics.chain_kernels import lean
from trunnion_kinematics.winding_kernels import nearest


@njit(cache=True, error_model="numpy")
def lean_kernel(
    t: FloatArray, whole: IntArray, points: FloatArray, tool_axes: FloatArray, angles: FloatArray, joints: FloatArray
) -> None:
    """Move rotary 1 of joints (n, k) to angles (n,), rotary 2 to the tool axis nearest to tool_axes, the tip to points.

    Rotary 2 keeps to the winding that it comes with.
    """
    c = whole[1]
    for i in range(points.shape[0]):
        old = joints[i, c]
        lean(t, whole, points[i], tool_axes[i], angles[i], joints[i])
        joints[i, c] = old + nearest(joints[i, c] - old)


@njit(cache=True, error_model="numpy")
def string_kernel(
    along: FloatArray, low: FloatArray, high: FloatArray, together: BoolArray, angles: FloatArray
) -> None:
    """Pull angles (n,) taut between low and high in every run of rows joined by `together`, ends held.

    The taut string is the shortest path in a tube and the one whose slopes are least by every convex measure at once.
    From a knot the two sight lines under the upper and over the lower wall are narrowed row by row; where they cross,
    the wall that was touched last on the far side is the next knot.
    """
    n = along.shape[0]
    knot = 0
    while knot < n - 1:
        if not together[knot + 1]:
            knot += 1
            continue
        end = knot + 1
        while end < n - 1 and together[end + 1]:
            end += 1
        while knot < end:
            steepest, flattest, upper, lower = np.inf, -np.inf, knot, knot
            onto, value = end, angles[end]
            for j in range(knot + 1, end + 1):
                way = along[j] - along[knot]
                rise = ((angles[j] if j == end else low[j]) - angles[knot]) / way
                roof = ((angles[j] if j == end else high[j]) - angles[knot]) / way
                if rise > steepest:
                    onto, value = upper, high[upper]
                    break
                if roof < flattest:
                    onto, value = lower, low[lower]
                    break
                if roof <= steepest:
                    steepest, upper = roof, j
                if rise >= flattest:
                    flattest, lower = rise, j
            slope = (value - angles[knot]) / (along[onto] - along[knot])
            for j in range(knot + 1, onto):
                angles[j] = angles[knot] + slope * (along[j] - along[knot])
            angles[onto] = value
            knot = onto
