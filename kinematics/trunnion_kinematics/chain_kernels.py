"""Poses to joints and joints to poses, row by row, for machines with two rotary joints.

The orientation is Paden's second subproblem, E(w1, t1) E(w2, t2) tool0 = q (Murray, Li and Sastry 1994, section 3.3),
solved in the basis (w1, e1, e2) of `constants.py`: z = E(w2, t2) tool0 has z.w1 = q.w1 and z.w2 = tool0.w2, which
leaves z = (k1, u, +-c). All lengths across w1 are formed from coordinates, not as 1 - k1^2, so nothing cancels near
the pole.
"""

import math

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_kinematics.constants import ARM, ARM_TOOL, AZIMUTH, BASIS, COLUMNS, PIVOT, SCALARS

POLE_SINE = 1e-9
"""Sine of the angle to w1 below which rotary 1 is free: an error of the tool axis that ROUND_TRIP allows."""

REACH_SLACK = 1e-10
"""How far outside the band of reach, as a sine, a tool axis still counts as on its edge: rounding of unit vectors."""

LINEAR_REACH = 1e5
"""mm. A pose that needs a longer linear joint is out of reach: there the linear joints, as turned, lie in a plane."""

WELL_CONDITIONED = 0.1
"""Determinant of the linear directions above which Cramer's rule is as exact as double precision allows."""


@njit(cache=True, error_model="numpy")
def forward_kernel(
    t: FloatArray, whole: IntArray, joints: FloatArray, points: FloatArray, tool_axes: FloatArray
) -> None:
    """Fill points and tool_axes (n, 3), `part`, from joints (n, k)."""
    for i in range(joints.shape[0]):
        a1, a2 = whole[8] * joints[i, whole[0]], whole[9] * joints[i, whole[1]]
        cos1, sin1, cos2, sin2 = math.cos(a1), math.sin(a1), math.cos(a2), math.sin(a2)
        x = t[PIVOT + 1, 0] + t[ARM, 0] + t[ARM + 1, 0] * cos2 + t[ARM + 2, 0] * sin2
        y = t[PIVOT + 1, 1] + t[ARM, 1] + t[ARM + 1, 1] * cos2 + t[ARM + 2, 1] * sin2
        z = t[PIVOT + 1, 2] + t[ARM, 2] + t[ARM + 1, 2] * cos2 + t[ARM + 2, 2] * sin2
        x0 = y0 = z0 = 0.0
        for j in range(3):
            value, row = joints[i, whole[2 + j]], COLUMNS + 3 * j
            if whole[5 + j] == 0:
                x0 += value * t[row, 0]
                y0 += value * t[row, 1]
                z0 += value * t[row, 2]
            else:
                x += value * (t[row, 0] + t[row + 1, 0] * cos2 + t[row + 2, 0] * sin2)
                y += value * (t[row, 1] + t[row + 1, 1] * cos2 + t[row + 2, 1] * sin2)
                z += value * (t[row, 2] + t[row + 1, 2] * cos2 + t[row + 2, 2] * sin2)
        u = t[ARM_TOOL, 0] + t[ARM_TOOL + 1, 0] * cos2 + t[ARM_TOOL + 2, 0] * sin2
        v = t[ARM_TOOL, 1] + t[ARM_TOOL + 1, 1] * cos2 + t[ARM_TOOL + 2, 1] * sin2
        w = t[ARM_TOOL, 2] + t[ARM_TOOL + 1, 2] * cos2 + t[ARM_TOOL + 2, 2] * sin2
        x0 += x
        y0 += cos1 * y - sin1 * z
        z0 += sin1 * y + cos1 * z
        v, w = cos1 * v - sin1 * w, sin1 * v + cos1 * w
        for d in range(3):
            points[i, d] = t[PIVOT, d] + x0 * t[BASIS, d] + y0 * t[BASIS + 1, d] + z0 * t[BASIS + 2, d]
            tool_axes[i, d] = u * t[BASIS, d] + v * t[BASIS + 1, d] + w * t[BASIS + 2, d]


@njit(cache=True, error_model="numpy")
def inverse_kernel(
    t: FloatArray, whole: IntArray, points: FloatArray, tool_axes: FloatArray, joints: FloatArray
) -> None:
    """Fill joints (2, n, k): both branches, NaN where out of reach."""
    for i in range(points.shape[0]):
        solve(t, whole, points[i], tool_axes[i], joints[0, i], joints[1, i])


