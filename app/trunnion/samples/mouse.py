"""The body of a computer mouse: a convex back, the split between its keys, and a hole for the wheel."""

from typing import Any

import numpy as np

from trunnion.samples._solids import cut, dome
from trunnion_core.arrays import FloatArray
from trunnion_core.mesh import Mesh

SETTINGS: dict[str, Any] = {}


def make() -> Mesh:
    """44 x 27 x 12 mm; the split is 1.2 mm wide and 2.5 mm deep, the hole 7 x 4 mm and goes through."""
    from manifold3d import CrossSection, Manifold

    angle = np.arange(176) * (2 * np.pi / 176)
    cosine, sine = np.cos(angle), np.sin(angle)
    rounded = (np.abs(cosine) ** 2.6 + np.abs(sine) ** 2.6) ** (-1 / 2.6)
    outline = np.column_stack([22.0 * rounded * cosine, 13.4 * rounded * sine * (1 - 0.06 * rounded * cosine)])
    body = dome(outline, _height, rings=34)
    slot = CrossSection.square([3.0, 4.0], center=True).offset(0.0).hull()
    ends = [CrossSection.circle(2.0, 32).translate([9.5 + shift, 0.0]) for shift in (-1.5, 1.5)]
    hole = Manifold.extrude(CrossSection.batch_hull([slot.translate([9.5, 0.0]), *ends]), 40.0)
    split = Manifold.cube([24.0, 1.2, 20.0]).translate([12.4, -0.6, 6.2])
    return cut(body, hole.translate([0.0, 0.0, -5.0]), split)


def _height(x: FloatArray, y: FloatArray) -> FloatArray:
    """Highest behind the middle, falling to the keys in front, steep all around."""
    u, v = x / 22.0, y / (13.4 * (1 - 0.06 * x / 22.0))
    radius = (np.abs(u) ** 2.6 + np.abs(v) ** 2.6) ** (1 / 2.6)
    fall = np.clip(1.0 - radius**2.6, 0.0, 1.0)
    return np.asarray(3.0 + fall**0.62 * (8.6 - 1.9 * u - 1.6 * u * u))
