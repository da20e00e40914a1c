"""RepRapFirmware 3 on Duet boards: joint space, F over the linear axes if any of them moves, else in degrees.

Duet3D/RepRapFirmware `DDA::InitStandardMove` follows NIST RS274NGC 2.1.2.5 rule A on the exact coordinates, then lifts
the speed to the machine's minimum (30 mm/min unless M203 I says otherwise).
"""

from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.metrics import linear_first
from trunnion_gcode.planner import Planner
from trunnion_gcode.stated import MINUTE, RELIES, axis_words, path_words


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """Limits of the axes, acceleration of moves in X or Y, jerk, and that only moves of one kind are melded."""
    return (
        f"{RELIES} M203 {axis_words(profile, 'speed', MINUTE)}",
        f"{RELIES} M201 {axis_words(profile, 'acceleration')}",
        *path_words(profile),
        f"{RELIES} M566 P0 {axis_words(profile, 'corner_speed', MINUTE)}",
        f'{RELIES} M584 R1 for the rotary axes, M593 P"none"',
    )


DIALECT = Dialect(
    name="reprapfirmware",
    metric=linear_first,
    planner=Planner("reprapfirmware", blocks=40),
    pause="M226",
    max_line=200,
    shortest=2e-3,
    minimum_speed=0.5,
    allow_slower="M203 I%s",
    setup=setup,
    pressure_advance="M572 D0 S%s",
    advance_in_ramps=True,
    draws_back=False,
)
