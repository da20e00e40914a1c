"""Commands by which host and firmware talk about the wire, the state and the person: M0, M110 to M118, M876."""

import re
from typing import TYPE_CHECKING

from trunnion_sim.firmware import replies
from trunnion_sim.firmware.motion_codes import nothing, synchronize
from trunnion_sim.firmware.parser import Command
from trunnion_sim.firmware.waits import Steps, Wait

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine


TIMES = re.compile(r"^(?:[PS] *[\d.]+ *)+")
"""The numbers of M0, before its text."""


def pause(machine: "SoftwareMachine", command: Command) -> Steps:
    """M0, M1: wait for a person, or P milliseconds, or S seconds."""
    seconds = command.value("S") if "S" in command.words else command.value("P") / 1000.0
    yield from synchronize(machine)
    text = TIMES.sub("", command.rest)
    if text:
        machine.say(f"echo:{text}\n")
    machine.say(replies.prompt(f"{command.code} Stop", "Continue"))
    machine.waits_for_user = True
    machine.prompt_open = True
    until = machine.now + seconds if seconds > 0 else float("inf")
    yield Wait(
        until=until,
        ready=lambda: not machine.waits_for_user,
        busy="paused for user",
        user=seconds <= 0,
    )
    machine.waits_for_user = False


def line_number(machine: "SoftwareMachine", command: Command) -> None:
    """M110: sets the number of the last line, or says it."""
    number = command.number("N")
    if number is not None:
        machine.reader.last = int(number)
    else:
        machine.say(f"Line: {machine.reader.last}\n")


def busy_interval(machine: "SoftwareMachine", command: Command) -> None:
    """M113."""
    if "S" in command.words:
        machine.busy_every = min(max(command.value("S"), 0.0), 60.0)
    else:
        machine.say(f"echo:M113 S{machine.busy_every:.0f}\n")


def position(machine: "SoftwareMachine", command: Command) -> None:
    """M114."""
    machine.say(machine.position_report())


def information(machine: "SoftwareMachine", command: Command) -> None:
    """M115."""
    machine.say(replies.firmware_info(machine.profile.name, len(machine.motion.letters)))


def status(machine: "SoftwareMachine", command: Command) -> None:
    """M117: shown to the host as a notification."""
    machine.say(f"//action:notification {command.rest}\n")


def echo(machine: "SoftwareMachine", command: Command) -> None:
    """M118: E1 puts `echo:` before the text, A1 `//`."""
    text = command.rest
    prefix = ""
    while len(text) >= 2 and text[0] in "AEP" and text[1] in "0123456789":
        if text[1] == "1":
            prefix = {"E": "echo:", "A": "//"}.get(text[0], prefix)
        text = text[2:].lstrip(" ")
    machine.say(f"{prefix}{text}\n")


def auto_position(machine: "SoftwareMachine", command: Command) -> None:
    """M154 S: the position every S seconds, 0 for never; once at once."""
    if "S" in command.words:
        machine.report_position_every = min(max(command.value("S"), 0.0), 60.0)
        machine.schedule_reports()
        machine.say(machine.position_report())


def settings(machine: "SoftwareMachine", command: Command) -> None:
    """M503; S0 leaves the headings out."""
    bare = "S" in command.words and command.value("S") == 0
    machine.say(replies.settings(machine.motion, machine.planner, bare=bare))


def kill(machine: "SoftwareMachine", command: Command) -> None:
    """M112 that went past the emergency parser."""
    machine.kill("M112 Shutdown")


def select_tool(machine: "SoftwareMachine", command: Command) -> None:
    """T0 is the only one."""
    if command.code != "T0":
        machine.say(f"echo:{command.code} Invalid extruder\n")


CODES = {
    "M0": pause,
    "M1": pause,
    "M73": nothing,
    "M75": nothing,
    "M76": nothing,
    "M77": nothing,
    "M108": nothing,
    "M110": line_number,
    "M112": kill,
    "M113": busy_interval,
    "M114": position,
    "M115": information,
    "M117": status,
    "M118": echo,
    "M154": auto_position,
    "M503": settings,
    "M876": nothing,
}
