"""The planar layers under a patch end in stairs: how thick the first non-planar layer has to be to fill them.

The pocket's floor is smooth, but what is printed in it is planar beads, whose tops step up and down by half a layer
about the floor, with grooves, round edges and holes. Laying the nominal thickness on them would leave voids behind
each step and heap plastic in front, and all that is missing would be missing on the skin.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import binary_erosion, map_coordinates, uniform_filter

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.bead import bead_spacing, bead_width
from trunnion_core.layers import Layer
from trunnion_core.settings import PrintSettings
from trunnion_slicer.nonplanar.grid import Grid, build_grid
from trunnion_slicer.nonplanar.offset import Surfaces
from trunnion_slicer.nonplanar.tops import Tops, bead_tops

THINNEST, THICKEST = 0.25, 1.8
"""Shares of the nominal thickness between which the layer stays. Stairs need 0.3 to 1.3, their round edges and
grooves a little more; what is still more comes from places where planar layers end (a border, a hole)."""

DEEPEST, HIGHEST = 2.0, 0.6
"""In layer heights: how far below and above the floor planar beads count as what the layer lies on."""

SETTLING = 12
"""Layers after which grooves are as deep as they get, to a thousandth of a millimetre."""

ON_FLOOR = 1e-3
"""mm. A place this near to a triangle of the floor, seen from above, is over it."""

ON_BORDER = 0.01
"""mm. A place this near to where the floor ends is not over it: the beads below end there as well, and what lies beside
them is no room to fill."""


def gap_over_stairs(
    stack: Surfaces, planar: Sequence[Layer], settings: PrintSettings
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """A function of points (n, 3) mm on the upper surface of the lowest layer, and normals (n, 3) there.

    It gives the mean vertical distance (n,) in mm from the points' height down to the beads of the `planar` layers,
    over a bead's width around them, less the groove that the layer leaves open on its own upper side.
    """
    height, width = settings.layer_height, settings.extrusion_width
    corners = stack.surfaces[-1]
    floor = build_grid(corners[stack.patch.faces])
    below, above = DEEPEST * height, HIGHEST * height
    low = corners.min(axis=0) - np.array([width, width, below + height])
    high = corners.max(axis=0) + np.array([width, width, above])
    groove = groove_depth(width, height)
    tops = bead_tops(planar, low, high, width, groove)
    step = _step(tops, floor, below, above, width)

    def gap(points: FloatArray, normals: FloatArray) -> FloatArray:
        triangle, weights = floor.locate(points[:, :2])
        base = (weights * floor.triangles[triangle][:, :, 2]).sum(axis=1)
        place = ((points[:, :2] - tops.low) / tops.cell).T
        cosine = np.maximum(normals[:, 2], 0.1)
        thickness = points[:, 2] - base - map_coordinates(step, place, order=1, mode="nearest") - groove / cosine
        return np.asarray(np.clip(thickness, THINNEST * height / cosine, THICKEST * height / cosine))

    return gap


def groove_depth(width: float, height: float) -> float:
    """Mean depth in mm of the grooves that a layer of beads `width` mm wide leaves, `height` mm above the last layer.

    A bead also fills the grooves of the layer below, which takes plastic from its sides; so its own grooves are deeper
    than those of a first layer of ideal stadiums. Layer upon layer the depth settles where both are the same.
    """
    pitch = bead_spacing(width, height)
    area = np.asarray(pitch * height)
    depth = 0.0
    for _ in range(SETTLING):
        deep = height + depth
        radius = deep / 2
        half = (pitch - float(bead_width(area, np.asarray(deep))) + deep) / 2
        half = min(half, radius)
        under_arc = (half * np.sqrt(radius**2 - half**2) + radius**2 * np.arcsin(half / radius)) / 2
        depth = float(2 * (radius * half - under_arc) / pitch)
    return depth


def _step(tops: Tops, floor: Grid, below: float, above: float, width: float) -> FloatArray:
    """(nx, ny) mm: how much higher than the floor the beads stand, mean over a square as wide as a bead.

    Only places over the floor have a say; beads beyond the limits count as if they were at them.
    """
    centres = tops.centres
    triangle, weights = floor.locate(centres)
    foot = np.einsum("nk,nkd->nd", weights, floor.triangles[triangle])
    over = _well_over(centres, foot, floor, tops.height.shape)
    step = np.clip(tops.height - foot[:, 2].reshape(over.shape), -below, above)
    cells = max(round(width / tops.cell), 1)
    share = uniform_filter(over.astype(np.float64), cells, mode="constant")
    total = uniform_filter(np.where(over, step, 0.0), cells, mode="constant")
    return np.asarray(np.divide(total, share, out=np.zeros_like(total), where=share > 1e-6))


def _well_over(centres: FloatArray, foot: FloatArray, floor: Grid, shape: tuple[int, ...]) -> BoolArray:
    """`shape`: whether the floor is under places (n, 2) and just beside them; `foot` (n, 3) are its nearest points."""
    over = (np.linalg.norm(foot[:, :2] - centres, axis=1) < ON_FLOOR).reshape(shape)
    edge = np.flatnonzero(over & ~binary_erosion(over))
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        beside = centres[edge] + np.array([x, y]) * ON_BORDER
        triangle, weights = floor.locate(beside)
        there = np.einsum("nk,nkd->nd", weights, floor.triangles[triangle])
        off = np.linalg.norm(there[:, :2] - beside, axis=1) >= ON_FLOOR
        over.ravel()[edge[off]] = False
    return np.asarray(over)
