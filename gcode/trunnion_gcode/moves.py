"""A machine program becomes the moves that are written: rounded joint words, filament words, seconds.

Rows whose words would not change are merged with the next row; so are rows too short for the firmware to read F right,
as long as leaving out their end bends the path by no more than MERGE_DEVIATION. Rows that the firmware would join in
any case (`joining`) are one move whatever it bends: their words would not be followed.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.errors import GcodeError, ProfileError
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_core.roles import Role
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.joining import DOUBT, ends_kept, step_places
from trunnion_gcode.waiting import waiting
from trunnion_gcode.words import carried_ticks, from_ticks, ticks

MERGE_DEVIATION = 0.004
"""mm or degrees. How far leaving out a point may bend the joints' path: below the chord tolerance of any print."""
TURN = np.cos(np.radians(60.0))
"""A sharper corner of the tip's path stays a corner: joined out and back, a bead would be laid on half its way."""
NO_FILAMENT = 1e-9
"""mm. Less is the rounding of a bead without length, for which there is no line to write."""
MERGE_PASSES = 6
"""Each pass can halve the number of rows, so this merges up to 64 into one."""


@dataclass(frozen=True, eq=False)
class Moves:
    """Move i ends what program row `row[i]` ends. Numbers are as a reader of the words gets them back."""

    row: IntArray
    """(m,) rows of the program, rising."""
    joint_ticks: IntArray
    """(m, k) of the words under the joints' letters."""
    step: FloatArray
    """(m, k) mm or degrees that each joint moves: what its word changes by, where words are joints."""
    word_step: FloatArray
    """(m, k) mm or degrees that each word changes by."""
    filament_ticks: IntArray
    """(m,)."""
    filament: FloatArray
    """(m,) mm."""
    seconds: FloatArray
    """(m,) planned."""
    asked: FloatArray
    """(m,) s that F asks for: those at the speed that the firmware ramps up to."""
    metric: FloatArray
    """(m,) length over which the firmware reads F."""
    place: FloatArray
    """(m + 1, k) mm or degrees where the joints stand at the start and after each move."""
    width: FloatArray
    """(m,) mm of the bead; of merged rows the mean over the length of the tip's path."""
    height: FloatArray
    """(m,) mm, likewise."""


def make_moves(program: MachineProgram, profile: MachineProfile, dialect: Dialect) -> Moves:
    """Round, merge and measure.

    GcodeError names the row and joint of a number that cannot be written, ProfileError says why the machine cannot be
    driven in this dialect.
    """
    reason = dialect.refuses(profile)
    if reason is not None:
        raise ProfileError(profile.file, [f"machine.firmware: {reason}"])
    decimals = joint_decimals(profile)
    values, first = _values(program, profile, dialect)
    words = np.stack(
        [ticks(joint.letter, values[:, k], decimals[k]) for k, joint in enumerate(profile.joints)], axis=1
    ).reshape(len(program), len(profile.joints))
    start = np.array(
        [ticks(f"start {joint.letter}", first[k : k + 1], decimals[k])[0] for k, joint in enumerate(profile.joints)]
    )
    kept = _written(program, words, start)
    merged_deviation = np.zeros(len(program))
    for _ in range(MERGE_PASSES):
        if not _merge_once(kept, merged_deviation, program, words, start, profile, dialect):
            break
    moves = _measured(kept, program, words, start, profile, dialect)
    if dialect.minimum_steps and len(moves.row):
        run = np.append(0, np.cumsum(~_alike(moves.row, program) | _turns(moves.row, program)))
        kept[moves.row[~ends_kept(_places(moves, profile), run, dialect.minimum_steps)]] = False
        moves = _measured(kept, program, words, start, profile, dialect)
    if dialect.planner.slowest > 0:
        words[moves.row] = _waiting(moves, start, profile, dialect.planner.slowest)
        moves = _measured(kept, program, words, start, profile, dialect)
    nothing = moves.metric <= 0
    if nothing.any():
        # Out and back, merged, or filament below the last decimal: what it took and fed goes to the next move.
        kept[moves.row[nothing]] = False
        moves = _measured(kept, program, words, start, profile, dialect)
    return moves


