"""What a program's comments say that its plan relies on, as limits: which quantity of which axis, and its value.

`; the plan relies on` is followed by the firmware's own words: M201, M203, M204, M205 and M566, Klipper's config keys,
grblHAL's settings, LinuxCNC's ini entries. Each is compared with the same number of the profile.
"""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from trunnion_core.profile import MachineProfile

RELIES = "the plan relies on "
SETTINGS_AXES = "XYZABCUV"
"""Order of the axes in grblHAL's settings $110 and $120."""
_NUMBER = r"(\d+(?:\.\d+)?)"
_WORD = re.compile(r"([A-Z])" + _NUMBER)
_KEY = re.compile(r"(\w+): " + _NUMBER)
_TIED = re.compile(
    rf"GCODE_AXIS=([A-Z]) LIMIT_VELOCITY={_NUMBER} LIMIT_ACCEL={_NUMBER} INSTANTANEOUS_CORNER_VELOCITY={_NUMBER}"
)
_SETTING = re.compile(r"\$(\d{2,3})=" + _NUMBER)
_INI = re.compile(rf"\[AXIS_([A-Z])\].*MAX_VELOCITY = {_NUMBER} MAX_ACCELERATION = {_NUMBER}")
_CODES = {"M203": "speed", "M201": "acceleration", "M205": "corner speed", "M566": "corner speed"}


@dataclass(frozen=True)
class Stated:
    """One limit, mm or degrees and s."""

    axis: str
    """Letter of a joint or E; empty where it is about the path."""
    what: str
    value: float
    profile: float
    """What the profile says; inf where it gives no limit."""


def stated_limits(lines: Iterable[str], profile: MachineProfile) -> Iterator[Stated]:
    """Every limit that the lines (after RELIES) name and the profile has too."""
    known = _of_profile(profile)
    for line in lines:
        for axis, what, value in _read(line, profile.firmware):
            if (axis, what) in known:
                yield Stated(axis, what, value, known[axis, what])


def _of_profile(profile: MachineProfile) -> dict[tuple[str, str], float]:
    """The profile's numbers, by axis and quantity."""
    extruder, planner = profile.extruder, profile.planner
    known = {
        ("E", "speed"): extruder.speed,
        ("E", "acceleration"): extruder.acceleration,
        ("E", "corner speed"): extruder.corner_speed,
    }
    for joint in profile.joints:
        known[joint.letter, "speed"] = joint.shown(joint.speed)
        known[joint.letter, "acceleration"] = joint.shown(joint.acceleration)
        known[joint.letter, "corner speed"] = joint.shown(joint.corner_speed)
    straight = [joint for joint in profile.joints if not joint.rotary]
    plane = [joint for joint in straight if joint.letter != "Z"]
    printing = math.inf if planner.acceleration is None else planner.acceleration
    if plane:
        weakest = min(joint.acceleration for joint in plane)
        known["", "max_velocity"] = max(joint.speed for joint in straight)
        known["", "max_accel"] = weakest if planner.acceleration is None else planner.acceleration
        known["", "square_corner_velocity"] = min(joint.corner_speed for joint in plane)
    known["", "printing acceleration"] = printing
    known["", "travel acceleration"] = printing if planner.travel_acceleration is None else planner.travel_acceleration
    deviation = planner.junction_deviation
    if deviation is not None or profile.firmware == "grblhal":
        known["", "junction deviation"] = 0.01 if deviation is None else deviation
    return known


def _read(line: str, firmware: str) -> Iterator[tuple[str, str, float]]:
    """Axis, quantity and value of everything that one line names."""
    code, _, rest = line.partition(" ")
    if code in _CODES:
        minutes = code == "M566" or (code == "M203" and firmware == "reprapfirmware")
        for letter, value in _WORD.findall(rest):
            if code == "M205" and letter == "J":
                yield "", "junction deviation", float(value)
            else:
                yield letter, _CODES[code], float(value) / (60.0 if minutes else 1.0)
    elif code == "M204":
        for letter, value in _WORD.findall(rest):
            yield "", {"P": "printing acceleration", "T": "travel acceleration"}.get(letter, letter), float(value)
    elif found := _TIED.search(line):
        for what, value in zip(("speed", "acceleration", "corner speed"), found.groups()[1:], strict=True):
            yield found[1], what, float(value)
    elif found := _INI.match(line):
        yield _filament(found[1]), "speed", float(found[2])
        yield _filament(found[1]), "acceleration", float(found[3])
    elif line.startswith("$"):
        for setting, value in _SETTING.findall(line):
            yield from _of_grbl(int(setting), float(value))
    else:
        for key, value in _KEY.findall(line):
            yield *_of_klipper(key), float(value)


def _of_grbl(setting: int, value: float) -> Iterator[tuple[str, str, float]]:
    group, place = divmod(setting, 10)
    if setting == 11:
        yield "", "junction deviation", value
    elif group in (11, 12) and place < len(SETTINGS_AXES):
        axis = _filament(SETTINGS_AXES[place])
        yield (axis, "speed", value / 60.0) if group == 11 else (axis, "acceleration", value)


def _of_klipper(key: str) -> tuple[str, str]:
    return {
        "max_z_velocity": ("Z", "speed"),
        "max_z_accel": ("Z", "acceleration"),
        "max_extrude_only_velocity": ("E", "speed"),
        "max_extrude_only_accel": ("E", "acceleration"),
        "instantaneous_corner_velocity": ("E", "corner speed"),
    }.get(key, ("", key))


def _filament(letter: str) -> str:
    """LinuxCNC and grblHAL feed filament with U."""
    return "E" if letter == "U" else letter
