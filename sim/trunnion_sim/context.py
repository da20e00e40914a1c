"""Everything a check may look at, computed once, and how it turns rows into findings."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.findings import Finding, Severity
from trunnion_core.profile import Joint, MachineProfile
from trunnion_core.roles import Role
from trunnion_sim import motion_kernel
from trunnion_sim.chain import forward
from trunnion_sim.collision.scene import Scene, make_scene
from trunnion_sim.collision.sweep import Hits, sweep
from trunnion_sim.limits import Limits
from trunnion_sim.motion import Motion
from trunnion_sim.notes import Notes, RowNotes
from trunnion_sim.pressure import Pressure, pressure
from trunnion_sim.reader import FileEnd
from trunnion_sim.replay import Replay, pieces, samples
from trunnion_sim.rules import Rules
from trunnion_sim.surface.deposit import Deposit, Pieces, lay_down
from trunnion_sim.surface.places import shared

TURN_STEP = math.radians(1.0)
"""rad that a rotary turns between two looks inside a row: 0.006 mm of arc height at 150 mm from the pivot."""
CELLS_ACROSS = 4.0
"""Cells of the height field across a bead where only contacts are looked for, not the surface."""
PLACES_ACROSS = 6.0
"""Cells across a bead where places are looked for that two beads share."""
STRETCH = 1 << 17
"""Rows of which all that lies between their ends is in memory together."""
BESIDE = 5.0
"""mm beside the height field to which motions are still followed."""
LONG = 50.0
"""mm: only what is longer is cut where it leaves the field."""
GAP = 3
"""Rows between two offending rows that still belong to one finding."""
MOST = 40
"""Findings of one code that are listed; the last one stands for all the rest."""


@dataclass(frozen=True, eq=False)
class LineOddities:
    """What the reader found odd, before any meaning."""

    lines: IntArray
    """(m,)."""
    flags: IntArray
    """(m,) bits of `reader_kernel`."""
    length: IntArray
    """(m,) bytes."""
    longest: tuple[int, int]
    """Line and bytes of the longest command."""
    letters: dict[str, int]
    """Letters of words on motion commands: first line of each."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Some consecutive rows cut into pieces so short that arcs of rotaries are seen; `part` frame."""

    rows: IntArray
    """(m,) the row of each piece."""
    starts: FloatArray
    """(m, 3) mm, tip."""
    points: FloatArray
    """(m, 3) mm, tip at the end of the piece."""
    tool_axes: FloatArray
    """(m, 3) unit."""


