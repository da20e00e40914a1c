"""A solid mesh becomes planar layers of unordered beads: walls, solid skins, infill.

A layer is the section at the middle of its height, so that slopes are neither systematically too fat nor too thin.
What is not covered by the sections of all of the next `top_solid_layers` layers, or does not rest on all of the last
`bottom_solid_layers`, is solid; the rest of the inside gets the sparse pattern.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.bead import bead_spacing, bead_width
from trunnion_core.errors import MeshError, PlacementError
from trunnion_core.findings import Finding
from trunnion_core.layers import Bead, Layer
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.tolerance import WELD_DISTANCE
from trunnion_slicer.beads import flat_bead
from trunnion_slicer.infill import fill, require
from trunnion_slicer.remarks import lost, unsupported
from trunnion_slicer.sections import sections
from trunnion_slicer.skirt import skirt
from trunnion_slicer.thin import bare, gaps, middle_lines
from trunnion_slicer.walls import as_multipolygon, offset, opened, rings, wall_lines
from trunnion_slicer.wedges import laid_length, shared

Areas = NDArray[np.object_]
"""(n,) regions of shapely."""

FLOW_BAND = (0.8, 1.25)
"""How far the bead of solid infill may depart from its nominal section so that an island gets exactly its volume."""

SLIVER = 0.1
"""mm. Exposed strips narrower than twice this are the stairs of a steep wall, which the walls cover."""

NARROW_TOP = 3.0
"""Spacings. Strips of top surface narrower than this are filled in one go with the solid infill beside them."""

NARROW_FILL = 0.6
"""Spacings. Where the lines of a zig-zag would be shorter than this, one bead along the middle does better."""


@dataclass(frozen=True, eq=False)
class Collar:
    """Where stairs must not stand high: around skin that is printed later, the nozzle's flat reaches over them."""

    area: MultiPolygon
    """Seen from above."""
    low: float
    high: float
    """mm, from and up to which height stairs are kept low."""
    most: float
    """mm that a stair may stand above the part's surface there."""


@dataclass(frozen=True, eq=False)
class PlanarPlan:
    """Planar layers from the bed up, and what is worth saying about them."""

    layers: tuple[Layer, ...]
    findings: tuple[Finding, ...]


def planar_layers(mesh: Mesh, settings: PrintSettings) -> list[Layer]:
    """The layers of `plan_planar`."""
    return list(plan_planar(mesh, settings).layers)


def plan_planar(mesh: Mesh, settings: PrintSettings, collar: Collar | None = None) -> PlanarPlan:
    """Layers from the bed up, each bead's points on the layer's upper plane, the tool upright.

    The mesh is solid and stands on z = 0. The first layer carries the skirt. Layers without material inside the part
    stay, empty. In the collar, sections are taken so high that no stair stands out more than it allows. Raises
    PlacementError when the part does not stand on the bed, MeshError when it is thinner than half a layer,
    SettingsError for an unknown pattern.
    """
    require(settings.fill_pattern)
    tops, heights = _levels(mesh, settings)
    slices = sections(mesh, tops - heights / 2)
    if slices[0].is_empty:
        raise MeshError("mesh: the first layer is empty, the part should have a surface to stand on at z = 0")
    if collar is not None and not collar.area.is_empty:
        _keep_low(mesh, slices, tops, heights, collar)
    solid, top = _skins(slices, settings)
    layers = []
    for index, section in enumerate(slices):
        z, height = float(tops[index]), float(heights[index])
        width = settings.first_width if index == 0 else settings.extrusion_width
        pass_ = _Pass(index, z, height, width, bead_spacing(width, height), settings)
        beads = skirt(section, settings) if index == 0 else []
        lines = wall_lines(section, settings.perimeters, width, pass_.spacing)
        for number, line in enumerate(lines):
            role = Role.INNER_WALL if number else Role.OUTER_WALL
            beads += [flat_bead(ring, z, width, height, role) for ring in rings(line)]
        for number, gap in enumerate(gaps(section, lines, width, pass_.spacing)):
            beads += _thin(gap, Role.SOLID_INFILL if number else Role.OUTER_WALL, pass_)
        inside = offset(lines[-1], -pass_.spacing / 2) if lines else section
        beads += _inside(inside, solid[index], top[index], pass_)
        layers.append(Layer("planar", z, height, tuple(beads)))
    return PlanarPlan(tuple(layers), lost(slices, layers) + unsupported(layers))


