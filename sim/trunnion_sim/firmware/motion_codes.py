"""Commands that move, or change how moves are read: G0 to G92, M17 to M410 (Marlin 2.1 `gcode/`)."""

from typing import TYPE_CHECKING

from trunnion_sim import homing
from trunnion_sim.firmware import planner_kernel as kernel
from trunnion_sim.firmware import replies
from trunnion_sim.firmware.parser import Command
from trunnion_sim.firmware.planner import FIRST_MOVE_DELAY
from trunnion_sim.firmware.waits import Steps, Wait

if TYPE_CHECKING:
    from collections.abc import Callable

    from trunnion_sim.firmware.machine import SoftwareMachine
    from trunnion_sim.firmware.motion import Motion
    from trunnion_sim.firmware.planner import Planner

LONGEST_DWELL = 4294967.295
"""s: what 32 bits of milliseconds hold."""
ENDSTOP_POLL = 0.001
"""s between two looks at the endstops."""


def dwell(machine: "SoftwareMachine", command: Command) -> Steps:
    """G4: wait P milliseconds or S seconds once all motion has ended."""
    seconds = command.value("P") / 1000.0 if "P" in command.words else 0.0
    if "S" in command.words:
        seconds = command.value("S")
    yield from synchronize(machine)
    machine.say("//action:notification Sleep...\n")
    yield Wait(until=machine.now + min(max(seconds, 0.0), LONGEST_DWELL))


def home(machine: "SoftwareMachine", command: Command) -> Steps:
    """G28: drive the named joints, or all, to their endstops one after the other (`G28.cpp`, `homeaxis`)."""
    yield from synchronize(machine)
    motion, planner = machine.motion, machine.planner
    for column in homing.homing_order(machine.profile, set(command.words)):
        joint = machine.profile.joints[column]
        end = motion.home[column]
        here = motion.joints[column]
        way = 1.0 if end > here or (end == here and end >= motion.high[column]) else -1.0
        fast = homing.speed_of(joint, float(planner.limits[kernel.MAX_SPEED, column]))
        yield from _to_endstop(machine, column, way, fast)
        back = motion.joints
        back[column] = end - way * homing.BACK.get(joint.letter, homing.BACK_OF_OTHERS)
        planner.add(back, fast, 1.0, machine.line, machine.now)
        yield from synchronize(machine)
        motion.stand_at(back)
        yield from _to_endstop(machine, column, way, fast / homing.SLOWER.get(joint.letter, homing.SLOWER_OF_OTHERS))
        motion.shift[column] = 0.0
        motion.homed[column] = True
    machine.say(machine.position_report())


def _to_endstop(machine: "SoftwareMachine", column: int, way: float, speed: float) -> Steps:
    """Drive a joint on until its endstop is hit, where it stops at once."""
    motion, planner = machine.motion, machine.planner
    end = motion.home[column]
    at, beyond = motion.joints, motion.joints
    beyond[column] = end + way * (speed * speed / float(planner.limits[kernel.MAX_ACCELERATION, column]) + 1.0)
    planner.add(beyond, speed, 1.0, machine.line, machine.now)
    yield Wait(until=machine.now + FIRST_MOVE_DELAY)
    per_unit = float(planner.limits[kernel.STEPS_PER_UNIT, column])
    while planner.moves and (left := way * (end - planner.steps_now(machine.now)[column] / per_unit)) > 0:
        yield Wait(until=machine.now + max(left / speed, ENDSTOP_POLL))
    planner.stop(machine.now, machine.line)
    at[column] = end
    motion.stand_at(at)
    planner.set_joints(at[:-1])


def synchronize(machine: "SoftwareMachine", command: Command | None = None) -> Steps:
    """M400: until every move has ended."""
    planner = machine.planner
    if planner.moves:
        yield Wait(ready=lambda: planner.moves == 0)


def absolute(machine: "SoftwareMachine", command: Command) -> None:
    """G90, which also makes the filament absolute."""
    machine.motion.relative = [False] * len(machine.motion.relative)


def relative(machine: "SoftwareMachine", command: Command) -> None:
    """G91, which also makes the filament relative."""
    machine.motion.relative = [True] * len(machine.motion.relative)


def filament_absolute(machine: "SoftwareMachine", command: Command) -> None:
    """M82."""
    machine.motion.relative[-1] = False


def filament_relative(machine: "SoftwareMachine", command: Command) -> None:
    """M83."""
    machine.motion.relative[-1] = True


def inches(machine: "SoftwareMachine", command: Command) -> None:
    """G20."""
    machine.motion.unit = 25.4


def millimetres(machine: "SoftwareMachine", command: Command) -> None:
    """G21."""
    machine.motion.unit = 1.0


def name_here(machine: "SoftwareMachine", command: Command) -> None:
    """G92: reports the position before its ok."""
    if machine.motion.name_here(command.words):
        machine.planner.set_filament(machine.motion.position[-1])
    machine.say(machine.position_report())


def release(machine: "SoftwareMachine", command: Command) -> Steps:
    """M18, M84: motors off after the last move, or after S seconds of rest; positions are no longer known."""
    if "S" in command.words:
        return
    yield from synchronize(machine)
    named = [letter for letter in machine.motion.letters if letter in command.words]
    for letter in named or machine.motion.letters:
        machine.motion.homed[machine.motion.columns[letter]] = False


def stop(machine: "SoftwareMachine", command: Command) -> None:
    """M410 without the emergency parser; with it the stop has happened already."""


