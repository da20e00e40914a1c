"""Turn a program whose firmware does not see to all of its pressure advance into one whose filament carries the rest.

What is pushed into the hot end runs ahead of what leaves the nozzle by K times the flow: with E the filament that the
beads need and K the pressure advance, the drive has to stand at E + K dE/dt. dE/dt follows from the time law that the
firmware makes of the very words that are written, so the two are worked out together. Filament is linear along a move;
therefore moves are cut where their ramps begin and end, and inside them, so that it can follow the speed.

        speed      ______________              filament        __.--'' | cut
                  /:            :\\             ahead   _.--''        |
                 / :            : \\                  .'   |         |
        cuts    |::|            |::|                 |'' |  |         |

Nothing is gained or lost: at the end of every bead the drive is back at E, and what it runs ahead by where a bead
begins or ends at speed goes into the prime before and the retraction after.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_core.roles import Role
from trunnion_gcode.dialect import Dialect
from trunnion_kinematics.chain import JointChain
from trunnion_motion.executed import Execution, executed
from trunnion_motion.lead import kept_lead
from trunnion_motion.timelaw import TimeLaw

PIECE = 0.006
"""s. Ramps are cut into pieces of this length at least: short beside any pressure advance worth the name."""
MOST_PIECES = 4
"""Of one ramp. A quarter of the speed apart, flow strays by a sixteenth of it in the first piece, less in others."""
LEAST_CUT = 0.1
"""mm. Where linear joints move less, but do move, pieces would be lost in the rounding of the words that F is about."""
PASSES = 2
"""Law and filament are worked out from each other so many times; a third changes nothing that words could say."""

JUMP_SHARE = 0.7
"""Of the drive's corner speed that the advance may take up. A piece from rest ends a third faster than its mean."""


@dataclass(frozen=True, eq=False)
class Advanced:
    """A program whose filament carries pressure advance."""

    program: MachineProgram
    execution: Execution
    nominal: FloatArray
    """(n,) mm of filament that the beads need, without the advance."""
    tip_points: FloatArray
    """(n, 3) mm, part: the tip at the end of every row."""
    tool_axes: FloatArray
    """(n, 3) unit, part."""


def with_advance(
    program: MachineProgram,
    ideal: TimeLaw,
    execution: Execution,
    tool_axes: FloatArray,
    profile: MachineProfile,
    dialect: Dialect,
) -> Advanced:
    """The program with its beads' rows cut at their ramps, and with extruder.pressure_advance in its filament.

    `program.cruise` and `ideal` are what `executed` took, `execution` what it made of them; `tool_axes` (n, 3) unit,
    part, at the rows' ends. The sum of the filament, with what firmware adds that follows ramps alone
    (`Dialect.advance_in_ramps`), stays what it was. For a planner that stops where filament turns back
    (`Dialect.draws_back`) such rows of beads feed forwards only.
    """
    seconds = profile.extruder.pressure_advance
    if dialect.planner.corners != "blend":
        program = replace(program, cruise=execution.asked)
    linear = _moved(program, profile, "XYZ")
    turning = (linear == 0) & (dialect.planner.corners == "klipper")
    helped = _helped(program, profile, dialect)
    whole = turning | helped | ((linear > 0) & (linear < LEAST_CUT)) | _too_sharp(program, execution.law, profile)
    row, end = _cuts(program, execution.law, whole, profile, dialect)
    program, ideal = _cut(program, ideal, row, end, profile, dialect)
    axes = tool_axes[row]
    inside = end < 1.0
    axes[inside] = JointChain.from_profile(profile).forward(program.joints[inside])[1]
    nominal = program.filament
    program = replace(program, advance=seconds)
    forwards = (not dialect.draws_back) & (program.width > 0) & (_moved(program, profile, dialect.advance_axes) > 0)
    helped = _helped(program, profile, dialect)
    done = executed(program, ideal, profile, dialect, bends=0)
    for _ in range(PASSES):
        ahead, own = _ahead(program, nominal, done.law, (forwards, helped), profile)
        program = replace(program, filament=np.diff(np.cumsum(nominal) + ahead, prepend=0.0) - own)
        done = executed(program, ideal, profile, dialect, bends=0)
    return Advanced(program, done, nominal, program.tip[1:], axes)


def _moved(program: MachineProgram, profile: MachineProfile, letters: str) -> FloatArray:
    """(n,) mm that the joints of these letters move in each row, motion below the last decimal taken for none."""
    columns = [column for column, joint in enumerate(profile.joints) if joint.letter in letters]
    way = np.linalg.norm(np.diff(program.joints, axis=0, prepend=program.start[None])[:, columns], axis=1)
    return np.where(way < 0.5 * 10.0**-profile.gcode.decimals_linear, 0.0, way)