def _values(program: MachineProgram, profile: MachineProfile, dialect: Dialect) -> tuple[FloatArray, FloatArray]:
    """(n, k) numbers under the joints' letters at the rows' ends, and (k,) at the start: mm and degrees."""
    values, first = program.joints * profile.to_shown, program.start * profile.to_shown
    if not dialect.tip_words:
        return values, first
    if len(program.tip) != len(program) + 1:
        raise GcodeError(f"{dialect.name} is told tips, but the program has none: MachineProgram.tip is empty")
    # With all rotaries at zero the tip stands at profile.tip plus the linear words: those words reach the tip's place.
    world = program.tip + profile.origin - profile.tip
    for k, joint in enumerate(profile.joints):
        if not joint.rotary:
            values[:, k], first[k] = world[1:, "XYZ".index(joint.letter)], world[0, "XYZ".index(joint.letter)]
    return values, first


def joint_decimals(profile: MachineProfile) -> list[int]:
    """Decimals of every joint's word, in profile order."""
    table = profile.gcode
    return [table.decimals_rotary if joint.rotary else table.decimals_linear for joint in profile.joints]


def _waiting(moves: Moves, start: IntArray, profile: MachineProfile, slowest: float) -> IntArray:
    """(m, k) words whose linear ones wait while they creep beside a turn, so that F is not about the creeping.

    Slower than the firmware's `slowest` speed they would drive the turn faster than planned. None waits until it is
    MERGE_DEVIATION off.
    """
    unit = 10.0 ** -np.array(joint_decimals(profile))
    linear = np.array([not joint.rotary for joint in profile.joints])
    turns = (moves.word_step[:, ~linear] != 0).any(axis=1)
    least = np.where(turns, np.minimum(slowest * moves.asked, MERGE_DEVIATION), 0.0)
    words = moves.joint_ticks.copy()
    words[:, linear] = waiting(words[:, linear], start[linear], least, unit[linear])
    return words


def _asked(program: MachineProgram) -> FloatArray:
    """(n,) s that F asks for on every row."""
    return program.cruise if program.cruise.size else program.duration


def _written(program: MachineProgram, words: IntArray, start: IntArray) -> BoolArray:
    """(n,) rows that need a line: a word changes, or filament moves while the joints are meant to stand."""
    moves = (np.diff(words, axis=0, prepend=start[None]) != 0).any(axis=1)
    return np.asarray(moves | _filament_only(program))


def _filament_only(program: MachineProgram) -> BoolArray:
    """(n,) rows on which filament moves while the joints are meant to stand."""
    stands = (np.diff(program.joints, axis=0, prepend=program.start[None]) == 0).all(axis=1)
    return np.asarray(
        (np.abs(program.filament) > NO_FILAMENT)
        & (stands | (program.role == Role.RETRACT) | (program.role == Role.PRIME))
    )


def _merge_once(
    kept: BoolArray,
    deviation: FloatArray,
    program: MachineProgram,
    words: IntArray,
    start: IntArray,
    profile: MachineProfile,
    dialect: Dialect,
) -> bool:
    """Leave out ends of rows too short for F, never two neighbours in one pass; whether any was left out.

    `deviation` bounds how far what was left out lies from the path: old chord to point plus new chord to old chord.
    """
    moves = _measured(kept, program, words, start, profile, dialect)
    rows = moves.row
    if len(rows) < 3:
        return False
    moving = (moves.step != 0).any(axis=1)
    short = moves.metric < dialect.shortest
    if dialect.minimum_steps:
        steps = np.abs(np.diff(_places(moves, profile)[:, :-1], axis=0))
        short |= (steps < dialect.minimum_steps + DOUBT).all(axis=1)
    short &= moving
    here, there = rows[:-1], rows[1:]
    alike = _alike(rows, program) & moving[:-1] & moving[1:]
    bend = np.maximum(deviation[here], deviation[there]) + _distance_from_chord(moves.step)
    candidate = (short[:-1] | short[1:]) & alike & (bend <= MERGE_DEVIATION)
    chosen = _no_neighbours(candidate)
    if not chosen.any():
        return False
    kept[here[chosen]] = False
    deviation[there[chosen]] = bend[chosen]
    return True


def _alike(rows: IntArray, program: MachineProgram) -> BoolArray:
    """(m - 1,) whether moves that end at `rows` (m,) and follow each other do the same thing, nothing in between."""
    here, there = rows[:-1], rows[1:]
    event_rows = np.unique([event.row for event in program.events]).astype(np.int64)
    event_between = np.searchsorted(event_rows, there, "right") > np.searchsorted(event_rows, here, "right")
    return np.asarray(
        (program.role[here] == program.role[there])
        & (program.layer[here] == program.layer[there])
        & (program.tip_speed[here] == program.tip_speed[there])
        & ~event_between
    )


