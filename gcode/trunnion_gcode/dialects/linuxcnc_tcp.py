"""LinuxCNC with the world coordinates of xyzac-trt-kins or xyzbc-trt-kins: X, Y and Z are the tip over the part.

With those kinematics F is the speed of the tip over the part under G94; here G93 is kept, which also covers moves that
only turn (LinuxCNC `src/emc/kinematics/trtfuncs.c`). Tables turn right-handed about +X, +Y and +Z for growing words, or
all the other way with the pin conventional-directions. The filament is a U axis, as in the dialect `linuxcnc`.
"""

import dataclasses

from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialects import linuxcnc
from trunnion_gcode.stated import RELIES
from trunnion_gcode.tables import pivots, table_problem, turning_signs
from trunnion_gcode.words import number

PINS = ("x-rot-point", "y-rot-point", "z-rot-point", "x-offset", "y-offset", "z-offset")


def refuses(profile: MachineProfile) -> str | None:
    """Besides the geometry, both tables have to turn the same way about their axes."""
    problem = table_problem(profile)
    if problem is None and len(turning_signs(profile)) > 1:
        return "LinuxCNC's table kinematics want both tables to turn right-handed about their axes, or both left-handed"
    return problem


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """Which kinematics and pins the machine's configuration must have."""
    tilt = profile.joints[profile.rotary[0]].letter.lower()
    name = f"xyz{tilt}c-trt-kins"
    zero, offset = pivots(profile)
    pins = (f"; setp {name}.{pin} {number(pin, v, 4)}" for pin, v in zip(PINS, (*zero, *offset), strict=True))
    conventional = 0 if turning_signs(profile) == {1} else 1
    return (
        f"{RELIES} [KINS] KINEMATICS = {name} coordinates=xyz{tilt}cu",
        *pins,
        f"; setp {name}.conventional-directions {conventional}",
        *linuxcnc.axes(profile),
    )


DIALECT = dataclasses.replace(linuxcnc.DIALECT, name="linuxcnc_tcp", tip_words=True, refuses=refuses, setup=setup)