def _keep_low(mesh: Mesh, slices: list[MultiPolygon], tops: FloatArray, heights: FloatArray, collar: Collar) -> None:
    """Take out of the sections what stands out too far in the collar."""
    up = heights / 2 - collar.most
    rows = np.flatnonzero((tops >= collar.low) & (tops - heights <= collar.high) & (up > 0))
    higher = sections(mesh, (tops - heights / 2 + up)[rows])
    for row, section in zip(rows.tolist(), higher, strict=True):
        standing = shapely.intersection(shapely.difference(slices[row], section), collar.area)
        if not standing.is_empty:
            left = shapely.get_parts(as_multipolygon(shapely.difference(slices[row], standing)))
            crumbs = shapely.is_empty(shapely.buffer(left, -SLIVER)) & ~shapely.covered_by(left, section)
            slices[row] = shapely.orient_polygons(MultiPolygon(list(left[~crumbs])))


@dataclass(frozen=True)
class _Pass:
    """What is the same for every bead inside one layer."""

    index: int
    z: float
    height: float
    width: float
    spacing: float
    settings: PrintSettings

    @property
    def angle(self) -> float:
        """Direction of the infill in rad, turned by a quarter on every other layer."""
        return float(np.radians(self.settings.fill_angle + 90.0 * (self.index % 2)))


def _levels(mesh: Mesh, settings: PrintSettings) -> tuple[FloatArray, FloatArray]:
    """Upper plane and height of every layer; the last is the last whose middle is inside the part."""
    low, high = mesh.bounds[:, 2]
    first, other = settings.first_height, settings.layer_height
    if low < -first / 2 or low > first / 2:
        raise PlacementError(f"part: its lowest point is at z = {low:.3f} mm, it should stand on the bed at z = 0")
    if high <= first / 2:
        raise MeshError(
            f"part: it is {high - low:.3f} mm high, less than half the first layer of {first:g} mm: nothing to print"
        )
    count = 1 + max(0, int(np.ceil((high - first) / other - 0.5 - 1e-9)))
    heights = np.full(count, other)
    heights[0] = first
    return np.asarray(first + other * np.arange(count), dtype=np.float64), heights


def _skins(slices: list[MultiPolygon], settings: PrintSettings) -> tuple[list[MultiPolygon], list[MultiPolygon]]:
    """Of every section: what has to be solid, and what of it faces up."""
    here = np.array(slices, dtype=object)
    above = _covers(here, settings.top_solid_layers, up=True)
    below = _covers(here, settings.bottom_solid_layers, up=False)
    nothing = np.full(len(here), MultiPolygon(), dtype=object)
    top = _without(here, above[0]) if above else nothing
    roof = _without(here, above[-1]) if above else nothing
    floor = _without(here, below[-1]) if below else nothing
    solid = shapely.union(roof, floor)
    return [as_multipolygon(part) for part in solid], [as_multipolygon(part) for part in top]


def _covers(here: Areas, count: int, *, up: bool) -> list[Areas]:
    """What 1, 2, ... `count` neighbours on one side of every section have in common."""
    covers: list[Areas] = []
    for distance in range(1, min(count, len(here)) + 1):
        neighbour = np.full(len(here), MultiPolygon(), dtype=object)
        if up:
            neighbour[:-distance] = here[distance:]
        else:
            neighbour[distance:] = here[:-distance]
        if covers:
            cover, differ = covers[-1].copy(), ~_same(covers[-1], neighbour)
            cover[differ] = shapely.intersection(cover[differ], neighbour[differ])
            neighbour = cover
        covers.append(neighbour)
    return covers


def _without(areas: Areas, covers: Areas) -> Areas:
    bare = np.full(len(areas), MultiPolygon(), dtype=object)
    differ = ~_same(areas, covers)
    bare[differ] = shapely.difference(areas[differ], covers[differ])
    return bare


