"""Klipper does not stop the print over a bead that it takes for a mistake.

`klippy/kinematics/extruder.py` (check_move) raises an error, which ends the print, where a move of X or Y feeds more
filament to a millimetre of X, Y and Z than `max_extrude_cross_section` allows, unless it feeds very little. That is by
default the section of four squares of the bore. Where the part turns under the nozzle, good beads exceed it.
"""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.context import Context

CODES = {
    "extrusion-refused": (
        "error",
        "Klipper would end the print: more filament to a mm of X, Y and Z than max_extrude_cross_section.",
    ),
}

SETTING = "max_extrude_cross_section"
SQUARES = 4.0
"""Of the bore: Klipper's default for the setting."""


def check(context: Context) -> Iterator[Finding]:
    """Compare the filament of each move with the setting that the head of the program asks for, or the default."""
    if context.rules.corners != "klipper":
        return
    profile, motion = context.profile, context.motion
    most = _asked(context.notes.header) or SQUARES * profile.nozzle_diameter**2
    across = np.zeros(len(motion), np.bool_)
    for column, joint in enumerate(profile.joints):
        if joint.letter in "XY":
            across |= np.diff(motion.path[:, column]) != 0
    way = np.where(across, context.linear_way, 1.0)
    section = motion.filament * profile.filament_area / np.where(way > 0, way, 1.0)
    fed = motion.filament > profile.nozzle_diameter * most / profile.filament_area
    refused = across & (section > most) & fed & ~context.homing
    yield from context.find(
        "extrusion-refused",
        "error",
        refused,
        lambda row: f"{section[row]:.3g} mm² of plastic over X, Y and Z, {SETTING} is {most:.3g}",
        value=section,
        limit=most,
    )


def _asked(header: dict[str, str]) -> float:
    """mm² that the program says the setting has to be; 0 where it does not say."""
    for key, value in header.items():
        words = value.split()
        if key.endswith(SETTING) and words:
            try:
                asked = float(words[0])
            except ValueError:
                continue
            if 0 < asked < np.inf:
                return asked
    return 0.0
