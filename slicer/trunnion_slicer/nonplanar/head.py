"""The bodies of a print head become solids of revolution about the tool axis, which hold however the machine turns.

A machine reaches a tool axis with its rotary joints in different ways, and some turn the head about its own axis. So a
box, or a body off the axis, is widened to the smallest solid of revolution about the tool axis that holds it.
"""

from collections.abc import Sequence

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile_file import BoxTable, ConeTable, CylinderTable, SolidTable


def frusta(head: Sequence[SolidTable]) -> FloatArray:
    """(b, 4) mm of each body in the tool frame: lower and upper end along the tool axis, radius at each."""
    return np.array([_frustum(solid) for solid in head], dtype=np.float64).reshape(-1, 4)


def _frustum(solid: SolidTable) -> tuple[float, float, float, float]:
    if isinstance(solid, BoxTable):
        x = max(abs(solid.min[0]), abs(solid.max[0]))
        y = max(abs(solid.min[1]), abs(solid.max[1]))
        radius = float(np.hypot(x, y))
        return solid.min[2], solid.max[2], radius, radius
    off = float(np.hypot(*solid.center))
    if isinstance(solid, CylinderTable):
        return solid.bottom, solid.top, off + solid.diameter / 2, off + solid.diameter / 2
    assert isinstance(solid, ConeTable)
    return solid.bottom, solid.top, off + solid.bottom_diameter / 2, off + solid.top_diameter / 2
