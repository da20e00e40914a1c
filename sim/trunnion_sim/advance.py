"""What the extruder pushes at any instant: the filament of the row in step with its speed, and pressure advance.

Marlin's LIN_ADVANCE (`module/planner.cpp`, `stepper.cpp`), RepRapFirmware's M572 (`Movement/DDA.cpp`) and Klipper's
SET_PRESSURE_ADVANCE (`klippy/kinematics/extruder.py`) add K times the change of the filament's speed, in rows that feed
while certain axes move (`Rules`). K is what the program says; a program that is silent about it leaves the firmware's
own setting, which nobody here knows, and none is counted. Where the filament's speed jumps, at corners and where
feeding begins at speed, the firmware catches up within its own limits; such a jump has no duration here and no flow.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_sim.limits import Limits
from trunnion_sim.motion import Motion
from trunnion_sim.rules import Rules

if TYPE_CHECKING:
    from trunnion_sim.replay import Replay

COMMANDS = {"M900": "K", "M572": "S", "SET_PRESSURE_ADVANCE": "ADVANCE"}
"""Commands that set the firmware's advance, and the word with the seconds."""


def pushed(replay: "Replay", motion: Motion, profile: MachineProfile, rules: Rules, times: FloatArray) -> FloatArray:
    """(m,) mm³/s that the extruder's motor moves at `times` (m,) s; negative where it is drawn back, 0 at rest.

    With pressure advance it runs ahead of what leaves the nozzle: more while the tip speeds up, less while it brakes.
    """
    row, _, speed = replay.at(times)
    t = times - replay.begin[row]
    acceleration = replay.acceleration[row]
    up = (replay.cruise[row] - replay.entry[row]) / acceleration
    down = (replay.cruise[row] - replay.exit[row]) / acceleration
    change = np.where(t < up, acceleration, np.where(t > replay.duration[row] - down, -acceleration, 0.0))
    length = replay.length[row]
    ratio = np.divide(motion.filament[row], length, out=np.zeros(len(row)), where=length > 0)
    moving = speed > 0
    ahead = own_advance(motion, profile, rules)[row] * change
    return np.asarray(np.where(moving, ratio * (speed + ahead), 0.0) * profile.filament_area)


def own_advance(motion: Motion, profile: MachineProfile, rules: Rules) -> FloatArray:
    """(n,) s of the firmware's own advance on every row; 0 where it applies none, or the program sets none."""
    seen = [column for column, joint in enumerate(profile.joints) if joint.letter in rules.advance_axes]
    way = np.linalg.norm((motion.joints - motion.before)[:, seen], axis=1)
    little = motion.filament <= rules.advance_ratio * np.where(way > 0, way, 1.0)
    return np.where((motion.filament > 0) & (way > 0) & little, commanded(motion), 0.0)


def drive_limit(motion: Motion, profile: MachineProfile, rules: Rules, limits: Limits) -> FloatArray:
    """(n,) mm/s² that the filament of every row may speed up by under the firmware's own advance; inf without.

    The drive jumps by K times that where a ramp begins. Marlin (`Planner::_populate_block`: MAX_E_JERK over K and the
    filament to a mm) and RepRapFirmware (`DDA::InitStandardMove`: M566 E over K) lower the acceleration until it may.
    """
    if rules.advance == "at once":
        return np.full(len(motion), np.inf)
    jump = limits.corner[limits.which, -1]
    deviation = profile.planner.junction_deviation
    if rules.corners == "marlin" and deviation is not None and deviation > 0:
        # Without classic jerk, `recalculate_max_e_jerk`: the corner of 90 degrees that the drive alone would take.
        half = math.sqrt(0.5)
        jump = np.sqrt(deviation * half / (1 - half) * limits.acceleration[limits.which, -1])
    seconds = own_advance(motion, profile, rules)
    return np.asarray(np.divide(jump, seconds, out=np.full(len(motion), np.inf), where=seconds > 0))


def commanded(motion: Motion) -> FloatArray:
    """(n,) s that the commands in force say; 0 before any."""
    seconds = np.zeros(len(motion))
    for command in motion.commands:
        value = command.get(COMMANDS[command.name]) if command.name in COMMANDS else None
        if value is not None and 0 <= value < np.inf:
            seconds[command.row :] = value
    return seconds
