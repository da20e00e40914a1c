"""Plastic is hot when it is pushed, never too hot, and heaters are off at the end."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.context import Context
from trunnion_sim.motion import Command

CODES = {
    "cold-extrusion": ("error", "Plastic is extruded before the nozzle was waited for, or after it was turned off."),
    "too-hot": ("error", "A heater is set above its limit."),
    "heater-left-on": ("warning", "The nozzle's heater is still on at the end of the program."),
}

NOZZLE_WAITS = {"M109"}
NOZZLE_SETS = {"M104"}
NOZZLE_SETS_REPRAP = {"M568", "G10"}
"""Only in RepRapFirmware: elsewhere G10 retracts."""
BED = {"M140", "M190"}


def check(context: Context) -> Iterator[Finding]:
    """Follow the heater commands; the nozzle counts as hot from a wait until it is set colder than allowed."""
    profile = context.profile
    least = profile.extruder.min_temperature
    hot = np.zeros(len(context.motion), dtype=bool)
    target = 0.0
    state = allowed = False
    sets = NOZZLE_WAITS | NOZZLE_SETS | (NOZZLE_SETS_REPRAP if context.rules.name == "reprapfirmware" else set())
    for command in context.motion.commands:
        name = command.name
        value = _temperature(command)
        if name in sets and value is not None:
            target = value
            if target < least:
                state = False
            elif name in NOZZLE_WAITS:
                state = True
            yield from _limit("nozzle", value, profile.heaters.nozzle.max_temperature, command)
        elif name == "M116":
            state = target >= least
        elif name in BED and value is not None:
            limit = profile.heaters.bed.max_temperature if profile.heaters.bed else 0.0
            yield from _limit("bed", value, limit, command)
        elif name == "M302":
            allowed = command.get("P") == 1 or command.get("S") == 0
        else:
            continue
        hot[command.row :] = state or allowed
    pushed = (context.motion.filament > 0) & ~hot
    yield from context.find(
        "cold-extrusion",
        "error",
        pushed,
        lambda row: f"filament is pushed while the nozzle is not known to be at least {least:g} °C",
        limit=least,
    )
    if target > 0 and len(context.motion) and context.motion.filament.any():
        yield Finding(
            "heater-left-on",
            "warning",
            f"the nozzle is still set to {target:g} °C when the program ends",
            line=context.end.lines,
            value=target,
            limit=0.0,
        )


def _temperature(command: Command) -> float | None:
    for letter in "SRP":
        value = command.get(letter)
        if value is not None:
            return value
    return None


def _limit(heater: str, value: float, limit: float, command: Command) -> Iterator[Finding]:
    if value > limit:
        text = f"the {heater} is set to {value:g} °C, its limit is {limit:g}"
        yield Finding("too-hot", "error", text, line=command.line, value=value, limit=limit)
