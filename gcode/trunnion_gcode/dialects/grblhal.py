"""grblHAL with rotary axes, joints programmed directly, in inverse time (G93); the filament is a U axis.

With G94 grblHAL reads F over all axes together, millimetres and degrees mixed, or over the linear ones, as it was built
(`ROTARY_FIX`); with G93 it is one over the minutes either way (grblHAL/core `planner.c`, `plan_buffer_line`). It knows
no E word: filament is absolute U from 0, whose steps, rate and acceleration are those of the extruder. G0 ignores F,
so travels are G1 as well. Heaters and fan need plugins that take the M codes of printers.
"""

from trunnion_gcode.dialect import Dialect
from trunnion_gcode.metrics import all_axes
from trunnion_gcode.planner import Planner

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
)
