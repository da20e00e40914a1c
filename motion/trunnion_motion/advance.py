"""Turn a program whose firmware applies no pressure advance into one whose filament carries it.

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
from trunnion_motion.timelaw import TimeLaw

PIECE = 0.008
"""s. Ramps are cut into pieces of about this length, which is short beside any pressure advance worth the name."""
MOST_PIECES = 4
"""Of one ramp. A quarter of the speed apart, flow strays by a sixteenth of it in the first piece, less in others."""
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

    `program.cruise` and `ideal` are what `executed` takes, `execution` what it made of them; `tool_axes` (n, 3) unit,
    part, at the rows' ends. The sum of the filament stays what it was. For a planner that stops where filament turns
    back (`Dialect.draws_back`) such rows of beads feed forwards only, and what that leaves over goes into the next row
    that may draw back, at the latest the retraction.
    """
    seconds = profile.extruder.pressure_advance
    turning = (_moved(program, profile, "XYZ") == 0) & (dialect.planner.corners == "klipper")
    row, end = _cuts(program, execution.law, turning, dialect)
    program, ideal = _cut(program, ideal, row, end, profile)
    axes, turning = tool_axes[row], turning[row]
    inside = end < 1.0
    axes[inside] = JointChain.from_profile(profile).forward(program.joints[inside])[1]
    nominal = program.filament
    program = replace(program, advance=seconds)
    forwards = (program.width > 0) & (nominal > 0) & (_moved(program, profile, dialect.advance_axes) > 0)
    done = executed(program, ideal, profile, dialect)
    for _ in range(PASSES):
        ahead = _ahead(program, nominal, done.law, turning, seconds)
        place = np.cumsum(nominal) + _gradual(ahead, done.law, JUMP_SHARE * profile.extruder.corner_speed)
        if not dialect.draws_back:
            place = _forwards(place, program, forwards, 2 * 10.0**-profile.gcode.decimals_extruder)
        program = replace(program, filament=np.diff(place, prepend=0.0))
        done = executed(program, ideal, profile, dialect)
    return Advanced(program, done, nominal, program.tip[1:], axes)


def _moved(program: MachineProgram, profile: MachineProfile, letters: str) -> FloatArray:
    """(n,) mm that the joints of these letters move in each row, motion below the last decimal taken for none."""
    columns = [column for column, joint in enumerate(profile.joints) if joint.letter in letters]
    way = np.linalg.norm(np.diff(program.joints, axis=0, prepend=program.start[None])[:, columns], axis=1)
    return np.where(way < 0.5 * 10.0**-profile.gcode.decimals_linear, 0.0, way)


def _cuts(program: MachineProgram, law: TimeLaw, turning: BoolArray, dialect: Dialect) -> tuple[IntArray, FloatArray]:
    """Row (m,) and end (m,) of every piece, as a fraction of the row's length; the last of a row ends at 1."""
    n = len(program)
    bead = (program.width > 0) & (program.filament > 0) & (law.duration > 0) & ~turning
    length, ramp = np.where(bead, law.length, 1.0), np.where(bead, law.acceleration, 1.0)
    rows, ends = [np.arange(n)], [np.ones(n)]
    for slow, towards_end in ((law.entry, False), (law.leave, True)):
        if dialect.planner.corners == "blend":
            # A move reaches its speed over half its length or not at all, so a piece spans the ramp twice.
            reach = (law.peak**2 - slow**2) / ramp
            cut = np.flatnonzero(bead & (reach > 0) & (reach + 2 * law.peak**2 / ramp < length))
            places = [reach[cut] / length[cut]]
            cuts = [cut]
        else:
            time = np.where(bead, (law.peak - slow) / ramp, 0.0)
            count = np.clip(np.ceil(time / PIECE), 0, MOST_PIECES).astype(np.int64)
            count[time < 0.5 * PIECE] = 0
            cuts = [np.flatnonzero(count >= step) for step in range(1, MOST_PIECES + 1)]
            places = []
            for step, cut in enumerate(cuts, start=1):
                speed = slow[cut] + (law.peak[cut] - slow[cut]) * step / count[cut]
                places.append((speed**2 - slow[cut] ** 2) / (2 * ramp[cut] * length[cut]))
        rows += cuts
        ends += [1.0 - place if towards_end else place for place in places]
    row, end = np.concatenate(rows), np.concatenate(ends)
    # Cuts at the very ends of a row, and the top of a triangle seen from both sides, are none or one.
    kept = (end == 1.0) | ((end > 1e-6) & (end < 1 - 1e-6))
    row, end = row[kept], end[kept]
    order = np.lexsort((end, row))
    row, end = row[order], end[order]
    again = (np.diff(row, append=-1) == 0) & (np.diff(end, append=2.0) < 1e-6)
    return row[~again], end[~again]


