"""From a move command to planner blocks: straight moves, moves under tip control, arcs.

Marlin 2.1 `G0_G1.cpp` and `G2_G3.cpp`; under tip control the fork's `line_to_destination_kinematic`: a move that turns
a rotary is cut into pieces by time, and dropped with an ok where X or Y of its end is past the machine's.
"""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from trunnion_sim import tip_kernel
from trunnion_sim.firmware import replies
from trunnion_sim.firmware.motion import LONGEST_EXTRUSION
from trunnion_sim.firmware.parser import Command
from trunnion_sim.firmware.waits import Steps, Wait

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine

STILL = 1e-6
"""Degrees of a turn that is none (NEAR_ZERO)."""
TOO_COLD = 1.0
"""Degrees C below the coldest extrusion at which it is refused (TEMP_WINDOW)."""
SHORTEST_CHORD, LONGEST_CHORD = 0.1, 1.0
"""mm: MIN_ARC_SEGMENT_MM, MAX_ARC_SEGMENT_MM."""
CIRCLE_PIECES = 72
"""MIN_CIRCLE_SEGMENTS."""
ARC_ERROR = "Error:G2/G3 bad parameters\n"


def line(machine: "SoftwareMachine", command: Command) -> Steps | None:
    """G0, G1: at once where the planner has room, else as soon as it has."""
    motion = machine.motion
    goal = motion.target(command.words)
    if motion.tip_controlled:
        return _tip_line(machine, goal)
    if machine.planner.full:
        return _all(machine, iter([goal]))
    _joint_block(machine, goal)
    return None


def arc(machine: "SoftwareMachine", command: Command) -> Steps | None:
    """G2, G3 in the XY plane by I and J, or by R; P is the number of further whole circles."""
    motion = machine.motion
    begin = motion.position.copy()
    goal = motion.target(command.words)
    centre = _centre(machine, command, begin, goal)
    if centre is None:
        machine.say(ARC_ERROR)
        return None
    circles = int(command.value("P"))
    return _all(machine, _chords(machine, begin, goal, centre, command.code == "G2", circles))


def _all(machine: "SoftwareMachine", goals: Iterator[list[float]]) -> Steps:
    """Queue straight moves one after the other, each when there is room."""
    planner = machine.planner
    for goal in goals:
        if planner.full:
            yield Wait(ready=lambda: not planner.full)
        if machine.motion.tip_controlled:
            _tip_block(machine, goal, machine.motion.position)
            machine.motion.position = goal
        else:
            _joint_block(machine, goal)


def _joint_block(machine: "SoftwareMachine", goal: list[float]) -> None:
    motion = machine.motion
    motion.limit(goal)
    _block(machine, goal, goal[-1] - motion.position[-1], 0.0, None)
    motion.position = goal


def _tip_line(machine: "SoftwareMachine", goal: list[float]) -> Steps | None:
    motion = machine.motion
    tip = motion.tip
    if tip is None:
        return None
    begin = motion.position
    motion.limit(goal)
    if any(abs(goal[i] - begin[i]) >= STILL for i in tip.rotary) and motion.out_of_reach(goal):
        return None
    count, _ = tip_kernel.pieces(
        tip.geometry,
        np.array(begin[:-1]),
        np.array(goal[:-1]),
        goal[-1] - begin[-1],
        motion.feed * motion.feed_factor,
        tip.segments_per_second,
    )
    if count == 0:
        return None
    if count == 1 and not machine.planner.full:
        _tip_block(machine, goal, begin)
        motion.position = goal
        return None
    return _tip_pieces(machine, begin, goal, count)


def _tip_pieces(machine: "SoftwareMachine", begin: list[float], goal: list[float], count: int) -> Steps:
    planner = machine.planner
    last = begin
    for i in range(1, count + 1):
        here = goal if i == count else [a + (b - a) * (i / count) for a, b in zip(begin, goal, strict=True)]
        if planner.full:
            yield Wait(ready=lambda: not planner.full)
        _tip_block(machine, here, last)
        last = here
    machine.motion.position = goal


