"""What the extruder pushes at any instant: the filament of the row in step with its speed, and pressure advance.

Marlin's LIN_ADVANCE (`module/planner.cpp`, `stepper.cpp`) and RepRapFirmware's M572 both add K times the change of
the filament's speed, in rows that feed while a linear joint moves. K is what the program says (M900 K, M572 S); a
program that is silent about it leaves the firmware's own setting, which nobody here knows, and none is counted. Where
the filament's speed jumps, at corners and where feeding begins at speed, the firmware catches up within its own limits;
such a jump has no duration here and no flow.
"""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_sim.motion import Motion
from trunnion_sim.replay import Replay

COMMANDS = {"M900": "K", "M572": "S"}


def flow(replay: Replay, motion: Motion, profile: MachineProfile, times: FloatArray) -> FloatArray:
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
    ahead = advance(motion, profile)[row] * change
    return np.asarray(np.where(moving, ratio * (speed + ahead), 0.0) * profile.filament_area)


def advance(motion: Motion, profile: MachineProfile) -> FloatArray:
    """(n,) s of pressure advance that applies to every row; 0 where the firmware applies none."""
    seconds = np.zeros(len(motion))
    for command in motion.commands:
        value = command.get(COMMANDS[command.name]) if command.name in COMMANDS else None
        if value is not None and value >= 0:
            seconds[command.row :] = value
    linear = [column for column, joint in enumerate(profile.joints) if not joint.rotary]
    moves = (np.abs(motion.joints - motion.before)[:, linear] > 0).any(axis=1)
    return np.where(moves & (motion.filament > 0), seconds, 0.0)
