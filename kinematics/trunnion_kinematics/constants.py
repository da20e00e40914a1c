"""A joint chain to the flat numbers that the kernels read: vectors in the basis (w1, e1, e2) of the two rotary axes.

e1 is the part of w2 across w1, e2 = w1 x e1, so a turn about w1 is a plane rotation of the last two coordinates.
A vector turned about w2 is a + b cos + c sin with constant a, b, c (Rodrigues), written here as three rows.
"""

from typing import TYPE_CHECKING

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from trunnion_kinematics.chain import JointChain

BASIS, SCALARS, AZIMUTH, PIVOT, ARM, ARM_TOOL, COLUMNS, ROWS = 0, 3, 4, 6, 8, 11, 14, 23
"""First row of each block of the float table (ROWS, 3):
BASIS 3 rows w1, e1, e2 in `part`; SCALARS g = w1.w2, sine of the angle between the axes, k2 = w2.tool0;
AZIMUTH 2 rows f1, f2 = w2 x f1, the directions about w2 from which angle 2 is measured (f1 along tool0);
PIVOT rows c1 in `part` and c2 - c1; ARM tip0 - c2 and ARM_TOOL tool0 as turned about w2; COLUMNS three rows for each
linear joint: its axis as turned about w2 where it comes after rotary 2, else the axis in the first row."""


def chain_constants(chain: "JointChain") -> tuple[FloatArray, IntArray]:
    """The float table (ROWS, 3) and the whole numbers: columns of rotary 1, 2, linear joints, their groups, signs."""
    w1, w2 = chain.rotary_axes
    c1, c2 = chain.rotary_points
    g = float(w1 @ w2)
    across = w2 - g * w1
    sine = float(np.linalg.norm(across))
    e1 = across / sine
    basis = np.stack([w1, e1, np.cross(w1, e1)])
    k2 = float(w2 @ chain.tool_axis)
    f1 = chain.tool_axis - k2 * w2
    f1 /= np.linalg.norm(f1)
    table = np.zeros((ROWS, 3))
    table[BASIS : BASIS + 3] = basis
    table[SCALARS] = g, sine, k2
    table[AZIMUTH : AZIMUTH + 2] = np.stack([f1, np.cross(w2, f1)]) @ basis.T
    table[PIVOT] = c1
    table[PIVOT + 1] = basis @ (c2 - c1)
    table[ARM : ARM + 3] = _turned(chain.tip - c2, w2) @ basis.T
    table[ARM_TOOL : ARM_TOOL + 3] = _turned(chain.tool_axis, w2) @ basis.T
    for j in range(3):
        axis = chain.linear_axes[j]
        rows = _turned(axis, w2) if chain.linear_group[j] == 2 else np.stack([axis, 0 * axis, 0 * axis])
        table[COLUMNS + 3 * j : COLUMNS + 3 * j + 3] = rows @ basis.T
    whole = np.concatenate([chain.rotary, chain.linear, chain.linear_group, chain.sign.astype(np.int64)])
    return table, whole


def _turned(vector: FloatArray, axis: FloatArray) -> FloatArray:
    """Rows a, b, c with R(angle) vector = a + b cos(angle) + c sin(angle)."""
    along = (axis @ vector) * axis
    return np.stack([along, vector - along, np.cross(axis, vector)])
