"""Commands of tool centre point control: G43, G43.4, G49, M665 (DerAndere1/Marlin `G43_G49.cpp`, `M665.cpp`).

Only machines whose geometry the fork knows have them; on others they are unknown commands.
"""

from typing import TYPE_CHECKING

from trunnion_sim.firmware.parser import Command

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine


def control_tip(machine: "SoftwareMachine", command: Command) -> None:
    """G43.4: X, Y, Z are the tip over the part from here on."""
    machine.motion.control_tip(True)


def control_joints(machine: "SoftwareMachine", command: Command) -> None:
    """G49, and G43 with its plain tool length: words are joints from here on."""
    machine.motion.control_tip(False)


def geometry(machine: "SoftwareMachine", command: Command) -> None:
    """M665: what the firmware takes the machine for; the joints do not move."""
    motion = machine.motion
    if motion.tip is None:
        return
    if not command.words:
        machine.say(f"echo:{motion.tip.report()}\n")
        return
    joints = motion.joints
    motion.tip.set(command.words)
    motion.stand_at(joints)


CODES = {
    "G43": control_joints,
    "G43.4": control_tip,
    "G49": control_joints,
    "M665": geometry,
}