def _cut(
    program: MachineProgram, ideal: TimeLaw, row: IntArray, end: FloatArray, profile: MachineProfile
) -> tuple[MachineProgram, TimeLaw]:
    """Both with their rows cut: joints and what a row holds in proportion, tips where the joints take them."""
    first = np.diff(row, prepend=-1) > 0
    share = end - np.where(first, 0.0, np.roll(end, 1))
    before = np.concatenate([program.start[None], program.joints[:-1]])[row]
    joints = program.joints[row]
    inside = end < 1.0
    joints[inside] = before[inside] + end[inside, None] * (joints[inside] - before[inside])
    tip = np.concatenate([program.tip[:1], program.tip[1:][row]])
    tip[1:][inside] = JointChain.from_profile(profile).forward(joints[inside])[0]
    starts = np.append(np.flatnonzero(first), len(row))
    cut = replace(
        program,
        joints=joints,
        duration=program.duration[row] * share,
        filament=program.filament[row] * share,
        role=program.role[row],
        layer=program.layer[row],
        width=program.width[row],
        height=program.height[row],
        tip_speed=program.tip_speed[row],
        tip_length=program.tip_length[row] * share,
        source=program.source[row],
        events=tuple(replace(event, row=int(starts[event.row])) for event in program.events),
        cruise=program.cruise[row] * share,
        tip=tip,
    )
    law = TimeLaw(**{field.name: getattr(ideal, field.name)[row] for field in fields(TimeLaw)})
    return cut, replace(law, duration=law.duration * share, length=law.length * share)


def _ahead(
    program: MachineProgram, nominal: FloatArray, law: TimeLaw, turning: BoolArray, seconds: float
) -> FloatArray:
    """(n,) mm that the drive has to be ahead at the end of every row: K times what the bead takes there a second.

    At the ends of moves that stop whatever they are, it is the pressure that such moves keep up when each lays down
    what it is fed: a K² (1 - exp(-u / K)) (1 - exp(-(T - u) / K)) / (1 - exp(-T / K)) in filament, for ramps a of u s
    in T s. Where they are short beside K, that is K times their mean. Where a bead begins or ends, the prime before or
    the retraction after makes the step; without either the drive is not ahead there.
    """
    beads = (program.width > 0) & (nominal > 0)
    live = np.flatnonzero(~beads | (law.duration > 0))
    bead, ramp = beads[live], law.acceleration[live]
    alone = (program.role[live] == Role.RETRACT) | (program.role[live] == Role.PRIME)
    per_length = np.where(bead, nominal[live] / np.where(bead, law.length[live], 1.0), 0.0)
    stops = turning[live] & bead
    whole = np.where(stops, law.duration[live], 1.0)
    up = np.where(stops, law.peak[live] / np.where(ramp > 0, ramp, 1.0), 0.0)
    kept = -np.expm1(-up / seconds) * np.expm1(-(whole - up) / seconds) / np.expm1(-whole / seconds)
    kept *= per_length * ramp * seconds
    out = np.where(stops, kept, per_length * law.leave[live])[:-1]
    into = np.where(stops, kept, per_length * law.entry[live])[1:]
    here, there = bead[:-1], bead[1:]
    flow = np.where(here & there, 0.5 * (out + into), 0.0)
    flow = np.where(here & alone[1:], out, np.where(alone[:-1] & there, into, flow))
    # Rows that take no time are not written: they keep what the row before them has.
    last = np.searchsorted(live, np.arange(len(program)), side="right") - 1
    ahead = seconds * np.append(flow, 0.0)
    return np.asarray(np.where(last >= 0, ahead[last], 0.0))


def _gradual(ahead: FloatArray, law: TimeLaw, speed: float) -> FloatArray:
    """(n,) the largest amounts not above `ahead` that never change by more than `speed` mm/s.

    A ramp takes K times its acceleration more from the drive at once; beyond its corner speed the firmware would slow
    the corner down, as Marlin and RepRapFirmware slow ramps with their own advance down. Here the lag stays instead.
    """
    way = speed * np.cumsum(law.duration)
    later = way + np.minimum.accumulate(ahead - way)
    return np.asarray(np.minimum.accumulate((later + way)[::-1])[::-1] - way)


def _forwards(place: FloatArray, program: MachineProgram, forwards: BoolArray, least: float) -> FloatArray:
    """(n,) `place` of the drive, raised so that every row that must feed forwards feeds at least `least` mm.

    What is left over is given back by the next row that may draw back, or in the last beads of the program.
    """
    free = (program.role == Role.RETRACT) | (program.role == Role.PRIME) | ((program.width > 0) & ~forwards)
    step = least * np.cumsum(forwards)
    run = np.cumsum(free)
    apart = 1.0 + 10 * float(np.abs(np.diff(place, prepend=0.0)).max(initial=0.0))
    # A row that is free begins a run, and stands where it should.
    raised = np.maximum.accumulate(place - step + apart * run) - apart * run + step
    last = run == run[-1]
    raised[last] = np.minimum(raised[last], place[-1] - (step[-1] - step[last]))
    return np.asarray(np.where(free, place, raised))
