"""The 16-block planner: targets in, joint positions over time out."""

from typing import TYPE_CHECKING

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_sim.firmware import planner_kernel as kernel
from trunnion_sim.firmware import stepper_kernel

if TYPE_CHECKING:
    from collections.abc import Sequence

FIRST_MOVE_DELAY = 0.1
"""s that the first move after a standstill waits for company (BLOCK_DELAY_FOR_1ST_MOVE)."""
FEW_MOVES = 3
"""With this many moves planned nothing is waited for."""
MIN_SEGMENT_TIME = 0.02
"""s: DEFAULT_MINSEGMENTTIME, below which a draining queue is slowed down."""
UNLIMITED_ACCELERATION = 1e6
"""mm/s² along the path where the profile leaves the limit to the joints."""


class Planner:
    """Queue of motion blocks in mm, degrees and mm of filament; the filament is the last axis."""

    def __init__(self, profile: MachineProfile) -> None:
        joints = profile.joints
        n = len(joints) + 1
        self.n = n
        self.limits: FloatArray = np.zeros((5, n))
        for i, joint in enumerate(joints):
            self.limits[kernel.STEPS_PER_UNIT, i] = joint.steps_per_unit / joint.shown(1.0)
            self.limits[kernel.MAX_SPEED, i] = joint.shown(joint.speed)
            self.limits[kernel.MAX_ACCELERATION, i] = joint.shown(joint.acceleration)
            self.limits[kernel.JERK, i] = joint.shown(joint.corner_speed)
            self.limits[kernel.ROTARY, i] = joint.rotary
        extruder = profile.extruder
        self.limits[:4, -1] = extruder.steps_per_mm, extruder.speed, extruder.acceleration, extruder.corner_speed
        self.size = profile.planner.blocks
        self.blocks: FloatArray = np.zeros((self.size, kernel.STEPS + n))
        self.state: FloatArray = np.zeros(kernel.VECTORS + 3 * n)
        self.state[kernel.JUNCTION_DEVIATION] = profile.planner.junction_deviation or 0.0
        self.state[kernel.PRINT_ACCELERATION] = profile.planner.acceleration or UNLIMITED_ACCELERATION
        self.state[kernel.TRAVEL_ACCELERATION] = (
            profile.planner.travel_acceleration or profile.planner.acceleration or UNLIMITED_ACCELERATION
        )
        self.state[kernel.RETRACT_ACCELERATION] = extruder.acceleration
        self.state[kernel.MIN_SEGMENT_TIME] = MIN_SEGMENT_TIME
        self.state[kernel.JERK_TOO] = profile.firmware == "marlin_tcp"
        self._position = self.state[kernel.VECTORS + 2 * n :]
        self._trapezoid: FloatArray = np.zeros(stepper_kernel.PLACES)
        self._motors: FloatArray = np.zeros((3, n))
        self._motors[2] = self.limits[kernel.STEPS_PER_UNIT]
        self._records: FloatArray = np.zeros((1024, n + 2))
        self._count = 0
        self.moves = 0
        """Blocks planned, the running one included."""
        self.next_event = np.inf
        """Machine time at which a block begins or ends."""
        self._running = False
        self._began = 0.0
        self._target: FloatArray = np.zeros(n)
        self._way: FloatArray = np.zeros(n)
        self._compile()

    def _compile(self) -> None:
        """Run the kernels once on a copy, so that the first move does not wait for the compiler."""
        blocks, state, motors = self.blocks.copy(), self.state.copy(), self._motors.copy()
        kernel.add_block(blocks, self.limits, state, np.ones(self.n), 1.0, 1.0, 0.0, 0.0, self._way)
        kernel.begin_block(blocks, state, self._trapezoid)
        kernel.end_block(blocks, state, motors, self._records[0], 1.0, 0.0)

    @property
    def full(self) -> bool:
        """Whether a further move must wait."""
        return self.moves >= self.size - 1

    @property
    def free(self) -> int:
        """Blocks that can still be planned."""
        return self.size - 1 - self.moves

    def add(
        self,
        target: "Sequence[float]",
        feed: float,
        flow: float,
        line: int,
        now: float,
        length: float = 0.0,
        way: FloatArray | None = None,
    ) -> None:
        """Plan a motion; the queue must not be full. `length` and `way` as in `planner_kernel.add_block`."""
        goal = self._target
        for i, value in enumerate(target):
            goal[i] = value
        if not kernel.add_block(
            self.blocks, self.limits, self.state, goal, flow, feed, line, length, self._way if way is None else way
        ):
            return
        self.moves += 1
        if self._running:
            return
        if self.moves >= FEW_MOVES:
            self.next_event = now
        elif self.moves == 1:
            self.next_event = now + FIRST_MOVE_DELAY

    def fire(self) -> None:
        """What happens at `next_event`: the running block ends, the next begins."""
        now = self.next_event
        if self._running:
            self._end(1.0, now)
            self.moves -= 1
        if self.moves:
            self._began = now
            self.next_event = now + float(kernel.begin_block(self.blocks, self.state, self._trapezoid))
            self._running = True
        else:
            self.next_event = np.inf

    def steps_now(self, now: float) -> FloatArray:
        """(n,) steps that the motors stand at in this moment."""
        if not self._running:
            return np.array(self._motors[0])
        row = self.blocks[int(self.state[kernel.TAIL]), kernel.STEPS :]
        return np.asarray(self._motors[0] + np.trunc(row * self._share(now)))

    def set_joints(self, values: "Sequence[float]") -> None:
        """The joints are at these mm and degrees, an endstop says so. The queue must be empty."""
        steps = np.floor(np.asarray(values) * self.limits[kernel.STEPS_PER_UNIT, :-1] + 0.5)
        self._position[:-1] = steps
        self._motors[0, :-1] = steps
        self._motors[1, :-1] = values
        self.state[kernel.PREVIOUS_NOMINAL] = 0.0

    def rename(self, values: "Sequence[float]") -> None:
        """Call the end of the queue these mm and degrees; nothing moves, what is queued runs as it was planned."""
        steps = np.floor(np.asarray(values) * self.limits[kernel.STEPS_PER_UNIT, :-1] + 0.5)
        shift = steps - self._position[:-1]
        self._position[:-1] += shift
        self._motors[0, :-1] += shift

    def refresh(self, values: "Sequence[float]") -> None:
        """Count steps anew after the steps per unit have changed; `values` (n,) is where the queue ends."""
        steps = np.floor(np.asarray(values) * self.limits[kernel.STEPS_PER_UNIT] + 0.5)
        self._position[:] = steps
        self._motors[0, :-1] = steps[:-1]

    def set_filament(self, value: float) -> None:
        """Call where the filament is `value` mm; what is queued runs as it was planned."""
        self._position[-1] = np.floor(value * self.limits[kernel.STEPS_PER_UNIT, -1] + 0.5)

    def stop(self, now: float, line: int) -> FloatArray:
        """Halt at once and forget the queue; returns (n,) where the firmware thinks it stands, mm and degrees."""
        filament = self.n - 1
        undone = 0.0
        for i in range(self.moves):
            undone += self.blocks[(int(self.state[kernel.TAIL]) + i) % self.size, kernel.STEPS + filament]
        if self._running:
            before = self._motors[0, filament]
            self.blocks[int(self.state[kernel.TAIL]), kernel.LINE] = line
            self._end(self._share(now), now)
            undone -= self._motors[0, filament] - before
        self.state[[kernel.TAIL, kernel.HEAD, kernel.BUSY, kernel.PREVIOUS_NOMINAL]] = 0.0
        self.moves = 0
        self.next_event = np.inf
        self._position[:-1] = self._motors[0, :-1]
        self._position[-1] -= undone
        return np.asarray(self._position / self.limits[kernel.STEPS_PER_UNIT])

    def _share(self, now: float) -> float:
        ticks = max(int((now - self._began) * stepper_kernel.TIMER_RATE), 0)
        return float(stepper_kernel.run(self._trapezoid, ticks)[1] / self._trapezoid[stepper_kernel.EVENTS])

    def _end(self, share: float, now: float) -> None:
        if self._count == len(self._records):
            self._records = np.concatenate([self._records, np.zeros_like(self._records)])
        kernel.end_block(self.blocks, self.state, self._motors, self._records[self._count], share, now)
        self._count += 1
        self._running = False

    def records(self) -> FloatArray:
        """(m, n + 2): per block done the true position in mm and degrees, its line, and the time in s."""
        return self._records[: self._count].copy()
