"""Layers of unordered beads become one toolpath: order, travels, speeds."""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import MeshError
from trunnion_core.layers import Bead, LayerStack
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_slicer.order import ordered
from trunnion_slicer.printed import PrintedHeights
from trunnion_slicer.travel import Travel, arrival, travel


def to_toolpath(stack: LayerStack, settings: PrintSettings) -> Toolpath:
    """Every bead of the stack once, layer by layer, with the travels between them.

    Row 0 is a travel; `layer` counts stack.layers, and a travel belongs to the layer of the bead it leads to. The
    wanted speed of a row is that of its role, on the first layer at most `first_layer_speed`. Raises MeshError when
    there is no bead at all.
    """
    beads = [bead for layer in stack.layers for bead in layer.beads]
    if not beads:
        raise MeshError("part: no bead fits into it, it should be at least one extrusion width across somewhere")
    printed = _empty_grid(beads)
    rows = _Rows(settings)
    seams = np.empty((0, 3))
    tip = np.zeros(3)
    last: Bead | None = None
    for index, layer in enumerate(stack.layers):
        plan = ordered(layer, tip, seams)
        home = -1
        for bead, island in zip(plan.beads, plan.island, strict=True):
            if last is None:
                rows.move(arrival(bead, settings), index)
            else:
                within = plan.islands[island] if island == home and island >= 0 else None
                rows.move(travel(last, bead, within, printed, settings), index)
            rows.lay(bead, index)
            printed.add(bead)
            last, home, tip = bead, int(island), bead.points[-1]
        if len(plan.seams):
            seams = plan.seams
    return rows.toolpath()


def speeds(settings: PrintSettings) -> FloatArray:
    """(roles,) mm/s wanted of the tip, by the value of the role; 0 for roles that a toolpath does not have."""
    by_role = {
        Role.TRAVEL: settings.travel_speed,
        Role.LINK: settings.travel_speed,
        Role.SKIRT: settings.first_layer_speed,
        Role.OUTER_WALL: settings.external_perimeter_speed,
        Role.INNER_WALL: settings.perimeter_speed,
        Role.INFILL: settings.infill_speed,
        Role.SOLID_INFILL: settings.solid_infill_speed,
        Role.TOP_SOLID_INFILL: settings.top_solid_infill_speed,
        Role.NONPLANAR_OUTER_WALL: settings.nonplanar_speed,
        Role.NONPLANAR_INNER_WALL: settings.nonplanar_speed,
        Role.NONPLANAR_INFILL: settings.nonplanar_speed,
    }
    return np.array([by_role.get(role, 0.0) for role in Role])


class _Rows:
    """Collects the rows of a toolpath piece by piece."""

    def __init__(self, settings: PrintSettings) -> None:
        self._settings = settings
        self._pieces: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
        self._counts: list[int] = []
        self._roles: list[Role] = []
        self._layers: list[int] = []

    def move(self, way: Travel, layer: int) -> None:
        if len(way.points):
            nothing = np.zeros(len(way.points))
            self._append(way.points, way.tool_axes, nothing, nothing, way.role, layer)

    def lay(self, bead: Bead, layer: int) -> None:
        self._append(bead.points[1:], bead.tool_axes[1:], bead.width[1:], bead.height[1:], bead.role, layer)

    def toolpath(self) -> Toolpath:
        points, tool_axes, width, height = (np.concatenate(column) for column in zip(*self._pieces, strict=True))
        role = np.repeat(np.array(self._roles, dtype=np.int64), self._counts)
        layer = np.repeat(np.array(self._layers, dtype=np.int64), self._counts)
        speed = speeds(self._settings)[role]
        first = (layer == 0) & (width > 0)
        speed[first] = np.minimum(speed[first], self._settings.first_layer_speed)
        return Toolpath(points, tool_axes, width, height, role, layer, speed)

    def _append(
        self, points: FloatArray, axes: FloatArray, width: FloatArray, height: FloatArray, role: Role, layer: int
    ) -> None:
        self._pieces.append((points, axes, width, height))
        self._counts.append(len(points))
        self._roles.append(role)
        self._layers.append(layer)


def _empty_grid(beads: list[Bead]) -> PrintedHeights:
    """A grid that holds every bead."""
    low = np.min([bead.points[:, :2].min(axis=0) for bead in beads], axis=0)
    high = np.max([bead.points[:, :2].max(axis=0) for bead in beads], axis=0)
    margin = max(float(bead.width.max()) for bead in beads)
    return PrintedHeights(low - margin, high + margin)
