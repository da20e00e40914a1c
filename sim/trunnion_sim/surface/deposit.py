r"""Lay every bead of a program down in order, on what is there, and keep the surface that results.

**The bead.** Its section has the area `A` = plastic fed / way of the tip, whatever width the program's comments name.
Its upper side is the surface that the flat of the nozzle sweeps: the tip's path, level across it at right angles to the
tool. It reaches down to what lies below (the bed, other beads), at a gap `h`, and half of it goes to either side until
its plastic is spent, with a round front of radius h/2. Over open ground that is the stadium of Slic3r's flow model
(https://manual.slic3r.org/advanced/flow-math). Where a neighbour stands, the front runs over its shoulder and fills the
groove above and the pore below; at the pitch A / h that is the very moment at which both are full.

        ____________            free                 ____________ ____________
       /            \           edges               /    first   V   second   \
      |      A       | h                           |             |             |
       \____________/                               \____________A____________/

**Two heights.** Every cell has the height of the plastic, which later beads lie on and which holds every mm³, and the
height that is compared with the model. They differ in the groove between two beads: it is compared as open as two round
beads leave it, though the plastic pressed out of their overlap would fill it, so that the surface is never better than
that of round beads. (For beads of 0.4 x 0.3 the grooves are 0.012 mm deep on average.)

**Steps.** Plastic leaves through a bore, not through a point: what is fed while the tip moves on by the bore's
diameter is under the bore all the while and goes where there is room. So the gap, at every place across, is the mean
over that way.

**No room.** Of the plastic that its side cannot take, half widens the bead on the other, by a quarter of its half width
at most. The rest raises the pressure in the nozzle and comes out over the next 2 mm of way, into what room is there;
only what has waited and finds none again, or more than a quarter of the bead, rises behind the nozzle, up to one level
over what is there. What a corner or the cells' rounding leave over or short goes to the next millimetres likewise, so
that nothing vanishes: see `Balance`.

**Too little.** A bead with less area than a round thread of diameter h is a thread: it drops onto what is below, or
hangs at the nozzle's height if that is farther than half a diameter away. In air the same: it hangs (a bridge).

**Over air.** What is deeper than 1.65 threads is open, however deep. Between beads that hang side by side a slit no
wider than a third of the bore is closed by a web at half their height: the next layer would not fall through it.

**Left out.** Sagging, shrinking, swelling and the lag of pressure; round ends of beads (an end is cut square, so that
volume is kept); what a nozzle not at right angles to its path wipes away; surfaces that face down; the ironing of what
rose by the nozzle when it comes by again.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, check_array
from trunnion_sim.surface import deposit_kernel
from trunnion_sim.surface.draw_kernel import Grid

MOST_CELLS = 24_000_000
"""Cells of the height field; beyond that it is made coarser."""
TURN = math.atan(math.sqrt(5) - 2)
"""rad between X and the rows of the height field: lines along X, Y and the diagonals pass its cells at ever new places
(the slopes are quadratic irrationals), so that no line lies better in it than another."""
DEPTH = 4
"""Row of the kernel's statistics that holds a greatest value and no sum."""

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
    """A height field over X and Y of `part`, its rows turned by TURN from X."""

    x: float
    """mm, centre of cell [0, 0], in the field's own directions."""
    y: float
    cell: float
    """mm."""
    top: NDArray[np.float32]
    """(ny, nx) mm: upper surface of what is printed; 0 is the bed."""


@dataclass(frozen=True)
class Balance:
    """Where the plastic went, mm³: fed = kept + beyond + not_laid."""

    fed: float
    kept: float
    """On the field; every cell counted, less the pores below and inside."""
    overfill: float
    """Of what is kept: found no room and stands above the nozzle's height."""
    beyond: float
    """Laid beyond the field."""
    not_laid: float
    """Fed at rest or on a path steeper than the field can hold, and what waits in the nozzle after the last bead."""


