"""The profile's pressure advance becomes the firmware's own command, where the firmware applies it to every bead.

Firmwares drive pressure advance from the whole extruder's motion, which is right on five axes too, but only in moves
of some linear axis: Klipper (`klippy/kinematics/extruder.py` move) and RepRapFirmware (`DDA::InitStandardMove`) want X
or Y, Marlin (`Planner::_populate_block`, LIN_ADVANCE) X, Y or Z, since it divides by their distance. A bead laid by
rotary joints alone would get none, and the pressure would jump where it begins and ends.
"""

import numpy as np

from trunnion_core.errors import GcodeError
from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.moves import Moves
from trunnion_gcode.words import number

OVERLOOKED = 0.005
"""Share of the plastic that may be laid in moves to which the firmware does not apply its pressure advance."""


def advance_lines(moves: Moves, profile: MachineProfile, dialect: Dialect) -> list[str]:
    """The command that turns pressure advance on, if the profile has any.

    GcodeError where the firmware has no such command, or where it would leave more than OVERLOOKED of the plastic
    without it because the axes that it looks at stand still.
    """
    seconds = profile.extruder.pressure_advance
    if seconds <= 0:
        return []
    if dialect.pressure_advance is None:
        raise GcodeError(
            f"{profile.file}: extruder.pressure_advance is {seconds:g} s, but {dialect.name} has no pressure advance; "
            "it should be 0"
        )
    seen = [column for column, joint in enumerate(profile.joints) if joint.letter in dialect.advance_axes]
    laid = np.where(moves.width > 0, moves.filament, 0.0)
    still = laid[(moves.step[:, seen] == 0).all(axis=1)].sum()
    if still > OVERLOOKED * laid.sum():
        raise GcodeError(
            f"{profile.file}: extruder.pressure_advance is {seconds:g} s, but {100 * still / laid.sum():.1f} % of the "
            f"plastic is laid while {' and '.join(dialect.advance_axes)} stand still, where {dialect.name} leaves "
            "pressure advance out; it should be 0 for this print"
        )
    return [dialect.pressure_advance % number("pressure advance", seconds, 4)]
