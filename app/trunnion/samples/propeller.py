"""A propeller: a domed hub and three blades whose twist eases from root to tip, solid down to the plate."""

from typing import Any

import numpy as np

from trunnion.samples._solids import dome, from_manifold, sheet, smooth_step, to_manifold
from trunnion_core.mesh import Mesh

SETTINGS: dict[str, Any] = {}

BLADES = 3
ROOT, TIP = 3.0, 21.0
"""mm from the axis: where a blade begins, inside the hub, and where it ends."""


def make() -> Mesh:
    """42 mm across and 9 mm high."""
    from manifold3d import Manifold, OpType

    blade = to_manifold(_blade())
    blades = [blade.rotate([0.0, 0.0, 360.0 / BLADES * k]) for k in range(BLADES)]
    return from_manifold(Manifold.batch_boolean([to_manifold(_hub()), *blades], OpType.Add))


def _blade() -> Mesh:
    """A sheet over (radius, chord), pitched by up to 30 degrees near the root and 12 at the tip."""
    along, across = 40, 19
    t, s = np.meshgrid(np.linspace(0.0, 1.0, along), np.linspace(-1.0, 1.0, across), indexing="ij")
    radius = ROOT + (TIP - ROOT) * t
    chord = 3.6 + 2.6 * np.sin(np.pi * np.clip(t, 0, 1)) - 1.4 * smooth_step((t - 0.55) / 0.45)
    sweep = 1.8 * t**2
    x, y = radius, s * chord + sweep
    pitch = np.radians(30.0 - 18.0 * t)
    z = 4.6 + s * chord * np.tan(pitch) * 0.9 + 0.35 * (1 - s * s)
    return sheet(x, y, z)


def _hub() -> Mesh:
    angle = np.arange(56) * (2 * np.pi / 56)
    outline = 5.2 * np.column_stack([np.cos(angle), np.sin(angle)])
    return dome(outline, lambda x, y: 9.0 - 1.6 * (x * x + y * y) / 5.2**2, rings=9)
