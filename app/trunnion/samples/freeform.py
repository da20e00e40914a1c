"""A free-form convex surface: a lopsided dome whose shallow skin ends at varying heights in steep flanks."""

from typing import Any

import numpy as np

from trunnion.samples._solids import dome
from trunnion_core.arrays import FloatArray
from trunnion_core.mesh import Mesh

SETTINGS: dict[str, Any] = {}


def make() -> Mesh:
    """40 x 32 x 11 mm."""
    angle = np.arange(168) * (2 * np.pi / 168)
    outline = np.column_stack([20.0 * np.cos(angle), (16.0 + 1.2 * np.cos(angle)) * np.sin(angle)])
    return dome(outline, _height, rings=34)


def _height(x: FloatArray, y: FloatArray) -> FloatArray:
    """A super-ellipsoid's cap on a 2 mm wall, its top tilted and leaning to one side."""
    u = x / 20.0
    v = y / (16.0 + 1.2 * u)
    fall = np.clip(1.0 - (u * u + v * v) ** 1.25, 0.0, 1.0)
    return np.asarray(2.0 + fall**0.8 * (7.6 + 1.7 * u + 1.1 * v - 0.9 * u * v))
