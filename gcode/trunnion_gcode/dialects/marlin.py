"""Marlin 2.1 with rotary axes, joints programmed directly (no G43.4).

F is the length over X, Y and Z in mm; moves whose length there is under a micrometre count as rotary and F is in
degrees (MarlinFirmware/Marlin `Planner::get_move_distance`, `UNEAR_ZERO` on the squared length). Moves of fewer than
MIN_STEPS_PER_SEGMENT steps on every axis are measured over the filament. Arithmetic is in single precision.
"""

import functools

from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.metrics import linear_first
from trunnion_gcode.planner import Planner
from trunnion_gcode.stated import RELIES, axis_words, path_words, said

SHORTEST_LINEAR = 1e-3
"""mm: the square root of Marlin's UNEAR_ZERO."""


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """Limits of the axes, acceleration along the path, and the corner rule with its number."""
    deviation = profile.planner.junction_deviation
    corners = axis_words(profile, "corner_speed") if deviation is None else f"J{said(deviation)}"
    return (
        f"{RELIES} M203 {axis_words(profile, 'speed')}",
        f"{RELIES} M201 {axis_words(profile, 'acceleration')}",
        *path_words(profile),
        f"{RELIES} M205 {corners}",
    )


DIALECT = Dialect(
    name="marlin",
    metric=functools.partial(linear_first, threshold=SHORTEST_LINEAR),
    planner=Planner("marlin", blocks=2, unseen=2, slowest=0.05, in_steps=True),
    shortest=2 * SHORTEST_LINEAR,
    minimum_steps=6,
    pressure_advance="M900 K%s",
    advance_axes="XYZ",
    advance_ratio=3.0,
    setup=setup,
)
