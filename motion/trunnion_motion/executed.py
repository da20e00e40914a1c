"""Turn a program into the time law that its firmware will make of the words: planned time is executed time.

`time_law` says what the machine could do; its steady speeds become F. The firmware then reads rounded words, measures
each move by its own length, and makes its own ramps and corners with its own look-ahead. This is that planner, so that
the rows' durations are those of the print.
"""

from dataclasses import dataclass, replace

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_gcode.advance import jump_limit
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.feed import speeds_read
from trunnion_gcode.moves import Moves, make_moves
from trunnion_gcode.stated import Toolhead, toolhead
from trunnion_motion import executed_kernel as kernel
from trunnion_motion.overlapping import Path, overlapping
from trunnion_motion.timelaw import TimeLaw

UNLIMITED = 1e12
"""Stands for an acceleration without a limit, in units/s²."""
DEFAULT_DEVIATION = 0.01
"""mm. What GRBL is shipped with ($11)."""
KLIPPER_UNLIMITED = 99999999.9
"""mm/s² that Klipper gives moves without X, Y and Z."""
KLIPPER_CRUISE = 0.5
"""Share of the acceleration that its gentle passes use: one less minimum_cruise_ratio, by default."""
BENDS = 2
"""Passes over the corners of curves: slower moves make slower corners."""
OVERLAPS = 4
"""Passes over moves that overlap: what one is slowed down by the next one makes up for, less each time."""


@dataclass(frozen=True, eq=False)
class Execution:
    """The law of the rows, and what F has to ask for."""

    law: TimeLaw
    asked: FloatArray
    """(n,) s that the row would take at the speed that its F asks for."""


def executed(
    program: MachineProgram, ideal: TimeLaw, profile: MachineProfile, dialect: Dialect, *, bends: int = BENDS
) -> Execution:
    """The law of the same rows under the firmware's rules.

    `program.cruise` (n,) s is what each row takes at the speed that is wanted and that its joints can go. F asks for
    that, or for less where a row of small corners would bend a joint too fast. Rows that are written as one move
    share its ramps; rows that are not written at all, since no word changes, take no time. With no `bends` the
    corners of curves count for nothing: where rows were cut on the way, what they ask for was settled before.
    """
    moves = make_moves(program, profile, dialect)
    if not len(moves.row):
        return Execution(ideal, program.cruise)
    drive = _drive(moves, program, profile, dialect)
    nominal = drive.nominal
    if dialect.planner.corners == "blend":
        return _blended(program, ideal, moves, drive)
    for _ in range(bends):
        corner, _rest = drive.corners(nominal)
        nominal = kernel.bent(drive.share, nominal, moves.metric, corner, drive.acceleration)
    asked = moves.metric / nominal
    nominal = np.minimum(np.maximum(speeds_read(moves, asked, dialect), dialect.planner.slowest), drive.reach)
    corner, rest = drive.corners(nominal)
    stops = _stops(moves, program)
    if dialect.planner.corners == "klipper":
        gentle = np.minimum(drive.ramp, drive.config.acceleration * KLIPPER_CRUISE)
        entry, peak, leave = kernel.smoothed_ramps(drive.length, nominal, drive.ramp, corner, stops, gentle)
    else:
        seen = dialect.planner.blocks
        blocks = len(nominal) + 1 if seen is None else max(seen, profile.planner.blocks - dialect.planner.unseen)
        entry, peak, leave = kernel.ramps(drive.length, nominal, drive.ramp, corner, rest, stops, blocks)
    return _per_row(program, ideal, moves, _Trapezoids(entry, peak, leave, drive.ramp, asked))


def _blended(program: MachineProgram, ideal: TimeLaw, moves: Moves, drive: "_Drive") -> Execution:
    """The law where moves overlap instead of following each other.

    Two that overlap may together be faster than either was meant to be; then they are asked to be slower.
    """
    linear = np.flatnonzero(drive.linear)
    straight = (drive.kind & 2) > 0
    along_x = np.array([drive.letters[column] == "X" for column in linear], dtype=np.float64)
    path = Path(
        length=moves.metric,
        wanted=drive.nominal,
        push=drive.ramp,
        direction=np.where(straight[:, None], drive.share[:, linear], along_x),
        plain=straight & ~drive.share[:, ~drive.linear].any(axis=1),
        stops=_stops(moves, program),
    )
    most, tolerance = drive.acceleration[linear], drive.dialect.planner.tolerance
    nominal = drive.nominal
    for _ in range(OVERLAPS):
        _, peak, _, _ = overlapping(replace(path, wanted=nominal), most, tolerance)
        nominal = nominal * np.minimum(1.0, drive.nominal / peak)
    asked = moves.metric / nominal
    read = np.maximum(speeds_read(moves, asked, drive.dialect), drive.dialect.planner.slowest)
    ramps = overlapping(replace(path, wanted=np.minimum(read, drive.reach)), most, tolerance)
    return _per_row(program, ideal, moves, _Trapezoids(*ramps, asked))


