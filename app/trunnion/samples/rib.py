"""A hard-edged part: flat faces that meet at angles, and a thin rib standing in the middle."""

from typing import Any

import numpy as np

from trunnion.samples._solids import from_manifold
from trunnion_core.mesh import Mesh

SETTINGS: dict[str, Any] = {}


def make() -> Mesh:
    """40 x 30 x 12 mm: roofs of 12, 18, 24 and 30 degrees about a ridge, and a rib of 1.6 x 18 mm."""
    from manifold3d import Manifold

    half_x, half_y, rim, top = 20.0, 15.0, 3.0, 9.0
    block = Manifold.cube([2 * half_x, 2 * half_y, top]).translate([-half_x, -half_y, 0.0])
    for degrees, direction, reach in ((18.0, (1, 0), half_x), (24.0, (-1, 0), half_x), (12.0, (0, 1), half_y)):
        block = block.trim_by_plane(_down(degrees, direction), _offset(degrees, reach, rim))
    block = block.trim_by_plane(_down(30.0, (0, -1)), _offset(30.0, half_y, rim))
    rib = Manifold.cube([1.6, 18.0, 11.0]).translate([-0.8, -9.0, 0.0])
    return from_manifold(block + rib)


def _down(degrees: float, direction: tuple[int, int]) -> list[float]:
    """Normal, into the solid, of a roof that falls by `degrees` towards `direction`."""
    slope = np.radians(degrees)
    return [float(-np.sin(slope) * direction[0]), float(-np.sin(slope) * direction[1]), float(-np.cos(slope))]


def _offset(degrees: float, reach: float, rim: float) -> float:
    """Of the roof's plane: it passes through height `rim` at distance `reach` from the middle."""
    slope = np.radians(degrees)
    return float(-np.sin(slope) * reach - np.cos(slope) * rim)
