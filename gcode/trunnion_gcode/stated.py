"""The settings of a firmware that the plan relies on, as words that its user can hold against the machine's own.

They are comments, not commands: a program that raised a limit would be a danger to a machine whose profile is wrong,
and one that lowered it would spoil the next program.
"""

import math
from dataclasses import dataclass

from trunnion_core.profile import MachineProfile
from trunnion_gcode.words import number

RELIES = "; the plan relies on"
MINUTE = 60.0


@dataclass(frozen=True)
class Toolhead:
    """What Klipper's [printer] section is taken to say about a machine of this profile."""

    speed: float
    """max_velocity: the fastest of the linear joints, mm/s."""
    acceleration: float
    """max_accel: that of the profile's planner, else of the weakest linear joint but Z, mm/s²."""
    corner_speed: float
    """square_corner_velocity: the smallest corner speed of the linear joints but Z, mm/s."""

    @property
    def deviation(self) -> float:
        """mm that Klipper makes of it (`toolhead.py`, _calc_junction_deviation)."""
        return self.corner_speed**2 * (math.sqrt(2.0) - 1.0) / self.acceleration


def toolhead(profile: MachineProfile) -> Toolhead:
    """Klipper knows one speed and acceleration for X and Y together, so the weaker joint speaks for both."""
    straight = [joint for joint in profile.joints if not joint.rotary]
    plane = [joint for joint in straight if joint.letter != "Z"]
    given = profile.planner.acceleration
    return Toolhead(
        speed=max(joint.speed for joint in straight),
        acceleration=min(joint.acceleration for joint in plane) if given is None else given,
        corner_speed=min(joint.corner_speed for joint in plane),
    )


def axis_words(profile: MachineProfile, field: str, scale: float = 1.0) -> str:
    """`speed`, `acceleration` or `corner_speed` of every joint and the filament: `X200 Y200 Z12 A90 E50`."""
    extruder = {"speed": profile.extruder.speed, "acceleration": profile.extruder.acceleration}
    shown = [joint.letter + said(joint.shown(getattr(joint, field)) * scale) for joint in profile.joints]
    return " ".join([*shown, "E" + said(extruder.get(field, profile.extruder.corner_speed) * scale)])


def path_words(profile: MachineProfile) -> tuple[str, ...]:
    """M204 where the profile limits the acceleration along the path."""
    printing = profile.planner.acceleration
    if printing is None:
        return ()
    travel = profile.planner.travel_acceleration
    return (f"{RELIES} M204 P{said(printing)} T{said(printing if travel is None else travel)}",)


def said(value: float) -> str:
    """A setting as people write it."""
    return number("setting", value, 4)
