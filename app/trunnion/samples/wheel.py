"""A steering wheel: a round ring, three arched spokes and a domed hub, whose tops are patches at different heights."""

from typing import Any

import numpy as np

from trunnion.samples._solids import dome, from_manifold, sheet, to_manifold
from trunnion_core.arrays import FloatArray
from trunnion_core.mesh import Mesh

SETTINGS: dict[str, Any] = {}

RING_RADIUS, RING_HALF, HUB_RADIUS = 17.5, 3.4, 6.0
"""mm: middle of the ring, half its width, and the hub."""


def make() -> Mesh:
    """42 mm across and 9.2 mm high; ring, spokes and hub top out at 9.2, 6.4 and 8 mm: a nozzle fits between them."""
    from manifold3d import CrossSection, Manifold, OpType

    section = CrossSection([_profile()])
    ring = Manifold.revolve(section, 132)
    spoke = to_manifold(_spoke())
    spokes = [spoke.rotate([0.0, 0.0, turn]) for turn in (0.0, 120.0, 240.0)]
    return from_manifold(Manifold.batch_boolean([ring, to_manifold(_hub()), *spokes], OpType.Add))


def _profile() -> FloatArray:
    """The ring's section: upright flanks and an arched top."""
    s = np.linspace(1.0, -1.0, 19)
    top = 6.2 + 3.0 * np.sqrt(1.0 - (0.96 * s) ** 2)
    arch = np.column_stack([RING_RADIUS + RING_HALF * s, top])
    feet = np.array([[RING_RADIUS - RING_HALF, 0.0], [RING_RADIUS + RING_HALF, 0.0]])
    return np.vstack([feet, arch])


def _spoke() -> Mesh:
    x, y = np.meshgrid(np.linspace(4.0, 15.6, 20), np.linspace(-2.6, 2.6, 11), indexing="ij")
    return sheet(x, y, 6.2 - 0.08 * y * y + 0.006 * (x - 10.0) ** 2)


def _hub() -> Mesh:
    angle = np.arange(64) * (2 * np.pi / 64)
    outline = HUB_RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    return dome(outline, lambda x, y: 8.0 - 1.1 * (x * x + y * y) / HUB_RADIUS**2, rings=10)
