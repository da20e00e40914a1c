"""LinuxCNC in joint coordinates (TCP off) with inverse time feed, the filament as a U axis.

RS274NGC knows no E word, no relative mode for one axis and no heaters: filament is absolute U from 0 (`G92 U0`), and
M100 to M199 are user-defined commands with P words, which the machine's configuration has to supply. G0 ignores F, so
travels are G1 as well. With G93 every move carries F, one over its minutes.
"""

from trunnion_gcode.dialect import Dialect
from trunnion_gcode.metrics import linear_then_filament
from trunnion_gcode.planner import Planner

TOLERANCE = 0.01
"""mm that corners may be rounded by."""

SLOWEST = 0.1 / 60.0
"""Units/s that G93 reads at least (`src/emc/rs274ngc/interp_inverse.cc`, inverse_time_rate_straight)."""

DIALECT = Dialect(
    name="linuxcnc",
    metric=linear_then_filament,
    planner=Planner("blend", slowest=SLOWEST, tolerance=TOLERANCE),
    inverse_time=True,
    relative_extrusion=False,
    extruder="U",
    travel="G1",
    start=("G21", "G17", "G40", "G49", "G80", "G90", "G92 U0", f"G64 P{TOLERANCE}", "G93"),
    finish=("G94", "M2"),
    nozzle_temperature="M104 P%s",
    wait_nozzle="M109 P%s",
    bed_temperature="M140 P%s",
    wait_bed="M190 P%s",
    fan="M106 P%s",
    progress=None,
    checksums=False,
    shortest=2e-3,
    max_line=255,
)
