"""From the text of a command to what it does: moves at once, everything else by its code's handler."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from trunnion_sim.firmware import heat_codes, host_codes, motion_codes, replies
from trunnion_sim.firmware.motion import LONGEST_EXTRUSION
from trunnion_sim.firmware.parser import Command, parse
from trunnion_sim.firmware.waits import Steps, Wait

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine

Handler = Callable[["SoftwareMachine", Command], Steps | None]
CODES: dict[str, Handler] = {**motion_codes.CODES, **heat_codes.CODES, **host_codes.CODES}
TOO_COLD = 1.0
"""Degrees C below the coldest extrusion at which it is refused (TEMP_WINDOW)."""


def dispatch(machine: "SoftwareMachine", text: str) -> Steps | None:
    """Run a command; what it still waits for is returned. A known one is noted as executed."""
    command = parse(text)
    known = command is not None and (command.code in ("G0", "G1") or command.code in CODES or command.code[0] == "T")
    if command is None or not known:
        machine.say(f'echo:Unknown command: "{text}"\n')
        return None
    machine.executed.append(text)
    code = command.code
    if code in ("G1", "G0"):
        if machine.dropped_moves:
            machine.dropped_moves -= 1
            return None
        goal = machine.motion.target(command.words)
        if machine.planner.full:
            return _move_when_free(machine, goal)
        _move(machine, goal)
        return None
    return CODES.get(code, host_codes.select_tool)(machine, command)


def _move_when_free(machine: "SoftwareMachine", goal: list[float]) -> Steps:
    planner = machine.planner
    yield Wait(ready=lambda: not planner.full)
    _move(machine, goal)


def _move(machine: "SoftwareMachine", goal: list[float]) -> None:
    motion, planner = machine.motion, machine.planner
    motion.limit(goal)
    fed = goal[-1] - motion.position[-1]
    if fed and not machine.allow_cold and machine.heaters[0].reading < machine.coldest_extrusion - TOO_COLD:
        machine.say(replies.COLD_EXTRUSION)
        planner.set_filament(goal[-1])
    elif abs(fed) > LONGEST_EXTRUSION:
        machine.say(replies.LONG_EXTRUSION)
        planner.set_filament(goal[-1])
    planner.add(goal, motion.feed * motion.feed_factor, motion.flow_factor, machine.line, machine.now)
    motion.position = goal
