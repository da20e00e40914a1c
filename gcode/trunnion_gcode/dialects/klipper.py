"""Klipper with rotary axes as extra axes (`MANUAL_STEPPER ... GCODE_AXIS=`), joints programmed directly.

F is the length over X, Y and Z; where that is nothing it is the largest of the rotary angles and the filament
(Klipper3d/klipper `klippy/toolhead.py` Move). Coordinates are double precision. Klipper checks its own link and ignores
line numbers and checksums.
"""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.planner import Planner

STANDSTILL = 1e-9
"""mm. Klipper calls a move with less of X, Y and Z "not kinematic"."""


def metric(linear: FloatArray, rotary: FloatArray, filament: FloatArray) -> FloatArray:
    """Length over the linear axes, else the largest single change of an extra axis."""
    straight = np.linalg.norm(linear, axis=1)
    extra = np.abs(np.column_stack([rotary, filament])).max(axis=1)
    return np.asarray(np.where(straight >= STANDSTILL, straight, extra))


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """How the rotary joints are tied to their letters, once, in the printer's own start macro."""
    return tuple(
        f"; klipper needs: MANUAL_STEPPER STEPPER={joint.letter.lower()} GCODE_AXIS={joint.letter}"
        for joint in profile.joints
        if joint.rotary
    )


DIALECT = Dialect(
    name="klipper",
    metric=metric,
    planner=Planner("klipper"),
    pause="PAUSE",
    checksums=False,
    shortest=2e-3,
    max_line=4096,
    setup=setup,
    pressure_advance="SET_PRESSURE_ADVANCE ADVANCE=%s",
)