@njit(cache=True, error_model="numpy", inline="always")
def solve(
    t: FloatArray, whole: IntArray, point: FloatArray, tool_axis: FloatArray, first: FloatArray, second: FloatArray
) -> None:
    """Fill first and second (k,) with the two branches of one pose."""
    k1, x1, x2, r, u, c = split(t, tool_axis[0], tool_axis[1], tool_axis[2])
    if not c >= 0.0:
        first[:] = np.nan
        second[:] = np.nan
        return
    for branch in range(2):
        joints = first if branch == 0 else second
        if branch == 1:
            c = -c
        y1 = k1 * t[AZIMUTH, 0] + u * t[AZIMUTH, 1] + c * t[AZIMUTH, 2]
        y2 = k1 * t[AZIMUTH + 1, 0] + u * t[AZIMUTH + 1, 1] + c * t[AZIMUTH + 1, 2]
        length = 1.0 / math.sqrt(y1 * y1 + y2 * y2)
        cos2, sin2 = y1 * length, y2 * length
        cos1, sin1 = 1.0, 0.0
        if r > POLE_SINE:
            cos1, sin1 = u * x1 + c * x2, u * x2 - c * x1
            length = 1.0 / math.sqrt(cos1 * cos1 + sin1 * sin1)
            cos1, sin1 = cos1 * length, sin1 * length
        joints[whole[0]] = wrapped(whole[8] * math.atan2(sin1, cos1))
        joints[whole[1]] = wrapped(whole[9] * math.atan2(sin2, cos2))
        place(t, whole, point[0], point[1], point[2], cos1, sin1, cos2, sin2, joints)


@njit(cache=True, error_model="numpy", inline="always")
def lean(
    t: FloatArray, whole: IntArray, point: FloatArray, tool_axis: FloatArray, angle: float, joints: FloatArray
) -> None:
    """Fill joints (k,) with rotary 1 at `angle` and the tool as near to tool_axis as rotary 2 can bring it."""
    k1, x1, x2, _, _, _ = split(t, tool_axis[0], tool_axis[1], tool_axis[2])
    cos1, sin1 = math.cos(whole[8] * angle), math.sin(whole[8] * angle)
    v, w = cos1 * x1 + sin1 * x2, cos1 * x2 - sin1 * x1
    y1 = k1 * t[AZIMUTH, 0] + v * t[AZIMUTH, 1] + w * t[AZIMUTH, 2]
    y2 = k1 * t[AZIMUTH + 1, 0] + v * t[AZIMUTH + 1, 1] + w * t[AZIMUTH + 1, 2]
    length = 1.0 / math.sqrt(y1 * y1 + y2 * y2)
    joints[whole[0]] = angle
    joints[whole[1]] = wrapped(whole[9] * math.atan2(y2, y1))
    place(t, whole, point[0], point[1], point[2], cos1, sin1, y1 * length, y2 * length, joints)


@njit(cache=True, error_model="numpy")
def at_angles_kernel(
    t: FloatArray, whole: IntArray, points: FloatArray, angles: FloatArray, joints: FloatArray
) -> None:
    """Fill joints (n, k) for the tip on points with the rotary joints at angles (n, 2)."""
    for i in range(points.shape[0]):
        a1, a2 = whole[8] * angles[i, 0], whole[9] * angles[i, 1]
        joints[i, whole[0]], joints[i, whole[1]] = angles[i, 0], angles[i, 1]
        cos1, sin1, cos2, sin2 = math.cos(a1), math.sin(a1), math.cos(a2), math.sin(a2)
        place(t, whole, points[i, 0], points[i, 1], points[i, 2], cos1, sin1, cos2, sin2, joints[i])


@njit(cache=True, error_model="numpy")
def singularity_kernel(t: FloatArray, whole: IntArray, tool_axes: FloatArray, result: FloatArray) -> None:
    """Fill result (n,): |w1 . (w2 x tool)| = |c| sin(w1, w2), NaN where out of reach."""
    for i in range(tool_axes.shape[0]):
        result[i] = split(t, tool_axes[i, 0], tool_axes[i, 1], tool_axes[i, 2])[5] * t[SCALARS, 1]


