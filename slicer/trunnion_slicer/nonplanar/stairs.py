"""The planar layers under a patch end in stairs: how thick the first non-planar layer has to be to fill them.

The pocket's floor is smooth, but what is printed in it is planar layers, whose tops step up and down by half a layer
about the floor. A layer is the section at its middle (`planar.py`), so the highest one under a point is known from
the floor alone. Laying the nominal thickness on stairs would leave voids behind each step and heap plastic in front.
"""

from collections.abc import Callable

import numpy as np
from trunnion_core.arrays import FloatArray
from trunnion_core.settings import PrintSettings

from trunnion_slicer.nonplanar.grid import build_grid
from trunnion_slicer.nonplanar.offset import Surfaces

THINNEST, THICKEST = 0.4, 1.6
"""Shares of the nominal thickness between which the layer stays. Stairs need half to one and a half; what is more
comes from places where the planar layers are not what they seem (a border, a part as thin as a layer)."""

NET = np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)]) / 3
"""Where the stairs are looked at, in bead widths around a point: a nozzle does not see a step before it is over it."""


def gap_over_stairs(stack: Surfaces, settings: PrintSettings) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """A function of points (n, 3) mm on the upper surface of the lowest layer, and normals (n, 3) there.

    It gives the mean vertical distance (n,) in mm from the points' height down to the planar layers, over a bead's
    width around them.
    """
    grid = build_grid(stack.surfaces[-1][stack.patch.faces])
    first, height = settings.first_height, settings.layer_height

    def gap(points: FloatArray, normals: FloatArray) -> FloatArray:
        around = points[:, None, :2] + settings.extrusion_width * NET
        triangle, weights = grid.locate(around.reshape(-1, 2))
        floor = (weights * grid.triangles[triangle][:, :, 2]).sum(axis=1)
        top = first + height * np.maximum(np.floor((floor - first) / height + 0.5), 0.0)
        thickness = points[:, 2] - top.reshape(len(points), -1).mean(axis=1)
        nominal = height / np.maximum(normals[:, 2], 0.1)
        return np.asarray(np.clip(thickness, THINNEST * nominal, THICKEST * nominal))

    return gap
