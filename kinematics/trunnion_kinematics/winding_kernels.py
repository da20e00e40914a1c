"""What a step between two joint states costs, and which windings of a rotary lie inside its limits."""

import math

import numpy as np
from numba import njit

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_kinematics.reach import LIMIT_SLACK

TURN = 2 * math.pi


@njit(cache=True, error_model="numpy")
def steepest(values: FloatArray, count1: int, count2: int) -> float:
    """Greatest difference between windings of rotary 1 next to each other; inf where finite ones have a gap."""
    result = 0.0
    for w2 in range(count2):
        begun = ended = False
        for w1 in range(count1):
            here = values[w1 * count2 + w2]
            if here == np.inf:
                ended = begun
            elif ended:
                return np.inf
            elif begun:
                result = max(result, abs(here - values[(w1 - 1) * count2 + w2]))
            else:
                begun = True
    return float(result)


@njit(cache=True, error_model="numpy")
def unwind(
    whole: IntArray,
    joints: FloatArray,
    free1: bool,
    free2: bool,
    start: FloatArray,
    sine: FloatArray,
    sine2: float,
    sweep_limit: FloatArray,
    jump: BoolArray,
) -> int:
    """Make free rotaries continuous, each step to the nearest winding, and mark the jumps."""
    for i in range(joints.shape[0]):
        if i == 0 and np.isnan(start[0]):
            continue
        for r in range(2):
            c = whole[r]
            if free1 if r == 0 else free2:
                step = joints[i, c] - (start[c] if i == 0 else joints[i - 1, c])
                joints[i, c] -= TURN * np.rint(step / TURN)
        if i > 0:
            step1 = abs(joints[i, whole[0]] - joints[i - 1, whole[0]])
            step2 = abs(joints[i, whole[1]] - joints[i - 1, whole[1]])
            jump[i] = 0.5 * (sine[i - 1] + sine[i]) * step1 + sine2 * step2 > sweep_limit[i]
    return -1


@njit(cache=True, error_model="numpy", inline="always")
def edge(time: float, turning: float, jumps: bool, travels: bool, costs: FloatArray) -> float:
    """Cost of one step, in seconds: see `branches.choose`."""
    cost = time * (1.0 if travels else costs[0]) + costs[1] * turning
    return float(cost) + (float(costs[2]) if jumps else 0.0)


@njit(cache=True, error_model="numpy")
def opening(
    whole: IntArray,
    candidate: FloatArray,
    full1: float,
    full2: float,
    free1: bool,
    free2: bool,
    start: FloatArray,
    speed: FloatArray,
    costs: FloatArray,
) -> float:
    """Cost of the first row: the travel from `start`, or, where there is none, a preference for small angles."""
    if np.isnan(start[0]):
        return float(costs[1] * (abs(full1) / speed[whole[0]] + abs(full2) / speed[whole[1]]))
    step1, step2 = full1 - start[whole[0]], full2 - start[whole[1]]
    if free1:
        step1 -= TURN * np.rint(step1 / TURN)
    if free2:
        step2 -= TURN * np.rint(step2 / TURN)
    time1, time2 = abs(step1) / speed[whole[0]], abs(step2) / speed[whole[1]]
    time = max(time1, time2)
    for j in range(2, 5):
        time = max(time, abs(candidate[whole[j]] - start[whole[j]]) / speed[whole[j]])
    return float(time + costs[1] * (time1 + time2))


@njit(cache=True, error_model="numpy", inline="always")
def lifted(theta: float, low: float, free: bool) -> float:
    """The angle on the first winding above the lower limit."""
    if free:
        return theta
    return theta + TURN * math.ceil((low - LIMIT_SLACK - theta) / TURN)


@njit(cache=True, error_model="numpy", inline="always")
def count(first: float, high: float, most: int, free: bool) -> int:
    """How many windings fit, from the first one up to the upper limit."""
    if free:
        return 1
    return min(most, math.floor((high + LIMIT_SLACK - first) / TURN) + 1)


@njit(cache=True, error_model="numpy", inline="always")
def nearest(angle: float) -> float:
    """The angle less whole turns, in [-pi, pi]."""
    return float(angle - TURN * np.rint(angle / TURN))