def _too_sharp(program: MachineProgram, law: TimeLaw, profile: MachineProfile) -> BoolArray:
    """(n,) rows that speed up and brake at once, where a drive that follows both would jump too far in between."""
    extruder = profile.extruder
    per_length = np.divide(program.filament, law.length, out=np.zeros(len(program)), where=law.length > 0)
    jump = 2 * extruder.pressure_advance * np.abs(per_length) * law.acceleration
    ramps = np.where(law.acceleration > 0, law.acceleration, 1.0) * (law.duration - PIECE)
    brief = ramps < 2 * law.peak - law.entry - law.leave
    return np.asarray(
        brief & (law.peak > law.entry) & (law.peak > law.leave) & (jump > JUMP_SHARE * extruder.corner_speed)
    )


def _cuts(
    program: MachineProgram, law: TimeLaw, whole: BoolArray, profile: MachineProfile, dialect: Dialect
) -> tuple[IntArray, FloatArray]:
    """Row (m,) and end (m,) of every piece, as a fraction of the row's length; the last of a row ends at 1.

    Rows of beads are cut, except those that shall stay `whole` (n,).
    """
    n = len(program)
    bead = (program.width > 0) & (program.filament > 0) & (law.duration > 0) & ~whole
    length, ramp = np.where(bead, law.length, 1.0), np.where(bead, law.acceleration, 1.0)
    if dialect.planner.corners == "blend":
        reach = np.where(bead, law.peak**2, 0.0) / (0.5 * _push(program, length, profile))
        up, down = (_blend_ends(slow, law.peak, reach, length) for slow in (law.entry, law.leave))
    else:
        least = _least_asked(profile, dialect)
        rising, falling = (np.where(bead, (law.peak - slow) / ramp, 0.0) for slow in (law.entry, law.leave))
        between = law.duration - rising - falling
        counts = []
        for time, slow in ((rising, law.entry), (falling, law.leave)):
            asked = 0.5 * (slow + law.peak) * time / length * program.cruise
            counts.append(np.minimum(np.minimum(time / PIECE, np.sqrt(asked / least)), MOST_PIECES).astype(np.int64))
        # Where a short piece would be left beside the top of a ramp, there is no cut at it.
        alone = (counts[1] == 0) & (between + falling < 0.5 * PIECE)
        meet = np.where(counts[0] == 0, rising + between, between) < 0.5 * PIECE
        up = _ramp_ends(law.entry, law.peak, ramp, length, counts[0], counts[0] - alone)
        down = _ramp_ends(law.leave, law.peak, ramp, length, counts[1], counts[1] - meet)
    row = np.concatenate([np.arange(n), up[0], down[0]])
    end = np.concatenate([np.ones(n), up[1], 1.0 - down[1]])
    order = np.lexsort((end, row))
    return row[order], end[order]


def _least_asked(profile: MachineProfile, dialect: Dialect) -> float:
    """s that F asks for the first piece of a ramp, at least: there a rounded step more or less must not be a corner.

    A ramp from rest in n equal times has its first piece in 1 / n² of its length.
    """
    return (
        1.0 / float((profile.array("steps_per_unit") * profile.array("corner_speed")).min())
        if dialect.planner.in_steps
        else 1e-9
    )


def _ramp_ends(
    slow: FloatArray, fast: FloatArray, ramp: FloatArray, length: FloatArray, count: IntArray, cuts: IntArray
) -> tuple[IntArray, FloatArray]:
    """Rows and fractions of their lengths, from the slow end: first `cuts` ends of `count` equal parts of a ramp."""
    rows = [np.flatnonzero(cuts >= step) for step in range(1, MOST_PIECES + 1)]
    ends = []
    for step, row in enumerate(rows, start=1):
        speed = slow[row] + (fast[row] - slow[row]) * step / count[row]
        ends.append((speed**2 - slow[row] ** 2) / (2 * ramp[row] * length[row]))
    return np.concatenate(rows), np.concatenate(ends)


def _blend_ends(
    slow: FloatArray, fast: FloatArray, reach: FloatArray, length: FloatArray
) -> tuple[IntArray, FloatArray]:
    """The same for moves that overlap: one that is no longer than its `reach` (n,) would not come to its speed."""
    row = np.flatnonzero((reach > 0) & (slow < 0.9 * fast) & (3 * reach < length))
    return row, reach[row] / length[row]


def _push(program: MachineProgram, length: FloatArray, profile: MachineProfile) -> FloatArray:
    """(n,) acceleration along `length` (n,) that every joint and the drive can give."""
    joints = np.diff(program.joints, axis=0, prepend=program.start[None])
    steps = np.abs(np.column_stack([joints, program.filament]))
    most = np.append(profile.array("acceleration"), profile.extruder.acceleration)
    with np.errstate(divide="ignore"):
        return np.asarray((most / steps).min(axis=1) * length)


