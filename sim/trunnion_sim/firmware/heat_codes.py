"""Commands of the heaters and fans: M104 to M190, M155 (Marlin 2.1 `gcode/temp`)."""

from typing import TYPE_CHECKING

from trunnion_sim.firmware.heat import Heater
from trunnion_sim.firmware.parser import Command
from trunnion_sim.firmware.waits import Steps, Wait

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine

COOLING_TIME = 60.0
COOLING_SLOPE = 1.5
"""A wait for cooling ends when the temperature falls by less than this in COOLING_TIME."""


def set_nozzle(machine: "SoftwareMachine", command: Command) -> None:
    """M104."""
    if "S" in command.words:
        machine.set_heater(machine.heaters[0], command.value("S"))


def set_bed(machine: "SoftwareMachine", command: Command) -> None:
    """M140."""
    if "S" in command.words and len(machine.heaters) > 1:
        machine.set_heater(machine.heaters[1], command.value("S"))


def wait_nozzle(machine: "SoftwareMachine", command: Command) -> Steps:
    """M109: S waits for heating only, R for cooling too."""
    yield from _wait(machine, machine.heaters[0], command)


def wait_bed(machine: "SoftwareMachine", command: Command) -> Steps:
    """M190."""
    if len(machine.heaters) > 1:
        yield from _wait(machine, machine.heaters[1], command)


def temperature(machine: "SoftwareMachine", command: Command) -> None:
    """M105: one line that is its own ok."""
    machine.refresh_heat()
    machine.say_ok(machine.temperature_report())


def auto_report(machine: "SoftwareMachine", command: Command) -> None:
    """M155 S: temperatures every S seconds, 0 for never."""
    if "S" in command.words:
        machine.report_temperature_every = min(max(command.value("S"), 0.0), 60.0)
        machine.schedule_reports()


def fan(machine: "SoftwareMachine", command: Command) -> None:
    """M106, M107: a fan that blows without a sound."""


def _wait(machine: "SoftwareMachine", heater: Heater, command: Command) -> Steps:
    only_heating = "S" in command.words
    letter = "S" if only_heating else "R"
    if letter not in command.words:
        return
    machine.set_heater(heater, command.value(letter))
    model = heater.model
    machine.waits_for_heat = True
    resting: float | None = None
    next_line = machine.now
    first = True
    slope_at, slope_from = machine.now + COOLING_TIME, heater.reading
    while machine.waits_for_heat and heater.target and (resting is None or machine.now < resting + model.residency):
        cooling = heater.reading > heater.target
        if first and cooling and only_heating:
            break
        if machine.now >= next_line:
            next_line = machine.now + 1.0
            left = "?" if resting is None else str(int(resting + model.residency - machine.now))
            machine.say(f"{machine.temperature_report()} W:{left}\n")
        off = abs(heater.target - heater.reading)
        if resting is None:
            if off < model.window:
                resting = machine.now + (model.residency / 3.0 if first else 0.0)
        elif off > model.hysteresis:
            resting = machine.now
        if not only_heating and cooling and machine.now >= slope_at:
            if slope_from - heater.reading < COOLING_SLOPE:
                break
            slope_at, slope_from = machine.now + COOLING_TIME, heater.reading
        first = False
        yield Wait(until=machine.now + 0.1)
    machine.waits_for_heat = False


CODES = {
    "M104": set_nozzle,
    "M105": temperature,
    "M106": fan,
    "M107": fan,
    "M109": wait_nozzle,
    "M140": set_bed,
    "M155": auto_report,
    "M190": wait_bed,
}