def feed_factor(machine: "SoftwareMachine", command: Command) -> None:
    """M220: whole percentage on every F; B keeps the present one, R brings back what was kept (`M220.cpp`)."""
    motion = machine.motion
    if not command.words:
        machine.say(f"FR:{round(motion.feed_factor * 100)}%\n")
        return
    now = motion.feed_factor
    if "R" in command.words:
        motion.feed_factor = motion.kept_feed_factor
    if "B" in command.words:
        motion.kept_feed_factor = now
    if command.number("S") is not None:
        motion.feed_factor = max(int(command.value("S")), 1) / 100.0


def flow_factor(machine: "SoftwareMachine", command: Command) -> None:
    """M221: whole percentage on filament."""
    if command.number("S") is not None:
        machine.motion.flow_factor = max(int(command.value("S")), 0) / 100.0
    else:
        machine.say(f"echo:E0 Flow: {round(machine.motion.flow_factor * 100)}%\n")


def soft_limits(machine: "SoftwareMachine", command: Command) -> None:
    """M211: soft endstops on and off."""
    motion = machine.motion
    if "S" in command.words:
        motion.soft_limits = command.value("S") != 0
        return
    machine.say(f"{replies.soft_limits(motion)}\n")


def steps_per_unit(machine: "SoftwareMachine", command: Command) -> None:
    """M92."""
    _set_limits(machine, command, kernel.STEPS_PER_UNIT, replies.steps)


def max_acceleration(machine: "SoftwareMachine", command: Command) -> None:
    """M201."""
    _set_limits(machine, command, kernel.MAX_ACCELERATION, replies.accelerations)


def max_speed(machine: "SoftwareMachine", command: Command) -> None:
    """M203."""
    _set_limits(machine, command, kernel.MAX_SPEED, replies.speeds)


def path_acceleration(machine: "SoftwareMachine", command: Command) -> None:
    """M204: P printing, R filament alone, T travel, S printing and travel."""
    state = machine.planner.state
    places = {"S": (kernel.PRINT_ACCELERATION, kernel.TRAVEL_ACCELERATION), "P": (kernel.PRINT_ACCELERATION,)}
    places |= {"R": (kernel.RETRACT_ACCELERATION,), "T": (kernel.TRAVEL_ACCELERATION,)}
    for letter, where in places.items():
        if command.value(letter) > 0:
            for place in where:
                state[place] = command.value(letter)
    if not command.words:
        machine.say(f"{replies.path_accelerations(machine.planner)}\n")


def corners(machine: "SoftwareMachine", command: Command) -> None:
    """M205: what may jump per axis, J junction deviation, B shortest segment in microseconds."""
    state, limits, motion = machine.planner.state, machine.planner.limits, machine.motion
    uses_deviation = state[kernel.JUNCTION_DEVIATION] > 0
    if not command.words:
        machine.say(f"{replies.corners(motion, machine.planner)}\n")
    for letter, number in command.words.items():
        if number is None or number < 0:
            continue
        if letter == "J" and uses_deviation:
            if not 0.01 <= number <= 0.3:
                machine.say("Error:?J out of range (0.01 to 0.3)\n")
            else:
                state[kernel.JUNCTION_DEVIATION] = number
        elif letter in motion.columns and not uses_deviation:
            limits[kernel.JERK, motion.columns[letter]] = number
        elif letter == "B" and "B" not in motion.columns:
            state[kernel.MIN_SEGMENT_TIME] = number / 1e6


def cold_extrusion(machine: "SoftwareMachine", command: Command) -> None:
    """M302: P1 allows cold extrusion, S sets the coldest."""
    if "S" in command.words:
        machine.coldest_extrusion = command.value("S")
        machine.allow_cold = machine.coldest_extrusion == 0
    if "P" in command.words:
        machine.allow_cold = command.value("P") != 0
    elif "S" not in command.words:
        state = "en" if machine.allow_cold else "dis"
        machine.say(f"echo:Cold extrudes are {state}abled (min temp {machine.coldest_extrusion:.0f}C)\n")


def nothing(machine: "SoftwareMachine", command: Command) -> None:
    """Accepted without a visible effect."""


def _set_limits(
    machine: "SoftwareMachine", command: Command, row: int, report: "Callable[[Motion, Planner], str]"
) -> None:
    """Set what letters name; without words, say what holds, with no echo before it (`M92_report` with forReplay)."""
    limits, motion = machine.planner.limits, machine.motion
    given = False
    for letter, number in command.words.items():
        if letter in motion.columns and number is not None and number > 0:
            limits[row, motion.columns[letter]] = number
            given = True
    if row == kernel.STEPS_PER_UNIT and given:
        machine.planner.refresh(motion.joints)
    if not command.words:
        machine.say(f"{report(motion, machine.planner)}\n")


CODES = {
    "G4": dwell,
    "G20": inches,
    "G21": millimetres,
    "G28": home,
    "G90": absolute,
    "G91": relative,
    "G92": name_here,
    "M17": nothing,
    "M18": release,
    "M82": filament_absolute,
    "M83": filament_relative,
    "M84": release,
    "M92": steps_per_unit,
    "M201": max_acceleration,
    "M203": max_speed,
    "M204": path_acceleration,
    "M205": corners,
    "M211": soft_limits,
    "M220": feed_factor,
    "M221": flow_factor,
    "M302": cold_extrusion,
    "M400": synchronize,
    "M410": stop,
}
