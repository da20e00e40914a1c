"""Commands of tool centre point control: G43, G43.4, G49, M665 (DerAndere1/Marlin `G43_G49.cpp`, `M665.cpp`).

Only machines whose geometry the fork knows have them; on others they are unknown commands. Switching keeps the words of
the present place and renames the joints after them (`sync_plan_position`), without a motion: unless the rotaries stand
at zero, the firmware is wrong about its joints from there on. M665 renames nothing, so the next move makes up for it.
"""

from typing import TYPE_CHECKING

from trunnion_sim.firmware.parser import Command

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine


def control_tip(machine: "SoftwareMachine", command: Command) -> None:
    """G43.4: X, Y, Z are the tip over the part from here on."""
    _switch(machine, True)


def control_joints(machine: "SoftwareMachine", command: Command) -> None:
    """G49, and G43 with its plain tool length: words are joints from here on."""
    _switch(machine, False)


def _switch(machine: "SoftwareMachine", on: bool) -> None:
    machine.motion.tip_controlled = on
    machine.planner.rename(machine.motion.joints[:-1])


def geometry(machine: "SoftwareMachine", command: Command) -> None:
    """M665: what the firmware takes the machine for."""
    motion = machine.motion
    if motion.tip is None:
        return
    if not command.words:
        machine.say(f"{motion.tip.report()}\n")
        return
    motion.tip.set(command.words)


CODES = {
    "G43": control_joints,
    "G43.4": control_tip,
    "G49": control_joints,
    "M665": geometry,
}