def _turns(rows: IntArray, program: MachineProgram) -> BoolArray:
    """(m - 1,) whether the tip's path turns sharply between moves that end at `rows` (m,)."""
    if len(program.tip) != len(program) + 1:
        return np.zeros(len(rows) - 1, dtype=np.bool_)
    way = np.diff(program.tip[np.append(0, rows + 1)], axis=0)
    length = np.linalg.norm(way, axis=1)
    return np.asarray((way[1:] * way[:-1]).sum(axis=1) < TURN * length[1:] * length[:-1])


def _places(moves: Moves, profile: MachineProfile) -> FloatArray:
    """(m + 1, k + 1) motor steps of joints and filament at the start and after each move."""
    return step_places(moves.place, np.append(0.0, np.cumsum(moves.filament)), profile)


def _distance_from_chord(step: FloatArray) -> FloatArray:
    """(m - 1,) distance of the end of move i from the straight line that moves i and i + 1 make together."""
    first, second = step[:-1], step[1:]
    chord = first + second
    square = np.einsum("ij,ij->i", chord, chord)
    along = np.clip(np.einsum("ij,ij->i", first, chord) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(first - along[:, None] * chord, axis=1))


def _no_neighbours(candidate: BoolArray) -> BoolArray:
    """Every other one of each run of candidates, starting with its first."""
    index = np.arange(len(candidate))
    run_start = np.maximum.accumulate(np.where(candidate & ~np.roll(candidate, 1), index, 0))
    return np.asarray(candidate & ((index - run_start) % 2 == 0))


def _measured(
    kept: BoolArray,
    program: MachineProgram,
    words: IntArray,
    start: IntArray,
    profile: MachineProfile,
    dialect: Dialect,
) -> Moves:
    """The moves that end at kept rows; each takes the seconds and filament of the rows merged into it.

    Filament never lands on a row that is a travel: its remainder waits for the next row that feeds.
    """
    rows = np.flatnonzero(kept)
    joint_ticks = words[rows]
    scale = 10.0 ** np.array(joint_decimals(profile))
    word_step = np.diff(joint_ticks, axis=0, prepend=start[None]) / scale
    step, place = word_step, np.concatenate([start[None], joint_ticks]) / scale
    if dialect.tip_words:
        place = np.concatenate([program.start[None], program.joints[rows]]) * profile.to_shown
        step = np.diff(place, axis=0)
    feeding = np.flatnonzero(~np.isin(program.role[rows], (Role.TRAVEL, Role.LINK)))
    filament_ticks = np.zeros(len(rows), dtype=np.int64)
    fed = np.diff(np.cumsum(program.filament)[rows[feeding]], prepend=0.0)
    filament_ticks[feeding] = carried_ticks(dialect.extruder, fed, profile.gcode.decimals_extruder)
    filament = from_ticks(filament_ticks, profile.gcode.decimals_extruder)
    rotary = np.array([joint.rotary for joint in profile.joints])
    metric = dialect.metric(word_step[:, ~rotary], word_step[:, rotary], filament)
    if dialect.minimum_steps:
        # Marlin measures what hardly moves the joints over the filament alone.
        steps = np.abs(np.diff(step_places(place, np.append(0.0, np.cumsum(filament)), profile), axis=0))
        fed_only = (steps[:, :-1] < dialect.minimum_steps).all(axis=1) & (steps[:, -1] >= dialect.minimum_steps)
        metric = np.where(fed_only, np.abs(filament), metric)
    return Moves(
        row=rows,
        joint_ticks=joint_ticks,
        step=step,
        word_step=word_step,
        filament_ticks=filament_ticks,
        filament=filament,
        seconds=np.diff(np.cumsum(program.duration)[rows], prepend=0.0),
        asked=np.diff(np.cumsum(_asked(program))[rows], prepend=0.0),
        metric=metric,
        place=place,
        width=_mean_over_merged(program.width, program.tip_length, rows),
        height=_mean_over_merged(program.height, program.tip_length, rows),
    )


def _mean_over_merged(values: FloatArray, length: FloatArray, rows: IntArray) -> FloatArray:
    """(m,) values at `rows`; where rows were merged into one, the mean weighted by length."""
    along = np.diff(np.cumsum(length)[rows], prepend=0.0)
    total = np.diff(np.cumsum(values * length)[rows], prepend=0.0)
    merged = (np.diff(rows, prepend=-1) > 1) & (values[rows] > 0) & (along > 0)
    return np.asarray(np.where(merged, total / np.where(along > 0, along, 1.0), values[rows]))
