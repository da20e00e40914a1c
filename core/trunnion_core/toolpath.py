"""What the nozzle tip does, free of any machine."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray, check_array, check_unit_rows, freeze

FIELDS = ("points", "tool_axes", "width", "height", "role", "layer", "speed")


@dataclass(frozen=True, eq=False)
class Toolpath:
    """What the nozzle tip does, in `part`. Row i is the motion that ends at points[i]; row 0 is a travel."""

    points: FloatArray
    """(n, 3) mm."""
    tool_axes: FloatArray
    """(n, 3) unit, from the tip into the tool."""
    width: FloatArray
    """(n,) mm, 0 where nothing is extruded."""
    height: FloatArray
    """(n,) mm along the tool axis, 0 where nothing is extruded."""
    role: IntArray
    """(n,) values of `Role`."""
    layer: IntArray
    """(n,) counted from 0, never falling."""
    speed: FloatArray
    """(n,) mm/s wanted of the tip over the part."""

    def __post_init__(self) -> None:
        n = len(self.points)
        check_array("points", self.points, (n, 3))
        check_unit_rows("tool_axes", self.tool_axes, n)
        for name in ("width", "height", "role", "layer", "speed"):
            check_array(name, getattr(self, name), (n,))
        if n and self.width[0] != 0:
            raise ValueError("width: row 0 extrudes, but a toolpath starts with a travel to its first point")
        freeze(*(getattr(self, name) for name in FIELDS))

    def __len__(self) -> int:
        return len(self.points)

    @property
    def extrudes(self) -> "np.typing.NDArray[np.bool_]":
        """(n,) whether row i lays a bead."""
        return np.asarray(self.width > 0)

    def save(self, path: Path) -> None:
        """Write the arrays under their field names as a compressed .npz file."""
        with path.open("wb") as file:
            np.savez_compressed(file, **{name: getattr(self, name) for name in FIELDS})

    @classmethod
    def load(cls, path: Path) -> "Toolpath":
        """Read what `save` wrote."""
        with np.load(path) as data:
            return cls(**{name: data[name] for name in FIELDS})
