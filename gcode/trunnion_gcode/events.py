"""Heat, fan and pause: the program's events, and what the settings ask for where the program has none, as commands."""

from collections.abc import Iterable

import numpy as np

from trunnion_core.errors import GcodeError
from trunnion_core.program import Event, EventKind, MachineProgram
from trunnion_core.settings import PrintSettings
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.words import number

NOZZLE: tuple[EventKind, ...] = ("nozzle_temperature", "wait_nozzle")
BED: tuple[EventKind, ...] = ("bed_temperature", "wait_bed")
TEMPERATURE = {"wait_nozzle": "nozzle_temperature", "wait_bed": "bed_temperature"}
"""What a wait sets besides waiting."""


def commands_by_row(program: MachineProgram, settings: PrintSettings, dialect: Dialect) -> dict[int, list[str]]:
    """Lines that go before a row of the program. What is already so is not said again.

    The settings' first-layer temperatures hold at the start (`heating`); later changes and the fan are taken from the
    settings only where the program has no events about them.
    """
    said: dict[str, float] = {}
    for event in heating(settings):
        _changes(event, said)
    lines: dict[int, list[str]] = {}
    for event in sorted((*program.events, *_from_settings(program, settings)), key=lambda event: event.row):
        if event.kind == "layer" or not _changes(event, said):
            continue
        lines.setdefault(event.row, []).append(command(event, dialect))
    return lines


def heating(settings: PrintSettings) -> tuple[Event, ...]:
    """Temperatures of the first layer: first set both, then wait for both, so that they warm up together."""
    first = settings.temperature if settings.first_layer_temperature is None else settings.first_layer_temperature
    bed = (
        settings.bed_temperature
        if settings.first_layer_bed_temperature is None
        else settings.first_layer_bed_temperature
    )
    wanted: list[tuple[EventKind, EventKind, float]] = [
        ("bed_temperature", "wait_bed", bed),
        ("nozzle_temperature", "wait_nozzle", first),
    ]
    wanted = [entry for entry in wanted if entry[2] > 0]
    return (
        *(Event(0, kind, value) for kind, _, value in wanted),
        *(Event(0, wait, value) for _, wait, value in wanted),
    )


def command(event: Event, dialect: Dialect) -> str:
    """One event as a line. GcodeError where the dialect has no such command."""
    if event.kind == "fan":
        duty = min(max(event.value, 0.0), 1.0)
        if duty == 0.0 and dialect.fan_off is not None:
            return dialect.fan_off
        return _with_number(dialect.fan, event, round(duty * dialect.fan_full), dialect)
    if event.kind == "pause":
        return dialect.pause
    return _with_number(getattr(dialect, event.kind), event, event.value, dialect)


def _with_number(template: str | None, event: Event, value: float, dialect: Dialect) -> str:
    if template is None:
        raise GcodeError(
            f"row {event.row}: {dialect.name} has no command for {event.kind.replace('_', ' ')}; set that temperature "
            "or fan to 0 and say it in the profile's start code"
        )
    return template % number(event.kind, value, 1)


def _changes(event: Event, said: dict[str, float]) -> bool:
    """Whether the event says anything new; remembers what it says."""
    if event.kind in ("pause", "layer"):
        return True
    known = said.get(event.kind) == event.value
    said[event.kind] = event.value
    if event.kind in TEMPERATURE:
        said[TEMPERATURE[event.kind]] = event.value
    elif not known:
        said.pop({"nozzle_temperature": "wait_nozzle", "bed_temperature": "wait_bed"}.get(event.kind, ""), None)
    return not known


def _from_settings(program: MachineProgram, settings: PrintSettings) -> Iterable[Event]:
    """What the settings ask for after the first layer and of the fan, for programs without such events."""
    if not len(program):
        return
    kinds = {event.kind for event in program.events}
    second = _first_row_of_layer(program, 1)
    if not kinds.intersection(NOZZLE) and second is not None and settings.temperature > 0:
        yield Event(second, "nozzle_temperature", settings.temperature)
    if not kinds.intersection(BED) and second is not None and settings.bed_temperature > 0:
        yield Event(second, "bed_temperature", settings.bed_temperature)
    if "fan" not in kinds and settings.fan_speed > 0:
        cooled = _first_row_of_layer(program, settings.disable_fan_first_layers)
        if cooled is not None:
            yield Event(cooled, "fan", settings.fan_speed / 100.0)


def _first_row_of_layer(program: MachineProgram, layer: int) -> int | None:
    rows = np.flatnonzero(program.layer >= layer)
    return int(rows[0]) if rows.size else None