def _cut(
    program: MachineProgram,
    ideal: TimeLaw,
    row: IntArray,
    end: FloatArray,
    profile: MachineProfile,
    dialect: Dialect,
) -> tuple[MachineProgram, TimeLaw]:
    """Both with their rows cut: joints in proportion, tips where the joints take them, and the rest by the tip's way.

    A joint that turns moves the tip a little faster at one end of a row than at the other, and not quite straight, but
    for firmware that is told tips.
    """
    first = np.diff(row, prepend=-1) > 0
    share = end - np.where(first, 0.0, np.roll(end, 1))
    before = np.concatenate([program.start[None], program.joints[:-1]])[row]
    joints = program.joints[row]
    inside = end < 1.0
    joints[inside] = before[inside] + end[inside, None] * (joints[inside] - before[inside])
    tip = np.concatenate([program.tip[:1], program.tip[1:][row]])
    if dialect.tip_words:
        began = program.tip[:-1][row][inside]
        tip[1:][inside] = began + end[inside, None] * (tip[1:][inside] - began)
    else:
        tip[1:][inside] = JointChain.from_profile(profile).forward(joints[inside])[0]
    way = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    whole = np.bincount(row, weights=way, minlength=len(program))[row]
    part = np.where(whole > 0, way / np.where(whole > 0, whole, 1.0), share)
    starts = np.append(np.flatnonzero(first), len(row))
    cut = replace(
        program,
        joints=joints,
        duration=program.duration[row] * share,
        filament=program.filament[row] * part,
        role=program.role[row],
        layer=program.layer[row],
        width=program.width[row],
        height=program.height[row],
        tip_speed=program.tip_speed[row],
        tip_length=program.tip_length[row] * part,
        source=program.source[row],
        events=tuple(replace(event, row=int(starts[event.row])) for event in program.events),
        cruise=program.cruise[row] * share,
        tip=tip,
    )
    law = TimeLaw(**{field.name: getattr(ideal, field.name)[row] for field in fields(TimeLaw)})
    return cut, replace(law, duration=law.duration * share, length=law.length * part)


def _ahead(
    program: MachineProgram,
    nominal: FloatArray,
    law: TimeLaw,
    marks: tuple[BoolArray, BoolArray],
    profile: MachineProfile,
) -> tuple[FloatArray, FloatArray]:
    """(n,) mm that the drive has to be ahead at the end of every row, and (n,) mm of it that the firmware adds there.

    Where a bead begins or ends, the prime before or the retraction after makes the step; without either the drive is
    not ahead there. `marks` are the rows that have to feed forwards, and those that the firmware helps (`kept_lead`).
    No row may feed more or less than its beads need by more than the drive can jump: beyond its corner speed the
    firmware would slow the corner down. There the lag stays instead.
    """
    forwards, helped = marks
    beads = (program.width > 0) & (nominal > 0)
    live = np.flatnonzero(~beads | (law.duration > 0))
    bead = beads[live]
    alone = (program.role[live] == Role.RETRACT) | (program.role[live] == Role.PRIME)
    primed, drawn = np.append(False, alone[:-1]), np.append(alone[1:], False)
    of_live = TimeLaw(**{field.name: getattr(law, field.name)[live] for field in fields(TimeLaw)})
    apart = JUMP_SHARE * profile.extruder.corner_speed * of_live.duration
    least = 2 * 10.0**-profile.gcode.decimals_extruder
    low = np.where(
        forwards[live], np.maximum(nominal[live] - apart, np.minimum(least, nominal[live])), nominal[live] - apart
    )
    before, after, of_firmware = kept_lead(
        nominal[live],
        of_live,
        bead,
        (primed, drawn),
        (low, nominal[live] + apart),
        profile.extruder.pressure_advance,
        helped[live],
    )
    # What is not ahead where a bead ends stands after a prime before the next.
    ends = bead & ~np.append(bead[1:], False)
    after = np.where(ends & ~drawn, 0.0, after)
    begins = np.append(bead[1:] & ~bead[:-1], False)
    after = np.where(begins & alone, np.append(before[1:], 0.0), after)
    # Rows that take no time are not written: they keep what the row before them has.
    last = np.searchsorted(live, np.arange(len(program)), side="right") - 1
    own = np.zeros(len(program))
    own[live] = of_firmware
    return np.where(last >= 0, after[last], 0.0), own


def _helped(program: MachineProgram, profile: MachineProfile, dialect: Dialect) -> BoolArray:
    """(n,) rows of beads to which the firmware's own advance adds the ramps, so that the words carry the rest."""
    beads = (program.width > 0) & (program.filament > 0)
    return np.asarray(dialect.advance_in_ramps & beads & (_moved(program, profile, dialect.advance_axes) > 0))