@njit(cache=True, error_model="numpy", inline="always")
def split(t: FloatArray, qx: float, qy: float, qz: float) -> tuple[float, float, float, float, float, float]:
    """The tool axis in the basis (k1, x1, x2), its sine r to w1, and z = (k1, u, +-c); c is NaN out of reach."""
    scale = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz)
    qx, qy, qz = qx * scale, qy * scale, qz * scale
    k1 = t[BASIS, 0] * qx + t[BASIS, 1] * qy + t[BASIS, 2] * qz
    x1 = t[BASIS + 1, 0] * qx + t[BASIS + 1, 1] * qy + t[BASIS + 1, 2] * qz
    x2 = t[BASIS + 2, 0] * qx + t[BASIS + 2, 1] * qy + t[BASIS + 2, 2] * qz
    r = math.sqrt(x1 * x1 + x2 * x2)
    u = (t[SCALARS, 2] - t[SCALARS, 0] * k1) / t[SCALARS, 1]
    inside = (r - u) * (r + u)
    if inside >= 0.0:
        c = math.sqrt(inside)
    elif r + REACH_SLACK >= abs(u):
        c = 0.0
    else:
        c = np.nan
    return k1, x1, x2, r, u, c


@njit(cache=True, error_model="numpy", inline="always")
def place(
    t: FloatArray,
    whole: IntArray,
    px: float,
    py: float,
    pz: float,
    cos1: float,
    sin1: float,
    cos2: float,
    sin2: float,
    joints: FloatArray,
) -> None:
    """Fill the linear joints that put the tip on (px, py, pz): 3 x 3, in the frame between the rotaries."""
    px, py, pz = px - t[PIVOT, 0], py - t[PIVOT, 1], pz - t[PIVOT, 2]
    x = t[BASIS, 0] * px + t[BASIS, 1] * py + t[BASIS, 2] * pz
    y = t[BASIS + 1, 0] * px + t[BASIS + 1, 1] * py + t[BASIS + 1, 2] * pz
    z = t[BASIS + 2, 0] * px + t[BASIS + 2, 1] * py + t[BASIS + 2, 2] * pz
    y, z = cos1 * y + sin1 * z, cos1 * z - sin1 * y
    x -= t[PIVOT + 1, 0] + t[ARM, 0] + t[ARM + 1, 0] * cos2 + t[ARM + 2, 0] * sin2
    y -= t[PIVOT + 1, 1] + t[ARM, 1] + t[ARM + 1, 1] * cos2 + t[ARM + 2, 1] * sin2
    z -= t[PIVOT + 1, 2] + t[ARM, 2] + t[ARM + 1, 2] * cos2 + t[ARM + 2, 2] * sin2
    ax, ay, az = column(t, COLUMNS, whole[5], cos1, sin1, cos2, sin2)
    bx, by, bz = column(t, COLUMNS + 3, whole[6], cos1, sin1, cos2, sin2)
    cx, cy, cz = column(t, COLUMNS + 6, whole[7], cos1, sin1, cos2, sin2)
    bcx, bcy, bcz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    det = ax * bcx + ay * bcy + az * bcz
    inverse = 1.0 / det
    vx, vy, vz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
    a = (x * bcx + y * bcy + z * bcz) * inverse
    b = -(vx * cx + vy * cy + vz * cz) * inverse
    c = (vx * bx + vy * by + vz * bz) * inverse
    if abs(det) < WELL_CONDITIONED:
        x -= a * ax + b * bx + c * cx
        y -= a * ay + b * by + c * cy
        z -= a * az + b * bz + c * cz
        vx, vy, vz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
        a += (x * bcx + y * bcy + z * bcz) * inverse
        b -= (vx * cx + vy * cy + vz * cz) * inverse
        c += (vx * bx + vy * by + vz * bz) * inverse
        if not abs(a) + abs(b) + abs(c) < LINEAR_REACH:
            joints[:] = np.nan
            return
    joints[whole[2]] = a
    joints[whole[3]] = b
    joints[whole[4]] = c


@njit(cache=True, error_model="numpy", inline="always")
def column(
    t: FloatArray, row: int, group: int, cos1: float, sin1: float, cos2: float, sin2: float
) -> tuple[float, float, float]:
    """A linear joint's direction in the frame between the rotaries."""
    if group == 0:
        return t[row, 0], cos1 * t[row, 1] + sin1 * t[row, 2], cos1 * t[row, 2] - sin1 * t[row, 1]
    return (
        t[row, 0] + t[row + 1, 0] * cos2 + t[row + 2, 0] * sin2,
        t[row, 1] + t[row + 1, 1] * cos2 + t[row + 2, 1] * sin2,
        t[row, 2] + t[row + 1, 2] * cos2 + t[row + 2, 2] * sin2,
    )


@njit(cache=True, error_model="numpy", inline="always")
def wrapped(angle: float) -> float:
    """-pi is written as +pi."""
    return angle + 2 * math.pi if angle <= -math.pi else angle
