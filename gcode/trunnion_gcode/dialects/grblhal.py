"""grblHAL with rotary axes, joints programmed directly, in inverse time (G93); the filament is a U axis.

With G94 grblHAL reads F over all axes together, millimetres and degrees mixed, or over the linear ones, as it was built
(`ROTARY_FIX`); with G93 it is one over the minutes either way (grblHAL/core `planner.c`, `plan_buffer_line`). It knows
no E word: filament is absolute U from 0, whose steps, rate and acceleration are those of the extruder. G0 ignores F,
so travels are G1 as well. Heaters and fan need plugins that take the M codes of printers.
"""

from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.metrics import all_axes
from trunnion_gcode.planner import Planner
from trunnion_gcode.stated import MINUTE, RELIES, said

AXES = "XYZABCUV"
"""Order of the axes in the settings."""


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """Settings $11, $110 to $117 (units/min) and $120 to $127 (units/s²)."""
    deviation = profile.planner.junction_deviation
    limits = [(joint.letter, joint.shown(joint.speed), joint.shown(joint.acceleration)) for joint in profile.joints]
    limits.append(("U", profile.extruder.speed, profile.extruder.acceleration))
    places = [(AXES.index(letter), v, a) for letter, v, a in limits if letter in AXES]
    return (
        f"{RELIES} $11={said(DEVIATION if deviation is None else deviation)}",
        *(f"{RELIES} $11{place}={said(v * MINUTE)} $12{place}={said(a)}" for place, v, a in sorted(places)),
    )


DEVIATION = 0.01
"""mm. What grblHAL is shipped with, where the profile gives no junction deviation."""

DIALECT = Dialect(
    name="grblhal",
    metric=all_axes,
    planner=Planner("grbl", blocks=35, slowest=1.0 / 60.0),
    inverse_time=True,
    relative_extrusion=False,
    extruder="U",
    travel="G1",
    start=("G21", "G17", "G40", "G80", "G90", "G92 U0", "G93"),
    finish=("G94", "M2"),
    progress=None,
    checksums=False,
    shortest=2e-3,
    max_line=250,
    setup=setup,
)
