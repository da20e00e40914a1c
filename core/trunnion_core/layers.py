"""Layers of beads, as the slicer makes them before they are put in order."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from trunnion_core.arrays import FloatArray, check_array, check_unit_rows, freeze
from trunnion_core.roles import Role


@dataclass(frozen=True, eq=False)
class Bead:
    """One unbroken bead, in `part`: the tip runs along `points` with the tool along `tool_axes`.

    The points lie on the upper surface of the bead, where the tip of the nozzle is. Row 0 is where the bead starts;
    `width[i]`, `height[i]` belong to the piece that ends at point i (row 0's are those of row 1). A closed bead ends
    where it starts.
    """

    points: FloatArray
    """(n, 3) mm, n >= 2."""
    tool_axes: FloatArray
    """(n, 3) unit, from the tip into the tool."""
    width: FloatArray
    """(n,) mm."""
    height: FloatArray
    """(n,) mm, along the tool axis down to the surface below."""
    role: Role

    def __post_init__(self) -> None:
        n = len(self.points)
        if n < 2:
            raise ValueError(f"points: {n}, a bead needs at least 2")
        check_array("points", self.points, (n, 3))
        check_unit_rows("tool_axes", self.tool_axes, n)
        check_array("width", self.width, (n,))
        check_array("height", self.height, (n,))
        freeze(self.points, self.tool_axes, self.width, self.height)

    @property
    def closed(self) -> bool:
        """Whether the bead ends exactly where it starts."""
        return bool((self.points[0] == self.points[-1]).all())


@dataclass(frozen=True, eq=False)
class Layer:
    """Beads that lie on one surface: a plane, or an offset of the part's skin."""

    kind: Literal["planar", "nonplanar"]
    z: float
    """mm; height of the plane, or of the highest point of the surface."""
    height: float
    """mm; nominal thickness."""
    beads: tuple[Bead, ...]


@dataclass(frozen=True, eq=False)
class LayerStack:
    """Every layer of a part in the order of printing."""

    layers: Sequence[Layer]
