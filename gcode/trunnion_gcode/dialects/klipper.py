"""Klipper with rotary axes as extra axes (`MANUAL_STEPPER ... GCODE_AXIS=`), joints programmed directly.

F is the length over X, Y and Z; where that is nothing it is the largest of the rotary angles and the filament
(Klipper3d/klipper `klippy/toolhead.py` Move). Coordinates are double precision. Klipper checks its own link and ignores
line numbers and checksums.
"""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import Joint, MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.planner import Planner
from trunnion_gcode.stated import RELIES, said, toolhead

STANDSTILL = 1e-9
"""mm. Klipper calls a move with less of X, Y and Z "not kinematic"."""
CRUISE_RATIO = 0.5
"""minimum_cruise_ratio, as Klipper has it by default."""
ANY_SECTION = 100.0
"""mm². Klipper refuses beads that are thicker over X, Y and Z, unless they are short (`extruder.py`, check_move)."""


def metric(linear: FloatArray, rotary: FloatArray, filament: FloatArray) -> FloatArray:
    """Length over the linear axes, else the largest single change of an extra axis."""
    straight = np.linalg.norm(linear, axis=1)
    extra = np.abs(np.column_stack([rotary, filament])).max(axis=1)
    return np.asarray(np.where(straight >= STANDSTILL, straight, extra))


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """The lines of printer.cfg, and how the rotary joints are tied to their letters, once, in the start macro."""
    head, extruder = toolhead(profile), profile.extruder
    climb = [joint for joint in profile.joints if joint.letter == "Z"]
    z = [f"max_z_velocity: {said(joint.speed)}, max_z_accel: {said(joint.acceleration)}" for joint in climb]
    printer = [
        f"max_velocity: {said(head.speed)}, max_accel: {said(head.acceleration)}",
        f"square_corner_velocity: {said(head.corner_speed)}, minimum_cruise_ratio: {said(CRUISE_RATIO)}",
        *z,
    ]
    filament = [
        f"max_extrude_only_velocity: {said(extruder.speed)}, max_extrude_only_accel: {said(extruder.acceleration)}",
        f"instantaneous_corner_velocity: {said(extruder.corner_speed)}",
        f"max_extrude_cross_section = {said(ANY_SECTION)} (where the part turns, X, Y and Z may hardly move)",
    ]
    return (
        *(f"{RELIES} [printer] {line}" for line in printer),
        *(f"{RELIES} [extruder] {line}" for line in filament),
        *(_tied(joint) for joint in profile.joints if joint.rotary),
    )


def _tied(joint: Joint) -> str:
    return (
        f"{RELIES} MANUAL_STEPPER STEPPER={joint.letter.lower()} GCODE_AXIS={joint.letter} "
        f"LIMIT_VELOCITY={said(joint.shown(joint.speed))} LIMIT_ACCEL={said(joint.shown(joint.acceleration))} "
        f"INSTANTANEOUS_CORNER_VELOCITY={said(joint.shown(joint.corner_speed))}"
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
