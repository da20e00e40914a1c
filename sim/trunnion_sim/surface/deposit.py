r"""Lay every bead of a program down in order, on what is there, and keep the surface that results.

**The bead.** Its section has the area `A` = plastic fed / way of the tip, whatever width the program's comments name.
Its upper side is the surface that the flat of the nozzle sweeps: the tip's path, level across it at right angles to the
tool. It reaches down to what lies below (the bed, other beads), at a gap `h` measured under it, and sideways as
far as the area needs: the section is a stadium of height h and width (A - pi/4 h²) / h + h (the flow model of Slic3r,
https://manual.slic3r.org/advanced/flow-math), with round edges of radius h/2 that nothing fills up later. Where
the gap opens sideways, the bead ends where its area is spent.

        ____________            free                 ____________ ____________
       /            \           edges               /    first   V   second   \
      |      A       | h                           |             |             |
       \____________/                               \____________A____________/    pores below the groove

**Steps.** Plastic leaves through a bore, not through a point: what is fed while the tip moves on by the bore's
diameter is under the bore all the while and goes where there is room. So the gap, at every place across, is the mean
over that way. Nothing is carried farther than that.

**No room.** Plastic that finds other plastic in its place first goes into the pores beside and below that the height
field remembers. Half of what is left widens the bead on its free side, by a quarter of its half width at most; the
rest rises behind the nozzle and stays as a bulge. (All to the side would hand the same lack on from line to line for
ever.) The groove between two beads is drawn open even
where plastic pressed aside would close it, so the surface drawn is never better than that of round beads.

**Too little.** A bead with less area than a round thread of diameter h is a thread: it drops onto what is below, or
hangs at the nozzle's height if that is farther than half a diameter away. In air the same: it hangs (a bridge).

**Left out.** Sagging, shrinking, swelling and the lag of pressure; round ends of beads (an end is cut square, so that
volume is kept); what a nozzle not at right angles to its path wipes away; surfaces that face down.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, check_array
from trunnion_sim.surface import deposit_kernel

MOST_CELLS = 24_000_000
"""Cells of the height field; beyond that it is made coarser."""


Ground = Callable[[FloatArray, FloatArray], FloatArray]
"""Heights in mm over X and Y."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight motions of the tip in `part`, in order; each belongs to a row of the program."""

    row: IntArray
    """(m,)."""
    start: FloatArray
    """(m, 3) mm."""
    end: FloatArray
    """(m, 3) mm."""
    tool_axes: FloatArray
    """(m, 3) unit."""
    volume: FloatArray
    """(m,) mm³ laid down; 0 on a travel."""
    present: BoolArray
    """(m,) whether the tip is over the part at all: false while homing."""

    def __post_init__(self) -> None:
        m = len(self.row)
        for name in ("start", "end", "tool_axes"):
            check_array(name, getattr(self, name), (m, 3))
        check_array("volume", self.volume, (m,))


@dataclass(frozen=True, eq=False)
class Field:
    """A height field over X and Y of `part`."""

    x: float
    """mm, centre of cell [0, 0]."""
    y: float
    cell: float
    """mm."""
    top: NDArray[np.float32]
    """(ny, nx) mm: upper surface of what is printed; 0 is the bed."""


@dataclass(frozen=True, eq=False)
class Deposit:
    """What every row met when it was executed, and what is there in the end. (n,) per row of the program."""

    field: Field
    gap: FloatArray
    """mm under the bead, where no neighbour reaches in, mean along the row; NaN where no bead was laid in the field."""
    laid: FloatArray
    """mm of bead laid inside the field."""
    unsupported: FloatArray
    """mm of it with nothing below within reach and no neighbour beside."""
    crowded: FloatArray
    """mm³ that found other plastic in its place and had to go elsewhere."""
    bulged: FloatArray
    """mm³ of that which found no room at all and stands above the nozzle's height."""
    depth: FloatArray
    """mm that the tip dips below the surface of what is printed, at worst, on a travel."""
    depth_point: FloatArray
    """(n, 3) mm: where."""
    taken: FloatArray
    """Share of the bead's place, across and along, that other plastic holds up to the nozzle."""


def lay_down(
    pieces: Pieces,
    rows: int,
    low: FloatArray,
    high: FloatArray,
    cell: float,
    flat_diameter: float,
    bore_diameter: float,
    ground: Ground | None = None,
) -> Deposit:
    """Execute the pieces over the rectangle `low` to `high` (mm, X and Y) with cells of `cell` mm.

    The nozzle's end is flat over `flat_diameter` mm, with a bore of `bore_diameter`. `ground` gives what stands there
    before the first bead; by default the bed at 0. Cells grow where the rectangle would need more than MOST_CELLS.
    About 300,000 steps of 2 cells a second.
    """
    size = np.maximum(high - low, cell)
    cell = max(cell, math.sqrt(float(size[0] * size[1]) / MOST_CELLS))
    nx, ny = (math.ceil(float(extent) / cell) + 1 for extent in size)
    top = np.zeros((ny, nx), np.float32)
    if ground is not None:
        top += ground(low[0] + cell * np.arange(nx)[None, :], low[1] + cell * np.arange(ny)[:, None]).astype(np.float32)
    stats = np.zeros((rows, 7))
    depth_point = np.full((rows, 3), np.nan)
    deposit_kernel.run(
        top,
        float(low[0]),
        float(low[1]),
        cell,
        pieces.row,
        pieces.start,
        pieces.end,
        pieces.tool_axes,
        pieces.volume,
        pieces.present,
        flat_diameter / 2,
        bore_diameter,
        stats,
        depth_point,
    )
    laid = stats[:, 1]
    return Deposit(
        field=Field(float(low[0]), float(low[1]), cell, top),
        gap=np.divide(stats[:, 0], laid, out=np.full(rows, np.nan), where=laid > 0),
        laid=laid,
        unsupported=stats[:, 2],
        crowded=stats[:, 3],
        bulged=stats[:, 4],
        depth=stats[:, 5],
        depth_point=depth_point,
        taken=np.divide(stats[:, 6], laid, out=np.zeros(rows), where=laid > 0),
    )
