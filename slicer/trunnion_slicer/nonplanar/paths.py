"""The footprint of a surface becomes flat paths: walls along its border, a zig-zag inside.

Sections 2.10 and 2.11 of Shahid 2024, made in 2D; `project.py` lifts them. Lines that are `s` apart seen from above
are s / cos(slope across them) apart on the surface, so the pitch is drawn closer by that cosine. Every path carries
its share: how many mm of footprint it has to fill across its line, from which the volume of its bead follows.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon

from trunnion_core.arrays import FloatArray, check_array, freeze
from trunnion_core.bead import bead_spacing
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.infill import fill
from trunnion_slicer.nonplanar.normals import face_normals
from trunnion_slicer.nonplanar.offset import Surfaces
from trunnion_slicer.thin import bare, gaps, middle_lines
from trunnion_slicer.walls import as_multipolygon, offset, wall_lines, walls
from trunnion_slicer.wedges import laid_length, shared

STEEP_SHARE = 0.8
"""Share of a patch on which lines are no farther apart than nominal; on the steeper rest beads are laid wider."""


@dataclass(frozen=True, eq=False)
class FlatPath:
    """One path before it is lifted onto its surface."""

    points: FloatArray
    """(n, 2) mm; a closed one ends where it starts."""
    share: FloatArray
    """(n,) mm of footprint across the line that its bead fills, on the piece that ends at each point."""
    role: Role

    def __post_init__(self) -> None:
        check_array("share", self.share, (len(self.points),))
        freeze(self.points, self.share)


def flat_paths(stack: Surfaces, layer: int, outline: MultiPolygon, settings: PrintSettings) -> list[FlatPath]:
    """Walls, outermost first, then infill of one layer, whose footprint is `outline`."""
    width = settings.extrusion_width
    spacing = bead_spacing(width, settings.layer_height)
    squeeze = _border_cosine(stack, layer)
    count = settings.nonplanar_perimeters
    rings, _ = walls(outline, count, width * squeeze, spacing * squeeze)
    paths = [
        FlatPath(
            ring,
            np.full(len(ring), spacing * squeeze),
            Role.NONPLANAR_INNER_WALL if index else Role.NONPLANAR_OUTER_WALL,
        )
        for index, ring in rings
    ]
    angle = np.radians(settings.nonplanar_fill_angle + 90.0 * layer)
    pitch = spacing * _across_cosine(stack, layer, float(angle))
    # Inside the last wall's half of the spacing, or where there is no wall, of the bead's round side; then half of the
    # fill's own spacing, less what it is to run into the wall.
    edge = (width / 2 + (count - 0.5) * spacing) * squeeze if count else (width - spacing) / 2
    inset = pitch / 2 - settings.infill_overlap / 100 * width
    inside = offset(outline, -edge)
    narrow = gaps(outline, wall_lines(outline, count, width * squeeze, spacing * squeeze), width, spacing)
    covered = []
    for island in offset(inside, -inset).geoms:
        lines = fill(settings.fill_pattern, MultiPolygon([island]), pitch, float(angle))
        wedged = [shared(line, pitch) for line in lines]
        length = sum(laid_length(line, part) for line, part in wedged)
        if length > 0:
            whole = offset(island, inset)
            beside = shapely.union_all(shapely.buffer([LineString(line) for line in lines], pitch / 2))
            missed = bare(whole, as_multipolygon(beside), width)
            share = (whole.area - missed.area) / length
            paths += [FlatPath(line, part * share, Role.NONPLANAR_INFILL) for line, part in wedged]
            covered.append(whole)
            narrow.append(missed)
    narrow.append(bare(inside, as_multipolygon(shapely.union_all(covered)), width))
    return paths + [path for region in narrow for path in _single_lines(region, width)]


def _single_lines(region: MultiPolygon, width: float) -> list[FlatPath]:
    """One path along the middle of each place too narrow for more."""
    return [
        FlatPath(line, np.full(len(line), wide.mean()), Role.NONPLANAR_INFILL)
        for line, wide in middle_lines(region, width)
        if float(wide.mean()) > 0
    ]


def _across_cosine(stack: Surfaces, layer: int, angle: float) -> float:
    """Cosine of the slope across lines at `angle` rad that STEEP_SHARE of the surface does not exceed."""
    normal, area = face_normals(stack.surfaces[layer], stack.patch.faces)
    area = area * np.maximum(normal[:, 2], 0.0)
    across = normal @ np.array([-np.sin(angle), np.cos(angle), 0.0])
    cosine = normal[:, 2] / np.maximum(np.hypot(across, normal[:, 2]), 1e-12)
    order = np.argsort(-cosine)
    reached = np.searchsorted(np.cumsum(area[order]), STEEP_SHARE * area.sum())
    return float(max(cosine[order[min(reached, len(order) - 1)]], 0.1))


def _border_cosine(stack: Surfaces, layer: int) -> float:
    """Mean cosine of the slope across the border."""
    ends = stack.surfaces[layer][stack.patch.border]
    edge = ends[:, 1] - ends[:, 0]
    length = np.hypot(edge[:, 0], edge[:, 1])
    outward = np.stack([edge[:, 1], -edge[:, 0]], axis=1) / np.maximum(length, 1e-12)[:, None]
    normal = stack.patch.normals[stack.patch.border].mean(axis=1)
    across = (normal[:, :2] * outward).sum(axis=1)
    cosine = normal[:, 2] / np.maximum(np.hypot(across, normal[:, 2]), 1e-12)
    return float(max(np.average(cosine, weights=length + 1e-12), 0.1))
