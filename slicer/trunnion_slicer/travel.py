"""Moves from the end of one bead to the start of the next that never plough through what is printed.

A short hop inside one island is a link: straight, unretracted, at the height of the layer (on a curved layer lifted,
because a chord of a dome runs inside it). Everything else lifts along the tool axis, rises upright until it is clear
of everything printed under its way, crosses, turning the tool up there, and comes down in the same manner.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon

from trunnion_core.arrays import FloatArray
from trunnion_core.layers import Bead
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.printed import PrintedHeights

CORRIDOR = 1.0
"""mm to both sides of a crossing that have to be clear: half a bead and the flat of the nozzle."""


@dataclass(frozen=True, eq=False)
class Travel:
    """Rows between two beads, the last of which ends at the start of the next bead."""

    points: FloatArray
    """(n, 3) mm."""
    tool_axes: FloatArray
    """(n, 3) unit."""
    role: Role


def travel(
    last: Bead, following: Bead, within: Polygon | None, printed: PrintedHeights, settings: PrintSettings
) -> Travel:
    """The way from the end of `last` to the start of `following`; no rows where they meet.

    `within` is the island both beads lie in (see `order.OrderedLayer`), None when they do not share one.
    """
    start, end = last.points[-1], following.points[0]
    from_axis, to_axis = last.tool_axes[-1], following.tool_axes[0]
    if (start == end).all() and (from_axis == to_axis).all():
        return Travel(np.empty((0, 3)), np.empty((0, 3)), Role.LINK)
    lift = settings.retract_lift
    if within is not None and _may_link(last, following, within, settings):
        if not following.role.nonplanar:
            return _rows(Role.LINK, start, from_axis, (end, to_axis))
        over, down = start + lift * from_axis, end + lift * to_axis
        if printed.highest(over, down, 0.0) <= min(over[2], down[2]):
            return _rows(Role.LINK, start, from_axis, (over, from_axis), (down, to_axis), (end, to_axis))
    up, down = start + lift * from_axis, end + lift * to_axis
    clear = max(printed.highest(start, end, CORRIDOR) + lift, up[2], down[2])
    return _rows(
        Role.TRAVEL,
        start,
        from_axis,
        (up, from_axis),
        (np.array([up[0], up[1], clear]), from_axis),
        (np.array([down[0], down[1], clear]), to_axis),
        (down, to_axis),
        (end, to_axis),
    )


def arrival(following: Bead, settings: PrintSettings) -> Travel:
    """The very first rows: to a place above the start of the first bead, and down to it."""
    end, axis = following.points[0], following.tool_axes[0]
    over = end + settings.retract_lift * axis
    rows = [over, end] if settings.retract_lift > 0 else [end]
    return Travel(np.array(rows), np.tile(axis, (len(rows), 1)), Role.TRAVEL)


def _may_link(last: Bead, following: Bead, within: Polygon, settings: PrintSettings) -> bool:
    """Whether the straight way is short or hidden under the next layers, and stays inside the island."""
    start, end = last.points[-1], following.points[0]
    hidden = last.role == following.role == Role.INFILL
    if not hidden and np.linalg.norm(end - start) >= settings.retract_before_travel:
        return False
    way = shapely.linestrings(np.array([start[:2], end[:2]]))
    return bool(shapely.covers(within, way))


def _rows(role: Role, start: FloatArray, axis: FloatArray, *stops: tuple[FloatArray, FloatArray]) -> Travel:
    """Rows through the stops, without those that change nothing."""
    points: list[FloatArray] = []
    axes: list[FloatArray] = []
    here, lean = start, axis
    for point, tool_axis in stops:
        if np.abs(point - here).max() > 1e-9 or np.abs(tool_axis - lean).max() > 1e-9:
            points.append(point)
            axes.append(tool_axis)
            here, lean = point, tool_axis
    if not points:
        return Travel(np.empty((0, 3)), np.empty((0, 3)), role)
    points[-1], axes[-1] = stops[-1]
    return Travel(np.array(points), np.array(axes), role)