@dataclass(frozen=True, eq=False)
class _Drive:
    """Moves as the planner sees them, along its own length: mm, degrees, or mm of filament."""

    dialect: Dialect
    length: FloatArray
    """(m,)."""
    share: FloatArray
    """(m, k + 1) that every joint and the filament move per unit of length."""
    seen: FloatArray
    """(m, k + 1) the same, as the corners see it: in whole motor steps, where the firmware counts so."""
    kind: IntArray
    """(m,) 1 where joints move, 2 where linear ones do, 4 where filament moves, added up; or what the firmware tells
    apart."""
    nominal: FloatArray
    """(m,) units/s wanted."""
    reach: FloatArray
    """(m,) units/s that the joints can go."""
    ramp: FloatArray
    """(m,) units/s²."""
    acceleration: FloatArray
    """(k + 1,)."""
    corner_speed: FloatArray
    """(k + 1,)."""
    linear: BoolArray
    """(k + 1,) which columns are linear joints."""
    deviation: float | None
    """mm of junction deviation, where the profile gives one."""
    config: Toolhead
    letters: tuple[str, ...]
    """k of the joints."""

    def corners(self, nominal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(m,) speed allowed into every move from the one before, and (m,) from rest."""
        rules = self.dialect.planner
        rest = np.minimum(nominal, rules.slowest)
        if rules.corners == "reprapfirmware":
            return kernel.jump_corners(self.share, nominal, self.kind, self.corner_speed), np.zeros(len(nominal))
        if rules.corners == "klipper":
            straight = (self.kind & 2) > 0
            corner = kernel.square_corners(
                self.share,
                self.linear,
                nominal,
                self.length,
                self.ramp,
                straight,
                self.corner_speed,
                self.config.deviation,
            )
            return corner, rest
        if rules.corners == "grbl" or self.deviation is not None:
            across = DEFAULT_DEVIATION if self.deviation is None else self.deviation
            like_marlin = rules.corners == "marlin"
            corner = kernel.deviation_corners(
                self.seen, nominal, self.length, self.ramp, self.acceleration, across, like_marlin
            )
            return corner, rest
        return kernel.jerk_corners(self.seen, nominal, self.corner_speed), rest


def _drive(moves: Moves, program: MachineProgram, profile: MachineProfile, dialect: Dialect) -> _Drive:
    extruder, planner = profile.extruder, profile.planner
    # LinuxCNC limits the axes of the world it is told, not the joints.
    of_words = dialect.planner.corners == "blend"
    steps = np.column_stack([moves.word_step if of_words else moves.step, moves.filament])
    share = steps / moves.metric[:, None]
    speed = np.append(profile.array("speed") * profile.to_shown, extruder.speed)
    acceleration = np.append(profile.array("acceleration") * profile.to_shown, extruder.acceleration)
    printing = UNLIMITED if planner.acceleration is None else planner.acceleration
    travelling = printing if planner.travel_acceleration is None else planner.travel_acceleration
    kind = _kinds(moves.word_step if of_words else moves.step, moves.filament, profile)
    along = np.where(kind & 1, np.where(moves.filament != 0, printing, travelling), UNLIMITED)
    if dialect.planner.corners == "reprapfirmware":
        kind = _melded_kinds(moves, profile)
        along = np.where(kind & 1, np.where(kind & 2, printing, travelling), UNLIMITED)
    if dialect.planner.corners in ("grbl", "blend"):
        along = np.full(len(along), UNLIMITED)
    linear = np.array([not joint.rotary for joint in profile.joints] + [False])
    config = toolhead(profile)
    if dialect.planner.corners == "klipper":
        straight = (kind & 2) > 0
        along = np.where(straight, config.acceleration, KLIPPER_UNLIMITED)
        plane = linear & (np.array([*profile.letters, "E"]) != "Z")
        own = straight[:, None] & plane
        # The extruder's limits hold where X and Y stand, and where it draws back.
        own[:, -1] = (steps[:, plane] != 0).any(axis=1) & (moves.filament >= 0)
        with np.errstate(divide="ignore"):
            reach = np.where(own, np.inf, speed / np.abs(share)).min(axis=1)
            push = np.where(own, np.inf, acceleration / np.abs(share)).min(axis=1)
        reach = np.where(straight, np.minimum(reach, config.speed), reach)
    else:
        with np.errstate(divide="ignore"):
            reach, push = (speed / np.abs(share)).min(axis=1), (acceleration / np.abs(share)).min(axis=1)
            push = np.minimum(push, jump_limit(program.advance, moves, profile, dialect) / np.abs(share[:, -1]))
    return _Drive(
        dialect=dialect,
        length=moves.metric,
        share=share,
        seen=_in_steps(steps, program, profile) / moves.metric[:, None] if dialect.planner.in_steps else share,
        kind=kind,
        nominal=np.minimum(np.maximum(moves.metric / moves.asked, dialect.planner.slowest), reach),
        reach=reach,
        ramp=np.minimum(along, push),
        acceleration=acceleration,
        corner_speed=np.append(profile.array("corner_speed") * profile.to_shown, extruder.corner_speed),
        linear=linear,
        deviation=planner.junction_deviation,
        config=config,
        letters=profile.letters,
    )


def _in_steps(steps: FloatArray, program: MachineProgram, profile: MachineProfile) -> FloatArray:
    """Moves (m, k + 1) between positions rounded to whole motor steps."""
    grid = profile.steps_per_shown
    first = np.append(program.start * profile.to_shown, 0.0)
    place = first + np.cumsum(steps, axis=0)
    return np.asarray(np.diff(np.rint(place * grid), axis=0, prepend=np.rint(first * grid)[None]) / grid)


def _kinds(step: FloatArray, filament: FloatArray, profile: MachineProfile) -> IntArray:
    """(m,) 1 where joints move by `step` (m, k), 2 where linear ones do, 4 where filament (m,) moves, added up."""
    linear = np.array([not joint.rotary for joint in profile.joints])
    joints = (step != 0).any(axis=1)
    straight = (step[:, linear] != 0).any(axis=1)
    return np.asarray(joints + 2 * straight + 4 * (filament != 0))


def _melded_kinds(moves: Moves, profile: MachineProfile) -> IntArray:
    """(m,) RepRapFirmware stops between kinds: 1 where X or Y moves, 2 if it prints there, 4 if filament moves else."""
    level = (moves.step[:, [letter in "XY" for letter in profile.letters]] != 0).any(axis=1)
    prints = level & (moves.filament > 0)
    return np.asarray(level + 2 * prints + 4 * ((moves.filament != 0) & ~prints))


def _stops(moves: Moves, program: MachineProgram) -> BoolArray:
    """(m,) whether the machine stands before the move: at the start, and while it waits."""
    stops = np.zeros(len(moves.row), dtype=np.bool_)
    stops[0] = True
    waits = [event.row for event in program.events if event.kind in ("wait_nozzle", "wait_bed", "pause")]
    at = np.searchsorted(moves.row, waits)
    stops[at[at < len(stops)]] = True
    return stops


@dataclass(frozen=True, eq=False)
class _Trapezoids:
    """Of every move, along the firmware's length."""

    entry: FloatArray
    peak: FloatArray
    leave: FloatArray
    ramp: FloatArray
    asked: FloatArray
    """s that F asks for."""


def _per_row(program: MachineProgram, ideal: TimeLaw, moves: Moves, of: _Trapezoids) -> Execution:
    """The moves' ramps on the rows: a row that was merged into a move takes its part of the move's length."""
    n = len(program)
    move = np.minimum(np.searchsorted(moves.row, np.arange(n)), len(moves.row) - 1)
    weight = np.where(ideal.length > 0, ideal.length, 0.0)
    total = np.bincount(move, weights=weight, minlength=len(moves.row))
    done = np.cumsum(weight)
    began = np.concatenate([[0.0], done[moves.row]])[move]
    part = np.where(total > 0, total, 1.0)[move]
    end = np.clip((done - began) / part, 0.0, 1.0)
    begin = np.clip((done - weight - began) / part, 0.0, 1.0)
    length, a = moves.metric[move], of.ramp[move]
    entry, peak, leave = of.entry[move], of.peak[move], of.leave[move]

    def speed(fraction: FloatArray) -> FloatArray:
        rising = np.sqrt(entry**2 + 2 * a * fraction * length)
        falling = np.sqrt(leave**2 + 2 * a * (1 - fraction) * length)
        return np.asarray(np.minimum(np.minimum(rising, falling), peak))

    way = (end - begin) * length
    v0, v1 = speed(begin), speed(end)
    top = np.maximum(np.minimum(peak, np.sqrt(0.5 * (v0**2 + v1**2) + a * way)), np.maximum(v0, v1))
    flat = np.maximum(way - (2 * top**2 - v0**2 - v1**2) / (2 * a), 0.0)
    moves_at_all = (way > 0) & (top > 0)
    duration = np.where(moves_at_all, (2 * top - v0 - v1) / a + flat / np.where(top > 0, top, 1.0), 0.0)
    scale = np.where(moves_at_all, ideal.length / np.where(way > 0, way, 1.0), 0.0)
    law = TimeLaw(
        duration=duration,
        length=ideal.length,
        entry=v0 * scale,
        peak=top * scale,
        leave=v1 * scale,
        acceleration=a * scale,
        steady=ideal.steady,
        limited_by=ideal.limited_by,
    )
    return Execution(law, (end - begin) * of.asked[move])
