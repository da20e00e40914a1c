"""The limits a firmware works with while it executes a program: those of the profile, as the program changes them.

Programs of desktop slicers raise and lower limits (M201, M203, M204, M205; M566 in RepRapFirmware), so each row refers
to one row of a table of limits. The extruder is the last column.
"""

import math
from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_sim.motion import Command, Motion


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits in mm and degrees. Row i of the motion works under row `which[i]` of the tables."""

    which: IntArray
    """(n,)."""
    speed: FloatArray
    """(m, k + 1) per second."""
    acceleration: FloatArray
    """(m, k + 1) per second²."""
    corner: FloatArray
    """(m, k + 1) per second: what may jump."""
    path: FloatArray
    """(m, 3) acceleration along the path in mm/s² when printing, travelling and retracting."""
    slowest: FloatArray
    """(m, 1) per second along the firmware's metric: slower moves are sped up to this."""


def limits_of(motion: Motion, profile: MachineProfile, slowest: float) -> Limits:
    """Follow the limit-setting commands of the program from the profile's own limits and the firmware's `slowest`."""
    extruder, planner = profile.extruder, profile.planner
    scale = profile.to_shown
    now = {
        "speed": np.append(profile.array("speed") * scale, extruder.speed),
        "acceleration": np.append(profile.array("acceleration") * scale, extruder.acceleration),
        "corner": np.append(profile.array("corner_speed") * scale, extruder.corner_speed),
    }
    printing = math.inf if planner.acceleration is None else planner.acceleration
    travel = printing if planner.travel_acceleration is None else planner.travel_acceleration
    now["path"] = np.array([printing, travel, math.inf])
    now["slowest"] = np.array([slowest])
    tables = {name: [value] for name, value in now.items()}
    which = np.zeros(len(motion), np.int64)
    for command in motion.commands:
        changed = _change(command, now, profile)
        if changed:
            now = now | changed
            for name, value in now.items():
                tables[name].append(value)
            which[command.row :] = len(tables["speed"]) - 1
    return Limits(which=which, **{name: np.stack(values) for name, values in tables.items()})


def _change(command: Command, now: dict[str, FloatArray], profile: MachineProfile) -> dict[str, FloatArray]:
    """What one command sets; empty where it sets nothing new."""
    name = command.name
    per_axis = {
        "M201": ("acceleration", 1.0),
        "M203": ("speed", 1.0),
        "M205": ("corner", 1.0),
        "M566": ("corner", 60.0),
    }
    if name in per_axis:
        table, divisor = per_axis[name]
        if name == "M203" and profile.firmware == "reprapfirmware":
            divisor = 60.0
        values = now[table].copy()
        for column, letter in enumerate((*profile.letters, "E")):
            value = command.get(letter)
            if value is not None and value > 0:
                values[column] = value / divisor
        lowest = now["slowest"]
        if name == "M203" and profile.firmware == "reprapfirmware" and (least := command.get("I")) is not None:
            lowest = np.array([max(least, 0.0) / 60.0])
        changed = {table: values, "slowest": lowest}
        return {key: value for key, value in changed.items() if (value != now[key]).any()}
    if name == "M204":
        path = now["path"].copy()
        both = command.get("S")
        for column, letter in enumerate("PTR"):
            value = command.get(letter)
            if value is None and letter != "R":
                value = both
            if value is not None and value > 0:
                path[column] = value
        return {} if (path == now["path"]).all() else {"path": path}
    return {}
