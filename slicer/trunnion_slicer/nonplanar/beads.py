"""Surfaces become beads: flat paths lifted, with the width that makes every piece's volume that of its place."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from shapely.geometry import MultiPolygon

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.bead import bead_width
from trunnion_core.layers import Bead, Layer
from trunnion_core.settings import PrintSettings
from trunnion_slicer.nonplanar.clear import kept_clear
from trunnion_slicer.nonplanar.fair import faired, refined
from trunnion_slicer.nonplanar.field import even_axes, normals_at
from trunnion_slicer.nonplanar.footprint import footprint
from trunnion_slicer.nonplanar.grid import Grid, build_grid
from trunnion_slicer.nonplanar.offset import Surfaces
from trunnion_slicer.nonplanar.paths import FlatPath, flat_paths
from trunnion_slicer.nonplanar.project import AXIS_CHORD, Lifted, lift
from trunnion_slicer.nonplanar.smooth import into_cone, smoothed
from trunnion_slicer.nonplanar.stairs import gap_over_stairs

if TYPE_CHECKING:
    from trunnion_slicer.nonplanar.access import Reach

BETWEEN_DEG = 0.05
"""Degrees of the smoothing's cone kept for the way between two rows, where axis and normal turn unequally."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """The upper surface of one layer of one patch, ready to be drawn on."""

    stack: Surfaces
    layer: int
    """0 is the outermost."""
    grid: Grid
    outline: MultiPolygon

    @property
    def top(self) -> float:
        """mm, its highest point."""
        return float(self.stack.surfaces[self.layer][:, 2].max())


def sheet(stack: Surfaces, layer: int) -> Sheet:
    """Layer `layer` of a stack, 0 the outermost."""
    surface = stack.surfaces[layer]
    grid = build_grid(surface[stack.patch.faces])
    return Sheet(stack, layer, grid, footprint(surface, stack.patch.border, grid))


def beads_of(on: Sheet, planar: Sequence[Layer], settings: PrintSettings, reach: "Reach") -> list[Bead]:
    """Every bead of a layer on one patch: walls, then infill. The lowest layer lies on the beads of `planar`.

    The patch is one of the region of `reach`, whose normals the tool follows; where they are smoothed it keeps clear of
    the scene there.
    """
    paths = flat_paths(on.stack, on.layer, on.outline, settings)
    if not paths:
        return []
    faces = on.stack.patch.faces
    density = on.stack.densities(on.layer)
    lines = [path.points for path in paths]
    lowest = on.layer == on.stack.layers - 1
    stairs = gap_over_stairs(on.stack, planar, settings) if lowest else None
    normals = reach.normals[on.stack.patch.rows]
    lifted = lift(lines, on.grid, normals, density[faces], settings.extrusion_width, stairs)
    axes = lifted.axes
    if settings.nonplanar_smoothing > 0 and settings.nonplanar_tool_axis == "normal":
        lifted = _exact_normals(refined(lifted), on.grid, normals)
        axes = _smoothed(lifted, on, normals, reach, settings)
        lifted = replace(lifted, points=faired(lifted.points, lifted.starts))
    height = _thickness(lifted) if lowest else np.full(len(axes), settings.layer_height)
    if settings.nonplanar_tool_axis == "vertical":
        height = height / np.maximum(lifted.axes[:, 2], 0.1)
        axes = np.tile([0.0, 0.0, 1.0], (len(axes), 1))
    return _beads(paths, lifted, axes, height)


def _exact_normals(lifted: Lifted, grid: Grid, normals: FloatArray) -> Lifted:
    """The paths with the surface's own normals where thinning left others; not where the tool turns at a crease."""
    exact, _ = normals_at(lifted.points[:, :2], grid, normals)
    thinned = np.linalg.norm(exact - lifted.axes, axis=1) < 2 * AXIS_CHORD
    return replace(lifted, axes=np.where(thinned[:, None], exact, lifted.axes))


def _smoothed(lifted: Lifted, on: Sheet, normals: FloatArray, reach: "Reach", settings: PrintSettings) -> FloatArray:
    """Tool axes (n, 3) unit within `nonplanar_smoothing` of the paths' normals, no nearer to the part than these."""
    cone = float(np.radians(max(settings.nonplanar_smoothing - BETWEEN_DEG, 0.0)))
    wanted = into_cone(even_axes(lifted.points, on.grid, normals, cone), lifted.axes, cone)
    axes = smoothed(lifted.points, lifted.axes, wanted, lifted.starts, cone)
    if reach.scene is None:
        return axes
    gap = partial(reach.scene.gap, depth=on.layer * settings.layer_height)
    return kept_clear(lifted.points, axes, lifted.axes, lifted.starts, gap)


def _thickness(lifted: Lifted) -> FloatArray:
    """(n,) mm along the normal, of the layer under the piece that ends at each row."""
    vertical = lifted.volume / np.maximum(lifted.run, 1e-9)
    first = lifted.starts[:-1]
    vertical[first] = vertical[np.minimum(first + 1, len(vertical) - 1)]
    return np.asarray(vertical * lifted.axes[:, 2])


def _beads(paths: Sequence[FlatPath], lifted: Lifted, axes: FloatArray, height: FloatArray) -> list[Bead]:
    starts = lifted.starts
    length = np.zeros(len(axes))
    length[1:] = np.linalg.norm(np.diff(lifted.points, axis=0), axis=1)
    share = np.concatenate(
        [_share(path, lifted.run[a:b]) for path, a, b in zip(paths, starts, starts[1:], strict=False)]
    )
    # Where a tiny bend was dropped the bead is as thick as on the bend, not fatter for the shorter way.
    area = lifted.volume * share / np.maximum(np.maximum(length, lifted.run), 1e-9)
    first: IntArray = starts[:-1]
    area[first] = area[np.minimum(first + 1, len(area) - 1)]
    width = bead_width(area, height)
    return [
        Bead(lifted.points[a:b], axes[a:b], width[a:b], height[a:b], path.role)
        for path, a, b in zip(paths, starts[:-1], starts[1:], strict=True)
        if b - a >= 2
    ]


def _share(path: FlatPath, run: FloatArray) -> FloatArray:
    """Mean share (n,) of the path on pieces that are `run` (n,) mm long, seen from above, one after the other."""
    length = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(length))
    filled = np.append(0.0, np.cumsum(length * path.share[1:]))
    ends = np.cumsum(run)
    parts = np.diff(np.interp(ends, along, filled), prepend=0.0)
    return np.asarray(np.where(run > 0, parts / np.maximum(run, 1e-12), path.share[-1]))
