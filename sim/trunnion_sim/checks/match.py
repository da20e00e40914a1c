"""Program and profile belong together."""

import math
from collections.abc import Iterator
from pathlib import PurePath

from trunnion_core.findings import Finding
from trunnion_sim.context import Context
from trunnion_sim.stated import stated_limits

CODES = {
    "wrong-machine": ("error", "The program says that it was made for another machine."),
    "wrong-firmware": ("error", "The program says that it was made for another firmware."),
    "wrong-filament": ("error", "The program was made for filament of another diameter."),
    "other-limits": ("warning", "The program says that its plan relies on other limits than the profile's."),
}

SAME = 0.01
"""Relative difference of limits that is none: they are written with four decimals."""

FLAVOURS = {
    "marlin": "marlin",
    "marlin2": "marlin",
    "reprap": "marlin",
    "reprapfirmware": "reprapfirmware",
    "klipper": "klipper",
    "linuxcnc": "linuxcnc",
}
"""Firmware by the name that headers give it: our own, and `gcode_flavor` of PrusaSlicer and OrcaSlicer."""


def check(context: Context) -> Iterator[Finding]:
    """Compare the header's claims, where it makes any, with the profile."""
    header, profile = context.notes.header, context.profile
    machine = header.get("machine")
    here = PurePath(profile.file).stem
    if machine is not None and machine not in (here, profile.name):
        yield Finding("wrong-machine", "error", f"the program was made for '{machine}', not for '{here}'")
    firmware = FLAVOURS.get(header.get("firmware", header.get("gcode_flavor", "")).lower())
    if firmware is not None and firmware != profile.firmware:
        yield Finding(
            "wrong-firmware", "error", f"the program was made for {firmware}, the machine runs {profile.firmware}"
        )
    for stated in stated_limits(context.notes.relies, profile):
        if not math.isclose(stated.value, stated.profile, rel_tol=SAME):
            whose = f"{stated.what} of {stated.axis}" if stated.axis else stated.what
            yield Finding(
                "other-limits",
                "warning",
                f"the plan relies on {whose} {stated.value:g}, the profile has "
                + (f"{stated.profile:g}" if math.isfinite(stated.profile) else "none"),
                axis=stated.axis or None,
                value=stated.value,
                limit=stated.profile if math.isfinite(stated.profile) else None,
            )
    try:
        diameter = float(header.get("filament_diameter", "").split(",")[0])
    except ValueError:
        return
    if abs(diameter - profile.filament_diameter) > 0.01:
        yield Finding(
            "wrong-filament",
            "error",
            f"the program was made for {diameter:g} mm filament, the machine takes {profile.filament_diameter:g} mm",
            value=diameter,
            limit=profile.filament_diameter,
        )