@dataclass(frozen=True, eq=False)
class Context:
    """One judged program. Rows are those of `motion`."""

    profile: MachineProfile
    rules: Rules
    motion: Motion
    notes: Notes
    rows: RowNotes
    limits: Limits
    replay: Replay
    tips: FloatArray
    """(n + 1, 3) mm, tip in `part` at the start and at the end of each row."""
    axes: FloatArray
    """(n + 1, 3) unit, tool axis there."""
    oddities: LineOddities
    end: FileEnd

    @property
    def points(self) -> FloatArray:
        """(n, 3) mm, tip in `part` at the end of each row."""
        return self.tips[1:]

    @property
    def tool_axes(self) -> FloatArray:
        """(n, 3)."""
        return self.axes[1:]

    @cached_property
    def moved(self) -> BoolArray:
        """(n,) whether a joint moves on the row."""
        moved = np.zeros(len(self.motion), np.bool_)
        for column in range(len(self.profile.joints)):
            moved |= np.abs(np.diff(self.motion.path[:, column])) > 1e-9
        return moved

    @property
    def linear_way(self) -> FloatArray:
        """(n,) mm that all linear joints move together."""
        squared = np.zeros(len(self.motion))
        for column, joint in enumerate(self.profile.joints):
            if not joint.rotary:
                squared += np.diff(self.motion.path[:, column]) ** 2
        return np.sqrt(squared)

    @property
    def driven_length(self) -> FloatArray:
        """(n,) mm that the tip travels over the part: less than the words say where a joined row's corner is cut."""
        way = self.linear_way
        cut = np.divide(self.replay.length, way, out=np.ones(len(way)), where=self.joined & (way > 0))
        return self.tip_length * np.minimum(cut, 1.0)

    @property
    def joined(self) -> BoolArray:
        """(n,) whether the firmware joins the row to others, because they have too few motor steps.

        What it makes of them is one move in a direction of its own, at most so many steps away from the words.
        """
        return self.replay.joined

    def surely_moved(self, column: int) -> FloatArray:
        """(n,) mm or rad that a joint moves on each row at least, when the firmware has rounded it to motor steps."""
        step = 1.0 / self.profile.joints[column].steps_per_unit if self.rules.least_steps else 0.0
        return np.maximum(np.abs(np.diff(self.motion.path[:, column])) - step, 0.0)

    @cached_property
    def homing(self) -> BoolArray:
        """(n,) whether the row is a homing."""
        return np.asarray(self.motion.kind == motion_kernel.HOME)

    @cached_property
    def homed(self) -> BoolArray:
        """(n,) whether every joint was homed when the row ran."""
        every = (1 << len(self.profile.joints)) - 1
        return np.asarray((self.motion.homed & every) == every)

    @cached_property
    def feeds(self) -> BoolArray:
        """(n,) whether the row moves and lays plastic."""
        plastic = self.motion.filament > 0
        if self.rows.own_roles and self.pressure is not None:
            # Words that carry pressure advance may draw back while the bead goes on; travels have a role of their own.
            plastic |= self.rows.bead & (self.laid > 0)
        return self.moved & ~self.homing & plastic

    @cached_property
    def pressure(self) -> Pressure | None:
        """The flow behind what is pushed; None where the program does not tell how far behind it is."""
        return pressure(self.motion, self.replay, self.profile, self.rules, self.notes.header)

    @cached_property
    def laid(self) -> FloatArray:
        """(n,) mm of filament that leave the nozzle on the row: behind pressure where that is known, else as fed."""
        return self.motion.filament if self.pressure is None else self.pressure.laid

    @cached_property
    def priming(self) -> BoolArray:
        """(n,) whether the row lies before the first layer that the comments name: lines that only fill the nozzle."""
        return np.asarray((self.rows.layer < 0) & (self.rows.layer >= 0).any())

    def stretches(self) -> Iterator[Stretch]:
        """The whole motion, STRETCH rows at a time."""
        for begin in range(0, len(self.motion), STRETCH):
            part = self.motion.part(begin, begin + STRETCH)
            tips, axes = self.tips[begin : begin + len(part) + 1], self.axes[begin + 1 : begin + len(part) + 1]
            rows, fractions = pieces(part, self.profile, TURN_STEP)
            whole = fractions >= 1.0
            if whole.all():
                yield Stretch(rows + begin, tips[:-1], tips[1:], axes)
                continue
            points, tool_axes = tips[1:][rows], axes[rows]
            points[~whole], tool_axes[~whole] = forward(self.profile, samples(part, rows[~whole], fractions[~whole]))
            yield Stretch(rows + begin, np.concatenate([tips[:1], points[:-1]]), points, tool_axes)

    @cached_property
    def tip_length(self) -> FloatArray:
        """(n,) mm that the tip travels over the part on each row, arcs followed."""
        length = np.zeros(len(self.motion))
        for part in self.stretches():
            first, last = int(part.rows[0]), int(part.rows[-1]) + 1
            way = np.linalg.norm(part.points - part.starts, axis=1)
            length[first:last] = np.bincount(part.rows - first, weights=way, minlength=last - first)
        return length

    @property
    def deposit(self) -> Deposit | None:
        """The beads laid down over the part, and what every row met; None where nothing is laid."""
        return self.lay_down(self.bead_width / CELLS_ACROSS)

    @cached_property
    def bead_width(self) -> float:
        """mm, median of the widths that the comments name; without any, the nozzle's bore."""
        named = self.rows.width[self.feeds]
        named = named[np.isfinite(named) & (named > 0)]
        return float(np.median(named)) if len(named) else self.profile.nozzle_diameter

    @cached_property
    def layer_height(self) -> float:
        """mm, median of the heights that the comments name; without any, half the nozzle's bore."""
        named = self.rows.height[self.feeds]
        named = named[np.isfinite(named) & (named > 0)]
        return float(np.median(named)) if len(named) else self.profile.nozzle_diameter / 2

    def lay_down(self, cell: float, bounds: tuple[FloatArray, FloatArray] | None = None) -> Deposit | None:
        """Lay every bead down on a height field with cells of `cell` mm over `bounds` (low and high, X and Y).

        Without bounds the field covers every bead but the skirt and priming. None where the program lays nothing.
        """
        bounds = bounds or self._bounds
        if bounds is None:
            return None
        flat, bore = self.profile.nozzle_flat_diameter, self.profile.nozzle_diameter
        return lay_down(self._motions(bounds), len(self.motion), *bounds, cell, flat, bore)

    def shared_places(self) -> FloatArray:
        """(n,) share of the place that each row's bead was meant for that another bead's was before."""
        bounds = self._bounds
        if bounds is None:
            return np.zeros(len(self.motion))
        pitch = np.maximum(self.stadium_width - (1 - math.pi / 4) * self.bead_height, 0.0)
        cell = self.bead_width / PLACES_ACROSS
        return shared(self._motions(bounds), pitch, self.bead_height, *bounds, cell)

    @cached_property
    def _present(self) -> BoolArray:
        """(n,) whether the tip is where the program thinks it is."""
        return np.asarray(~self.homing & (self.homed | ~self.homing.any()))

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray] | None:
        """Low and high corner (2,) mm in X and Y of every bead but the skirt and priming; None where none is laid."""
        beads = self.feeds & self._present
        if not beads.any():
            return None
        core = beads & (self.rows.role != Role.SKIRT) & ~self.priming
        return self._reach(core if core.any() else beads)

    def _motions(self, bounds: tuple[FloatArray, FloatArray]) -> Iterator[Pieces]:
        """What every stretch lays down over the bounds, and its travels."""
        return (_within(self._laid(stretch, self._present), *bounds) for stretch in self.stretches())

    def _laid(self, stretch: Stretch, present: BoolArray) -> Pieces:
        """What a stretch lays down: the plastic of each row, shared among its pieces by their length."""
        rows = stretch.rows
        way = np.linalg.norm(stretch.points - stretch.starts, axis=1)
        volume = np.where(self.feeds[rows], self.laid[rows] * self.profile.filament_area, 0.0)
        whole = self.tip_length[rows]
        share = np.divide(volume * way, whole, out=np.zeros(len(rows)), where=whole > 0)
        axes = np.ascontiguousarray(stretch.tool_axes)
        return Pieces(rows, stretch.starts, stretch.points, axes, share, present[rows])

    def _reach(self, beads: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Low and high corner (2,) mm in X and Y of everywhere that rows `beads` (n,) lead, 2 mm wider."""
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for stretch in self.stretches():
            over = stretch.points[beads[stretch.rows], :2]
            low, high = (
                np.minimum(low, over.min(axis=0, initial=np.inf)),
                np.maximum(high, over.max(axis=0, initial=-np.inf)),
            )
        return low - 2.0, high + 2.0

    @cached_property
    def scene(self) -> Scene:
        """The machine's bodies, its bed and clamps, for collision."""
        return make_scene(self.profile)

    @property
    def bead_height(self) -> FloatArray:
        """(n,) mm: as the comments say, else half the bore."""
        known = self.rows.height
        return np.where(np.isfinite(known) & (known > 0), known, self.profile.nozzle_diameter / 2)

    @cached_property
    def stadium_width(self) -> FloatArray:
        """(n,) mm across a stadium (a rectangle and two half-discs) of the fed volume; 0 where no bead is laid.

        Where flow lags behind its drive, that of the planned bead: what a ramp of speed gathers is no wide bead.
        """
        height = self.bead_height
        area = np.divide(
            self.laid * self.profile.filament_area,
            self.tip_length,
            out=np.zeros(len(self.motion)),
            where=self.feeds & (self.tip_length > 0),
        )
        width = np.where(area > 0, area / height + (1 - math.pi / 4) * height, 0.0)
        if self.pressure is None:
            return width
        planned = np.where(np.isfinite(self.rows.width), self.rows.width, np.inf)
        return np.minimum(width, np.maximum(planned, height))

    @cached_property
    def hits(self) -> Hits:
        """Where bodies enter what stands on the bed; homing is the machine's own business."""
        return sweep(
            self.scene,
            self.motion.joints,
            self.points,
            self.tool_axes,
            self.stadium_width,
            self.bead_height,
            ~self.homing,
            first=(self.motion.start, self.tips[0], self.axes[0]),
        )

    def find(
        self,
        code: str,
        severity: Severity,
        mask: BoolArray,
        message: Callable[[int], str],
        *,
        value: NDArray[np.floating[Any]] | None = None,
        limit: FloatArray | float | None = None,
        joint: Joint | None = None,
        together: bool = False,
    ) -> Iterator[Finding]:
        """A finding for every run of offending rows, at its worst row; beyond MOST the rest becomes one.

        `together` makes one finding of all, for what a program does over and over in the same way.
        Values of a joint are given in internal units and shown in mm or degrees. The worst row is the one where
        `value` is farthest from `limit`, or the first.
        """
        hit = np.flatnonzero(mask)
        if not hit.size:
            return
        starts = np.concatenate([[0], np.flatnonzero(np.diff(hit) > GAP) + 1])
        starts = starts[: 1 if together else MOST]
        ends = np.append(starts[1:], len(hit))
        excess = None
        if value is not None:
            excess = np.abs(value[hit] - (0.0 if limit is None else np.broadcast_to(limit, mask.shape)[hit]))
        for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
            worst = int(hit[first if excess is None else first + int(excess[first:last].argmax())])
            count = last - first
            text = message(worst)
            if count > 1:
                text += f" ({count} rows, lines {self.motion.line[hit[first]]} to {self.motion.line[hit[last - 1]]})"
            shown = joint.shown if joint is not None else float
            yield Finding(
                code=code,
                severity=severity,
                message=text,
                line=int(self.motion.line[worst]),
                row=worst,
                layer=self.layer(worst),
                axis=None if joint is None else joint.letter,
                value=None if value is None else float(shown(float(value[worst]))),
                limit=None if limit is None else float(shown(float(np.broadcast_to(limit, mask.shape)[worst]))),
                point=self.point(worst),
                count=count,
            )

    def point(self, row: int) -> tuple[float, float, float]:
        """Tip at the end of a row, mm in `part`."""
        x, y, z = self.points[row].tolist()
        return x, y, z

    def layer(self, row: int) -> int | None:
        """Layer of a row; None before the first."""
        layer = int(self.rows.layer[row])
        return layer if layer >= 0 else None

    def role_text(self, row: int) -> str:
        """Role of a row for messages."""
        role = int(self.rows.role[row])
        return Role(role).text.replace("_", " ") if role >= 0 else "unnamed"


def _within(pieces: Pieces, low: FloatArray, high: FloatArray) -> Pieces:
    """Long pieces cut down to what lies over the rectangle `low` to `high` (mm, X and Y), BESIDE wider.

    A move of a kilometre past the part takes no longer than one of a metre (Liang and Barsky 1984).
    """
    step = pieces.end - pieces.start
    rows = np.flatnonzero(np.linalg.norm(step, axis=1) > LONG)
    if not rows.size:
        return pieces
    begin, end = np.zeros(len(rows)), np.ones(len(rows))
    for axis in range(2):
        way, at = step[rows, axis], pieces.start[rows, axis]
        moves = np.abs(way) > 0
        sides = [
            np.divide(side - at, way, out=np.where((side - at) * sign >= 0, inside, 2.0), where=moves)
            for side, sign, inside in ((low[axis] - BESIDE, -1, 0.0), (high[axis] + BESIDE, 1, 1.0))
        ]
        begin = np.maximum(begin, np.where(moves, np.minimum(*sides), sides[0]))
        end = np.minimum(end, np.where(moves, np.maximum(*sides), np.where(sides[1] > 1, -1.0, sides[1])))
    start, stop, volume, present = pieces.start.copy(), pieces.end.copy(), pieces.volume.copy(), pieces.present.copy()
    share = np.clip(end - begin, 0.0, 1.0)
    inner = share < 1
    start[rows[inner]] += begin[inner, None] * step[rows[inner]]
    stop[rows[inner]] = pieces.start[rows[inner]] + end[inner, None] * step[rows[inner]]
    volume[rows] *= share
    present[rows] &= share > 0
    return Pieces(pieces.row, start, stop, pieces.tool_axes, volume, present)
