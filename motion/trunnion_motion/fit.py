"""Say whether a machine can take poses, before anything is sliced or planned for it: which joint gives up, and where.

The poses are a toolpath's, or those that a mesh will ask for: its vertices under the upright tool, and under their
normals where the surface is flat enough to be printed along them.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.findings import Finding
from trunnion_core.mesh import Mesh
from trunnion_core.profile import MachineProfile
from trunnion_core.toolpath import Toolpath
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.reach import LIMIT_SLACK, unreachable

POLE_SINE = 1e-8
"""Sine of the angle to the pole below which the first rotary is free, as in `trunnion_kinematics.branches`."""
_FREE_ANGLES = np.linspace(-np.pi, np.pi, 24, endpoint=False)
"""Angles tried for a rotary that is free."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Where the tip must be able to go, in `part`."""

    points: FloatArray
    """(n, 3) mm."""
    tool_axes: FloatArray
    """(n, 3) unit."""

    @classmethod
    def of_toolpath(cls, toolpath: Toolpath) -> "Poses":
        """Every row's end."""
        return cls(toolpath.points, toolpath.tool_axes)

    @classmethod
    def of_mesh(cls, mesh: Mesh, max_angle: float) -> "Poses":
        """Every vertex under the upright tool and, where a face up to `max_angle` (rad) steep meets it, its normal."""
        corners = mesh.triangles
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(area, axis=1)
        skin = (area[:, 2] >= np.cos(max_angle) * size) & (size > 0)
        normals = np.zeros_like(mesh.vertices)
        for corner in range(3):
            np.add.at(normals, mesh.faces[skin, corner], area[skin])
        used = np.unique(mesh.faces)
        tilted = np.flatnonzero(np.linalg.norm(normals, axis=1) > 0) if max_angle > 0 else np.empty(0, dtype=np.int64)
        unit = normals[tilted] / np.linalg.norm(normals[tilted], axis=1, keepdims=True)
        upright = np.tile([0.0, 0.0, 1.0], (len(used), 1))
        points = np.concatenate([mesh.vertices[used], mesh.vertices[tilted]])
        return cls(points, np.concatenate([upright, unit]))


@dataclass(frozen=True, eq=False)
class Fit:
    """Whether poses can be taken, and what stands against it."""

    ok: bool
    findings: tuple[Finding, ...]
    """One `out-of-reach` for each joint that gives up, at its worst place; `off-bed` for what lies beside the bed."""


def fits(poses: Poses, profile: MachineProfile) -> Fit:
    """Whether each pose has a joint state inside the limits, and each point lies over the bed and under its height."""
    chain = JointChain.from_profile(profile)
    found = []
    outside = np.flatnonzero(~over_bed(poses.points, profile))
    if outside.size:
        row = int(outside[np.argmax(np.abs(poses.points[outside, :2]).max(axis=1))])
        x, y, z = (float(value) for value in poses.points[row])
        found.append(
            Finding(
                "off-bed",
                "error",
                f"point ({x:.2f}, {y:.2f}, {z:.2f}) mm and {outside.size - 1} others lie beside or above the space of "
                f"{profile.name}",
                row=row,
                point=(x, y, z),
            )
        )
    states = joint_states(chain, poses)
    excess = limit_excess(states, profile)
    least = np.argmin(excess.max(axis=2), axis=0)
    best = excess[least, np.arange(len(least))]
    worst = best.max(axis=1, initial=0.0)
    giving_up = np.where(worst > 0, best.argmax(axis=1), -1)
    for column in np.unique(giving_up[giving_up >= 0]):
        rows = np.flatnonzero(giving_up == column)
        row = int(rows[np.argmax(worst[rows])])
        found.append(_reason(chain, profile, poses, row, len(rows)))
    return Fit(not found, tuple(found))


def joint_states(chain: JointChain, poses: Poses) -> FloatArray:
    """(s, n, k) joint states of every pose, NaN where there are fewer; many angles where a rotary is free."""
    states = chain.inverse(poses.points, poses.tool_axes)
    if not chain.rotary.size:
        return states
    free = np.flatnonzero(chain.pole_sine(poses.tool_axes) < POLE_SINE)
    if not free.size:
        return states
    more = np.full((len(_FREE_ANGLES), *states.shape[1:]), np.nan)
    second = states[0][free][:, chain.rotary[1]]
    for place, angle in enumerate(_FREE_ANGLES):
        angles = np.column_stack([np.full(len(free), angle), second])
        more[place, free] = chain.at_angles(poses.points[free], angles)
    return np.concatenate([states, more])


def limit_excess(states: FloatArray, profile: MachineProfile) -> FloatArray:
    """(s, n, k) how far joints are past their limits, in mm and degrees, at the best winding; inf where NaN."""
    low, high = profile.array("min"), profile.array("max")
    wound = states
    for column in profile.rotary:
        if np.isfinite(low[column]):
            wound = wound.copy() if wound is states else wound
            middle = (low[column] + high[column]) / 2
            wound[..., column] -= 2 * np.pi * np.rint((wound[..., column] - middle) / (2 * np.pi))
    past = np.maximum(np.maximum(low - wound, wound - high), 0.0)
    return np.where(np.isnan(past), np.inf, np.where(past <= LIMIT_SLACK, 0.0, past)) * profile.to_shown


def over_bed(points: FloatArray, profile: MachineProfile) -> BoolArray:
    """(n,) whether points lie over the bed's area, and not above its height."""
    bed = profile.bed
    x, y, z = points.T
    if bed.min is not None and bed.max is not None:
        inside = (x >= bed.min[0]) & (x <= bed.max[0]) & (y >= bed.min[1]) & (y <= bed.max[1])
    else:
        inside = np.hypot(x, y) <= 0.5 * (bed.diameter or 0.0)
    return np.asarray(inside & (z <= bed.height))


def _reason(chain: JointChain, profile: MachineProfile, poses: Poses, row: int, count: int) -> Finding:
    x, y, z = (float(value) for value in poses.points[row])
    error = unreachable(chain, profile, row, poses.points, poses.tool_axes)
    others = f" (and {count - 1} other places)" if count > 1 else ""
    axis = ", ".join(f"{value:.3f}" for value in poses.tool_axes[row])
    message = (
        f"point ({x:.2f}, {y:.2f}, {z:.2f}) mm with tool axis ({axis}){others}: joint {error.joint} {error.reason}"
    )
    return Finding("out-of-reach", "error", message, row=row, axis=error.joint, point=(x, y, z))