def _tip_block(machine: "SoftwareMachine", goal: list[float], begin: list[float]) -> None:
    """One block to a native place; F is read over the words."""
    tip = machine.motion.tip
    if tip is None:
        return
    native, before = np.array(goal), np.array(begin)
    joints, _ = tip.joints(native[:-1])
    way = native - before
    _, length = tip_kernel.pieces(tip.geometry, before[:-1], native[:-1], float(way[-1]), 1.0, 0.0)
    _block(machine, [*joints.tolist(), goal[-1]], float(way[-1]), length, way)


def _block(
    machine: "SoftwareMachine",
    goal: list[float],
    fed: float,
    length: float,
    way: "np.typing.NDArray[np.float64] | None",
) -> None:
    """Queue one block to joints and filament; filament that may not move only counts as moved."""
    motion, planner = machine.motion, machine.planner
    if fed and not machine.allow_cold and machine.heaters[0].reading < machine.coldest_extrusion - TOO_COLD:
        machine.say(replies.COLD_EXTRUSION)
        planner.set_filament(goal[-1])
    elif abs(fed) > LONGEST_EXTRUSION:
        machine.say(replies.LONG_EXTRUSION)
        planner.set_filament(goal[-1])
    feed = motion.feed * motion.feed_factor
    planner.add(goal, feed, motion.flow_factor, machine.line, machine.now, length, way)


def _centre(
    machine: "SoftwareMachine", command: Command, begin: list[float], goal: list[float]
) -> tuple[float, float] | None:
    """Centre of the arc in X and Y; None where the words describe none (`G2_G3.cpp`)."""
    motion = machine.motion
    columns = motion.columns
    if "X" not in columns or "Y" not in columns:
        return None
    x0, y0 = begin[columns["X"]], begin[columns["Y"]]
    x1, y1 = goal[columns["X"]], goal[columns["Y"]]
    radius = command.value("R") * motion.unit
    if radius:
        dx, dy = x1 - x0, y1 - y0
        chord2 = dx * dx + dy * dy
        if chord2 == 0:
            return None
        side = -1.0 if (command.code == "G2") != (radius < 0) else 1.0
        height = side * math.sqrt(max(radius * radius - chord2 / 4, 0.0)) / math.sqrt(chord2)
        return (x0 + x1) / 2 - dy * height, (y0 + y1) / 2 + dx * height
    i, j = command.value("I") * motion.unit, command.value("J") * motion.unit
    return (x0 + i, y0 + j) if i or j else None


def _chords(
    machine: "SoftwareMachine",
    begin: list[float],
    goal: list[float],
    centre: tuple[float, float],
    clockwise: bool,
    circles: int,
) -> Iterator[list[float]]:
    """Ends of the chords of an arc, all other axes in step with its angle (`plan_arc`)."""
    x, y = machine.motion.columns["X"], machine.motion.columns["Y"]
    rx, ry = begin[x] - centre[0], begin[y] - centre[1]
    tx, ty = goal[x] - centre[0], goal[y] - centre[1]
    travel = math.atan2(rx * ty - ry * tx, rx * tx + ry * ty)
    if begin[x] == goal[x] and begin[y] == goal[y]:
        travel = 2 * math.pi
    elif travel < 0:
        travel += 2 * math.pi
    if clockwise:
        travel -= 2 * math.pi if travel > 0 else 0.0
        if begin[x] == goal[x] and begin[y] == goal[y]:
            travel = -2 * math.pi
    travel += math.copysign(2 * math.pi * max(circles, 0), travel)
    flat = math.hypot(rx, ry) * abs(travel)
    if math.hypot(flat, sum(abs(b - a) for a, b in zip(begin, goal, strict=True))) < 0.001:
        return
    fewest = math.ceil(CIRCLE_PIECES * abs(travel) / (2 * math.pi))
    nominal = max(math.floor(flat / LONGEST_CHORD), fewest)
    chord = flat / nominal
    if chord > LONGEST_CHORD:
        count = math.ceil(flat / LONGEST_CHORD)
    elif chord < SHORTEST_CHORD:
        count = max(1, math.floor(flat / SHORTEST_CHORD))
    else:
        count = nominal
    for i in range(1, count):
        share = i / count
        cosine, sine = math.cos(travel * share), math.sin(travel * share)
        here = [a + (b - a) * share for a, b in zip(begin, goal, strict=True)]
        here[x] = centre[0] + rx * cosine - ry * sine
        here[y] = centre[1] + rx * sine + ry * cosine
        yield here
    yield goal
