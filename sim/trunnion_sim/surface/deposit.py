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
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, check_array
from trunnion_sim.surface import deposit_kernel

MOST_CELLS = 24_000_000
"""Cells of the height field; beyond that it is made coarser."""
NEIGHBOURS = 500
"""Pieces of the stretch before and after that the bore may reach over."""

Floats = NDArray[np.float32]

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

    def cut(self, begin: int, end: int) -> "Pieces":
        """The pieces from `begin` to `end`."""
        return Pieces(*(getattr(self, field.name)[begin:end] for field in fields(self)))


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
    gap: Floats
    """mm under the bead, where no neighbour reaches in, mean along the row; NaN where no bead was laid in the field."""
    laid: Floats
    """mm of bead laid inside the field."""
    unsupported: Floats
    """mm of it with nothing below within reach and no neighbour beside."""
    crowded: Floats
    """mm³ that found other plastic in its place and had to go elsewhere."""
    bulged: Floats
    """mm³ of that which found no room at all and stands above the nozzle's height."""
    depth: Floats
    """mm that the tip dips below the surface of what is printed, at worst, on a travel."""
    depth_point: Floats
    """(n, 3) mm: where."""
    taken: Floats
    """Share of the bead's place, across and along, that other plastic holds up to the nozzle."""


def lay_down(
    pieces: Pieces | Iterable[Pieces],
    rows: int,
    low: FloatArray,
    high: FloatArray,
    cell: float,
    flat_diameter: float,
    bore_diameter: float,
    ground: Ground | None = None,
) -> Deposit:
    """Execute the pieces over the rectangle `low` to `high` (mm, X and Y) with cells of `cell` mm.

    Pieces may come in stretches, one after the other, so that they need not be in memory all at once; no row goes on
    from one stretch into the next. The nozzle's end is flat over `flat_diameter` mm, with a bore of `bore_diameter`.
    `ground` gives what stands there before the first bead; by default the bed at 0. Cells grow where the rectangle
    would need more than MOST_CELLS. About 300,000 steps of 2 cells a second.
    """
    size = np.maximum(high - low, cell)
    cell = max(cell, math.sqrt(float(size[0] * size[1]) / MOST_CELLS))
    nx, ny = (math.ceil(float(extent) / cell) + 1 for extent in size)
    top = np.zeros((ny, nx), np.float32)
    if ground is not None:
        top += ground(low[0] + cell * np.arange(nx)[None, :], low[1] + cell * np.arange(ny)[:, None]).astype(np.float32)
    before, pores, bulge = (np.zeros((ny, nx), np.float32) for _ in range(3))
    stamp = np.full((ny, nx), -1e30)
    memory = np.append(np.zeros(4), np.full(3, np.nan))
    kept = np.zeros((7, rows), np.float32)
    kept[0] = np.nan
    depth_point = np.full((rows, 3), np.nan, np.float32)
    for stretch, begin, end in _with_neighbours([pieces] if isinstance(pieces, Pieces) else pieces):
        first, last = int(stretch.row[begin]), int(stretch.row[end - 1]) + 1
        stats, place = np.zeros((last - first, 7)), np.full((last - first, 3), np.nan)
        deposit_kernel.run(
            top,
            float(low[0]),
            float(low[1]),
            cell,
            stretch.row - first,
            stretch.start,
            stretch.end,
            stretch.tool_axes,
            stretch.volume,
            stretch.present,
            flat_diameter / 2,
            bore_diameter,
            stats,
            place,
            begin,
            end,
            before,
            stamp,
            pores,
            bulge,
            memory,
        )
        laid = stats[:, 1]
        stats[:, 0] = np.divide(stats[:, 0], laid, out=np.full(len(laid), np.nan), where=laid > 0)
        stats[:, 6] = np.divide(stats[:, 6], laid, out=np.zeros(len(laid)), where=laid > 0)
        kept[:, first:last] = stats.T
        depth_point[first:last] = place
    gap, laid_length, unsupported, crowded, bulged, depth, taken = kept
    return Deposit(
        field=Field(float(low[0]), float(low[1]), cell, top),
        gap=gap,
        laid=laid_length,
        unsupported=unsupported,
        crowded=crowded,
        bulged=bulged,
        depth=depth,
        depth_point=depth_point,
        taken=taken,
    )


def _with_neighbours(stretches: Iterable[Pieces]) -> Iterator[tuple[Pieces, int, int]]:
    """Each stretch between the last pieces of the one before and the first of the one after; and where it lies."""
    before: Pieces | None = None
    for here, after in pairwise(_then_none(stretch for stretch in stretches if len(stretch.row))):
        if here is None:
            break
        around = [part for part in (before, here, None if after is None else after.cut(0, NEIGHBOURS)) if part]
        begin = 0 if before is None else len(before.row)
        yield (joined(around) if len(around) > 1 else here), begin, begin + len(here.row)
        before = here.cut(max(0, len(here.row) - NEIGHBOURS), len(here.row))


def _then_none(stretches: Iterable[Pieces]) -> Iterator[Pieces | None]:
    yield from stretches
    yield None


def joined(parts: list[Pieces]) -> Pieces:
    """Pieces after each other."""
    return Pieces(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Pieces)))
