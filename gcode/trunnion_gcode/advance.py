"""Who carries the profile's pressure advance: the firmware, by its own command, or the filament words themselves.

A firmware drives pressure advance from the whole extruder's motion, which is right on five axes too, but leaves it out
of some moves: Klipper (`klippy/kinematics/extruder.py` check and move) and RepRapFirmware 3.6 (`DDA::InitStandardMove`,
`isPrintingMove`) where X and Y stand still, Marlin (`Planner::_populate_block`, LIN_ADVANCE) where X, Y and Z do and
where more than 3 mm of filament go with a millimetre of them, as on a table that turns under a nozzle that hardly
moves. LinuxCNC and grblHAL have none. Where more than OVERLOOKED of the plastic would go without, the firmware's own
is turned off for the whole program and the words carry all of it (`MachineProgram.advance`): beside a bead with the
firmware's advance, one with its own in the words would get the step of pressure between them twice or not at all,
for each firmware in another way.

RepRapFirmware (`Move::AddLinearSegments`, 3.6) adds K times the acceleration of the filament within a move and nothing
where its speed changes from move to move. On five axes filament to a mm of the joints changes in every row, so that its
sum drifts from K times the flow. As it follows nothing but ramps, words can carry the rest beside it: it stays on.
"""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.errors import GcodeError
from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.moves import Moves
from trunnion_gcode.words import number

OVERLOOKED = 0.005
"""Share of the plastic that may be laid in moves to which the firmware does not apply its pressure advance."""
DRIFT = 0.05
"""Of the flow: by so much may what a firmware adds in ramps alone differ from what the plastic needs."""
PLASTIC = "; plastic advance [s] = %s"
"""Tells readers how far the filament's drive has to run ahead of the nozzle, whoever sees to it."""


def words_carry_advance(moves: Moves, profile: MachineProfile, dialect: Dialect) -> bool:
    """Whether the filament words have to carry pressure advance, or what the firmware would leave out of it here."""
    if profile.extruder.pressure_advance <= 0:
        return False
    return max(overlooked(moves, profile, dialect), drifting(moves, profile, dialect)) > OVERLOOKED


def overlooked(moves: Moves, profile: MachineProfile, dialect: Dialect) -> float:
    """Share of the plastic, 0 to 1, in moves to which the firmware does not apply its own pressure advance."""
    laid = np.where((moves.width > 0) & (moves.filament > 0), moves.filament, 0.0)
    total = float(laid.sum())
    return float(laid[_left_out(moves, profile, dialect)].sum()) / total if total > 0 else 0.0


def drifting(moves: Moves, profile: MachineProfile, dialect: Dialect) -> float:
    """Share of the plastic, 0 to 1, that a firmware which follows ramps alone would lay by more than DRIFT off.

    Its sum keeps up with the filament to a unit of way as it was, while pressure forgets within K seconds.
    """
    seconds = profile.extruder.pressure_advance
    laid = (moves.width > 0) & (moves.filament > 0)
    if seconds <= 0 or not dialect.advance_in_ramps or not laid.any():
        return 0.0
    per_length = np.divide(moves.filament, moves.metric, out=np.zeros(len(laid)), where=laid & (moves.metric > 0))
    took = np.where(laid, moves.asked, 0.0)
    ends = np.append(0.0, np.cumsum(took))
    total = np.append(0.0, np.cumsum(per_length * took))
    begins = np.diff(laid.astype(np.int64), prepend=0) > 0
    run = ends[np.maximum.accumulate(np.where(begins, np.arange(len(laid)), 0))]
    since = np.maximum(ends[1:] - seconds, run)
    mean = (total[1:] - np.interp(since, ends, total)) / np.where(laid, ends[1:] - since, 1.0)
    off = laid & (np.abs(mean - per_length) > DRIFT * per_length)
    return float(moves.filament[off].sum() / moves.filament[laid].sum())


def advance_lines(carried: float, moves: Moves, profile: MachineProfile, dialect: Dialect) -> list[str]:
    """What the program says about pressure advance before its first move; nothing where the profile has none.

    `carried` s are in the filament words already (`MachineProgram.advance`), and the firmware's own is turned off.
    Else it is turned on; GcodeError where the firmware would leave more than OVERLOOKED of the plastic without it.
    """
    seconds = profile.extruder.pressure_advance
    if carried > 0:
        text = number("pressure advance", carried, 4)
        if dialect.advance_in_ramps and dialect.pressure_advance is not None:
            rest = "; the filament words carry what the firmware leaves out of it"
            return [PLASTIC % text, rest, dialect.pressure_advance % text]
        off = [] if dialect.pressure_advance is None else [dialect.pressure_advance % "0"]
        return [PLASTIC % text, "; the filament words carry it", *off]
    if seconds <= 0:
        return []
    if overlooked(moves, profile, dialect) > OVERLOOKED:
        share = 100 * overlooked(moves, profile, dialect)
        raise GcodeError(
            f"{profile.file}: extruder.pressure_advance is {seconds:g} s, but {dialect.name} applies none to "
            f"{share:.1f} % of the plastic, and the program's filament does not carry it; plan the program for this "
            "firmware, or set it to 0"
        )
    text = number("pressure advance", seconds, 4)
    return [PLASTIC % text, *([] if dialect.pressure_advance is None else [dialect.pressure_advance % text])]


def jump_limit(carried: float, moves: Moves, profile: MachineProfile, dialect: Dialect) -> FloatArray:
    """(m,) mm/s² to which the firmware slows ramps of the filament down under its own advance; inf where it does not.

    Ramps of a make the drive jump by K a. Marlin (LIN_ADVANCE in `Planner::_populate_block`) and RepRapFirmware
    (`DDA::InitStandardMove`) keep that below the extruder's jerk; Klipper does not. `carried` s are in the words.
    """
    seconds, extruder = profile.extruder.pressure_advance, profile.extruder
    off = carried > 0 and not dialect.advance_in_ramps
    if seconds <= 0 or off or dialect.planner.corners not in ("marlin", "reprapfirmware"):
        return np.full(len(moves.row), np.inf)
    jump, deviation = extruder.corner_speed, profile.planner.junction_deviation
    if dialect.planner.corners == "marlin" and deviation is not None:
        # `Planner::recalculate_max_e_jerk`.
        jump = float(np.sqrt(deviation * extruder.acceleration * np.sqrt(0.5) / (1 - np.sqrt(0.5))))
    left_out = _left_out(moves, profile, dialect) | (moves.filament <= 0)
    return np.where(left_out, np.inf, jump / seconds)


def _left_out(moves: Moves, profile: MachineProfile, dialect: Dialect) -> BoolArray:
    """(m,) moves to which the firmware applies no advance of its own."""
    if dialect.pressure_advance is None:
        return np.ones(len(moves.row), dtype=np.bool_)
    seen = [column for column, joint in enumerate(profile.joints) if joint.letter in dialect.advance_axes]
    way = np.linalg.norm(moves.word_step[:, seen], axis=1)
    return np.asarray((way == 0) | (moves.filament / np.where(way > 0, way, 1.0) > dialect.advance_ratio))
