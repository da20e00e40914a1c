"""From the text of a command to what it does: moves at once, everything else by its code's handler."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from trunnion_sim.firmware import heat_codes, host_codes, motion_codes, moves, tip_codes
from trunnion_sim.firmware.parser import Command, parse
from trunnion_sim.firmware.waits import Steps

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine

Handler = Callable[["SoftwareMachine", Command], Steps | None]
CODES: dict[str, Handler] = {**motion_codes.CODES, **heat_codes.CODES, **host_codes.CODES, **tip_codes.CODES}


def dispatch(machine: "SoftwareMachine", text: str) -> Steps | None:
    """Run a command; what it still waits for is returned. A known one is noted as executed."""
    command = parse(text)
    if command is None or not _known(machine, command.code):
        machine.say(f'echo:Unknown command: "{text}"\n')
        return None
    machine.executed.append(text)
    code = command.code
    if code in ("G1", "G0", "G2", "G3"):
        if machine.dropped_moves:
            machine.dropped_moves -= 1
            return None
        return moves.line(machine, command) if code in ("G1", "G0") else moves.arc(machine, command)
    return CODES.get(code, host_codes.select_tool)(machine, command)


def _known(machine: "SoftwareMachine", code: str) -> bool:
    if code in tip_codes.CODES:
        return machine.motion.tip is not None
    return code in ("G0", "G1", "G2", "G3") or code in CODES or code[0] == "T"