def _same(areas: Areas, others: Areas) -> BoolArray:
    """Where both are the same vertex by vertex, as sections of upright walls are: asking is cheaper than clipping."""
    return np.asarray(shapely.equals_exact(areas, others, WELD_DISTANCE))


def _inside(inside: MultiPolygon, solid: MultiPolygon, top: MultiPolygon, pass_: _Pass) -> list[Bead]:
    """Beads of everything within the walls of a layer."""
    if inside.is_empty:
        return []
    settings = pass_.settings
    if settings.fill_density >= 100:
        solid_part, sparse = inside, MultiPolygon()
    else:
        exposed = opened(inside.intersection(solid), SLIVER)
        sparse = opened(inside.difference(offset(exposed, pass_.width)), pass_.width)
        solid_part = as_multipolygon(inside.difference(sparse)) if not exposed.is_empty else MultiPolygon()
        sparse = inside if exposed.is_empty else sparse
    upper = opened(inside.intersection(top), NARROW_TOP * pass_.spacing / 2)
    under = opened(solid_part.difference(upper), pass_.spacing) if not upper.is_empty else solid_part
    upper = as_multipolygon(solid_part.difference(under)) if not upper.is_empty else upper
    beads = _solid(upper, Role.TOP_SOLID_INFILL, pass_) + _solid(under, Role.SOLID_INFILL, pass_)
    if settings.fill_density > 0 and not sparse.is_empty:
        pitch = pass_.spacing * 100 / settings.fill_density
        lines = fill(settings.fill_pattern, _line_area(sparse, pass_), pitch, pass_.angle, fit=False)
        area = pass_.spacing * pass_.height
        shares = [shared(line, pass_.spacing) for line in lines]
        beads += [_shared_bead(line, share * area, Role.INFILL, pass_) for line, share in shares]
    return beads


def _solid(region: MultiPolygon, role: Role, pass_: _Pass) -> list[Bead]:
    """Beads that fill `region`; every island of lines gets the plastic of its area, within FLOW_BAND."""
    beads = []
    inset = _inset(pass_)
    islands = opened(_line_area(region, pass_), NARROW_FILL * pass_.spacing / 2)
    for island in islands.geoms:
        lines = fill("rectilinear", MultiPolygon([island]), pass_.spacing, pass_.angle)
        shares = [shared(line, pass_.spacing) for line in lines]
        length = sum(laid_length(line, share) for line, share in shares)
        if length == 0:
            continue
        flow = offset(island, inset).area / (length * pass_.spacing)
        area = np.clip(flow, *FLOW_BAND) * pass_.spacing * pass_.height
        beads += [_shared_bead(line, share * area, role, pass_) for line, share in shares]
    return beads + _thin(bare(region, offset(islands, inset), pass_.width), Role.SOLID_INFILL, pass_)


def _shared_bead(line: FloatArray, area: FloatArray, role: Role, pass_: _Pass) -> Bead:
    """A bead over `line` (n, 2) whose pieces have sections of `area` (n,) mm²."""
    return flat_bead(line, pass_.z, bead_width(area, np.full(len(area), pass_.height)), pass_.height, role)


def _thin(region: MultiPolygon, role: Role, pass_: _Pass) -> list[Bead]:
    """Single beads along the middle of narrow places, each with the plastic of the place it fills."""
    beads = []
    for line, wide in middle_lines(region, pass_.width):
        widths = bead_width(wide * pass_.height, np.full(len(wide), pass_.height))
        bead = flat_bead(line, pass_.z, pass_.width, pass_.height, role)
        pieces = np.concatenate([[widths[:2].mean()], (widths[1:] + widths[:-1]) / 2])
        beads.append(Bead(bead.points, bead.tool_axes, pieces, bead.height, role))
    return beads


def _line_area(region: MultiPolygon, pass_: _Pass) -> MultiPolygon:
    """Where the centre lines of infill may lie in `region`: half a bead inside, but for the overlap with the wall."""
    return offset(region, -_inset(pass_))


def _inset(pass_: _Pass) -> float:
    return pass_.spacing / 2 - pass_.settings.infill_overlap / 100 * pass_.width