@dataclass(frozen=True, eq=False)
class Deposit:
    """What every row met when it was executed, and what is there in the end. (n,) per row of the program."""

    field: Field
    """With the grooves between beads open."""
    material: Floats
    """(ny, nx) mm: the same with the grooves as full as the plastic fills them: what later beads lie on."""
    balance: Balance
    gap: Floats
    """mm under the bead, where no neighbour reaches in, mean along the row; NaN where no bead was laid in the field."""
    laid: Floats
    """mm of bead laid inside the field."""
    unsupported: Floats
    """mm of it with nothing below within reach and no neighbour beside."""
    bulged: Floats
    """mm³ that found no room and stand above the nozzle's height."""
    depth: Floats
    """mm that the tip dips below the surface of what is printed, at worst, on a travel."""
    depth_point: Floats
    """(n, 3) mm: where."""


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
    corners = turned(np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = np.maximum(high - low, cell)
    cell = max(cell, math.sqrt(float(size[0] * size[1]) / MOST_CELLS))
    nx, ny = (math.ceil(float(extent) / cell) + 1 for extent in size)
    material = np.zeros((ny, nx), np.float32)
    if ground is not None:
        at = turned(np.stack(np.meshgrid(low[0] + cell * np.arange(nx), low[1] + cell * np.arange(ny)), axis=-1), -1)
        material += ground(at[..., 0], at[..., 1])
    before, pores, bulge = (np.zeros((ny, nx), np.float32) for _ in range(3))
    surface, stamp = material.copy(), np.zeros((ny, nx), np.int32)
    grid = Grid(float(low[0]), float(low[1]), cell, material, surface, before, pores, bulge, stamp)
    state, fed = np.zeros(5), 0.0
    kept = np.zeros((5, rows), np.float32)
    depth_point = np.full((rows, 3), np.nan, np.float32)
    held: Pieces | None = None
    for stretch, final in _and_whether_last([pieces] if isinstance(pieces, Pieces) else pieces):
        fed += float(stretch.volume.sum())
        here = stretch if held is None else joined([held, stretch])
        if not len(here.row):
            continue
        first, last = int(here.row[0]), int(here.row[-1]) + 1
        stats, place = np.zeros((5, last - first)), depth_point[first:last]
        stats[DEPTH] = kept[DEPTH, first:last]
        done = deposit_kernel.run(
            grid,
            turned(here.start),
            turned(here.end),
            turned(here.tool_axes),
            here.volume,
            here.present,
            here.row - first,
            flat_diameter / 2,
            bore_diameter,
            stats,
            place,
            final,
            state,
        )
        stats[DEPTH] -= kept[DEPTH, first:last]
        kept[:, first:last] += stats
        held = here.cut(done, len(here.row))
    gap, laid, unsupported, bulged, depth = kept
    np.divide(gap, laid, out=gap, where=laid > 0)
    gap[laid == 0] = np.nan
    return Deposit(
        field=Field(grid.x, grid.y, cell, surface),
        material=material,
        balance=Balance(fed, float(state[0]), float(bulged.sum()), float(state[1]), float(state[2] + state[3])),
        gap=gap,
        laid=laid,
        unsupported=unsupported,
        bulged=bulged,
        depth=depth,
        depth_point=turned(depth_point.astype(np.float64), -1).astype(np.float32),
    )


def turned(points: FloatArray, sign: int = 1) -> FloatArray:
    """Points or vectors (..., 2 or 3) of `part` in the directions of a field; with sign -1 back."""
    c, s = math.cos(TURN), sign * math.sin(TURN)
    result = points.copy()
    result[..., 0] = c * points[..., 0] + s * points[..., 1]
    result[..., 1] = c * points[..., 1] - s * points[..., 0]
    return result


def _and_whether_last(stretches: Iterable[Pieces]) -> Iterator[tuple[Pieces, bool]]:
    held: Pieces | None = None
    for stretch in stretches:
        if held is not None:
            yield held, False
        held = stretch
    if held is not None:
        yield held, True


def joined(parts: list[Pieces]) -> Pieces:
    """Pieces after each other."""
    return Pieces(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Pieces)))
