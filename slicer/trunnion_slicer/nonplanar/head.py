"""The bodies of a print head become solids of revolution about the tool axis, which hold however the machine turns.

A machine reaches a tool axis with its rotary joints in different ways, and some turn the head about its own axis. So a
box, or a body off the axis, is widened to a frustum about the tool axis that holds it.

Only what moves with the tool is known here, since a toolpath belongs to no machine: whether a gantry, a cradle's arm
or the frame is in the way depends on the joints that a machine takes it with, and is the judge's to find.
"""

from collections.abc import Sequence

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_core.solid_tables import BoxTable, HullTable, SolidTable

CORNERS = 32
"""Corners of a polygon around a circle, where a round body stands askew to the tool axis."""


def head_of(profile: MachineProfile) -> tuple[SolidTable, ...]:
    """Every body that moves with the tool, in the tool frame: those of the tool, and what its last joint carries."""
    last = [joint.letter for joint in profile.joints if joint.side == "tool"][-1:] or ["frame"]
    carried = (_seen_from_tip(body.solid, profile) for body in profile.bodies if body.carried_by == last[0])
    return (*profile.tool_bodies, *carried)


def frusta(head: Sequence[SolidTable]) -> FloatArray:
    """(b, 4) mm of each body in the tool frame: lower and upper end along the tool axis, radius at each."""
    return np.array([_frustum(solid) for solid in head], dtype=np.float64).reshape(-1, 4)


def _frustum(solid: SolidTable) -> tuple[float, float, float, float]:
    if isinstance(solid, HullTable):
        return _around(np.array(solid.points))
    if isinstance(solid, BoxTable):
        x = max(abs(solid.min[0]), abs(solid.max[0]))
        y = max(abs(solid.min[1]), abs(solid.max[1]))
        radius = float(np.hypot(x, y))
        return solid.min[2], solid.max[2], radius, radius
    off = float(np.hypot(*solid.center))
    if solid.shape == "cylinder":
        return solid.bottom, solid.top, off + solid.diameter / 2, off + solid.diameter / 2
    return solid.bottom, solid.top, off + solid.bottom_diameter / 2, off + solid.top_diameter / 2


def _around(points: FloatArray) -> tuple[float, float, float, float]:
    """The frustum that holds corners (n, 3), as narrow as can be halfway up.

    Between corners a body is never wider than the mean of their radii, so a straight flank over all corners holds it.
    """
    from scipy.optimize import linprog

    radius, height = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    low, high = float(height.min()), float(height.max())
    share = (height - low) / (high - low)
    flank = linprog([0.5, 0.5], -np.column_stack([1 - share, share]), -radius)
    bottom, top = np.asarray(flank.x).tolist()
    return low, high, bottom, top


def _seen_from_tip(solid: SolidTable, profile: MachineProfile) -> HullTable:
    """A solid of the machine frame in the tool frame; which way its X points is nobody's business here."""
    axis = profile.tool_axis
    aside = np.linalg.svd(axis[None])[2][1]
    turn = np.stack([aside, np.cross(axis, aside), axis])
    points = (_corners(solid) - profile.tip) @ turn.T
    return HullTable(shape="hull", name=solid.name, points=tuple(map(tuple, points.tolist())))


def _corners(solid: SolidTable) -> FloatArray:
    """(n, 3) mm whose hull holds the solid, in its own frame."""
    if isinstance(solid, HullTable):
        return np.array(solid.points)
    if isinstance(solid, BoxTable):
        return np.array(np.meshgrid(*zip(solid.min, solid.max, strict=True), indexing="ij")).reshape(3, -1).T
    if solid.shape == "cylinder":
        radii = (solid.diameter / 2, solid.diameter / 2)
    else:
        radii = (solid.bottom_diameter / 2, solid.top_diameter / 2)
    angle = np.arange(CORNERS) * 2 * np.pi / CORNERS
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / CORNERS)
    rings = [
        np.column_stack([ring * r + solid.center, np.full(CORNERS, z)])
        for r, z in zip(radii, (solid.bottom, solid.top), strict=True)
    ]
    return np.concatenate(rings)
