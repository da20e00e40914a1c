"""The software machine: a Marlin 2.1 as a state machine without I/O and without a clock of its own.

Bytes and time come in, bytes go out. All that happens, happens in simulated time, so order never depends on how fast
that time is made to pass. The loop is Marlin's: take lines while the queue of four has room, report bad ones at once,
run one command, answer ok, let the planner and the heaters go on meanwhile.
"""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from trunnion_core.profile import MachineProfile
from trunnion_core.trace import Trace
from trunnion_sim.firmware import replies
from trunnion_sim.firmware.answers import Answers
from trunnion_sim.firmware.dispatch import dispatch
from trunnion_sim.firmware.emergency import EmergencyParser
from trunnion_sim.firmware.fault_plan import FaultPlan
from trunnion_sim.firmware.faults import Fault
from trunnion_sim.firmware.heat import TICK, Heater, bed, hotend
from trunnion_sim.firmware.motion import Motion
from trunnion_sim.firmware.parser import bare
from trunnion_sim.firmware.planner import Planner
from trunnion_sim.firmware.reader import CHECKSUM, LineError, LineReader
from trunnion_sim.firmware.ring import ReceiveRing
from trunnion_sim.firmware.strikes import strike
from trunnion_sim.firmware.waits import Steps, Wait

QUEUE = 4
"""Command lines held, the running one included (BUFSIZE)."""
AMBIENT = 21.0
QUICK_STOP = 1.0
"""s after M410 in which Marlin runs no command: `quickstop_stepper` waits until `cleaning_buffer_counter` is 0."""
BUSY_EVERY = 2.0
IDLE_HEATING = 50.0
"""How much faster than the outside an idle machine as fast as possible heats up."""
EVENTS_AT_ONCE = 10000
"""Events after which a machine as fast as possible lets its caller look at the world again."""


class SoftwareMachine:
    """A printer behind a serial wire.

    `speed` is how many simulated seconds pass in one second given to `advance`; None: as many as the work takes.
    Then time stands still while the machine could take another line, and jumps while a command makes the host wait,
    so simulated times are those of a host without latency.
    """

    def __init__(
        self,
        profile: MachineProfile,
        *,
        speed: float | None = 1.0,
        faults: Sequence[Fault] = (),
        seed: int = 0,
        advanced_ok: bool = False,
    ) -> None:
        if speed is not None and not (speed > 0 and math.isfinite(speed)):
            raise ValueError(f"speed: {speed}, should be a positive factor, or None for as fast as possible")
        self.profile = profile
        self.speed = speed
        self.now = 0.0
        """Simulated seconds since power-up."""
        self.executed: list[str] = []
        """Every command that the firmware knew, in the order of execution, without number and checksum."""
        self.advanced_ok = advanced_ok
        self.unplugged_until = -math.inf
        """Machine time at which the cable is in again."""
        self._faults = FaultPlan(faults, seed)
        self._timed = deque(self._faults.timed)
        self._out = Answers(self._faults)
        self._past: list[np.typing.NDArray[np.float64]] = []
        limits = profile.heaters
        models = [hotend(limits.nozzle.max_temperature)]
        if limits.bed is not None:
            models.append(bed(limits.bed.max_temperature))
        self.heaters = [Heater(model, AMBIENT, seed) for model in models]
        self._heat_clock = 0.0
        self._boot()
        self.say(replies.banner())

    # What the world does to the machine

    def receive(self, data: bytes) -> None:
        """Bytes arrive on the wire, now and all at once.

        What the queue of four has no room for goes to the receive ring and is lost where that is full. A line error
        throws away whatever has arrived behind it.
        """
        if self.halted or not self.connected:
            return
        data = self._faults.up(data, self.now)
        self._flushed = False
        start = 0
        size = len(data)
        while start < size:
            stop = data.find(b"\n", start)
            stop = size if stop < 0 else stop + 1
            part = data[start:stop]
            if b"\r" in part:
                for piece in part.replace(b"\r", b"\r\0\0").split(b"\0\0"):
                    if piece:
                        self._arrive(piece)
            else:
                self._arrive(part)
            start = stop

    def run_until(self, t: float) -> bytes:
        """Everything up to time `t` happens; returns what the machine said meanwhile."""
        self._settle()
        while (at := self.next_event) <= t:
            self._step(at)
        self.now = max(self.now, t)
        return self.take()

    def advance(self, seconds: float) -> bytes:
        """Let `seconds` of the outside pass; returns what the machine said meanwhile.

        With speed None a running command takes none of them, and neither does motion once they are more than 0: what
        they measure is how long the host has been silent.
        """
        if self.speed is not None:
            return self.run_until(self.now + seconds * self.speed)
        self.work()
        if self._out or self.working or seconds <= 0:
            return self.take()
        if self.planner.moves and not self.halted:
            for _ in range(EVENTS_AT_ONCE):
                if self._out or not self.planner.moves:
                    break
                self._step(self.next_event)
            return self.take()
        off_target = any(h.target and abs(h.target - h.reading) > h.model.hysteresis for h in self.heaters)
        return self.run_until(self.now + seconds * (IDLE_HEATING if off_target else 1.0))

    def work(self) -> None:
        """Jump from event to event while a command makes the host wait, until there is something to say."""
        self._settle()
        for _ in range(EVENTS_AT_ONCE):
            at = self.next_event
            if self._out or not self.working or at == math.inf:
                break
            self._step(at)

    def reset(self, *, quietly: bool = False) -> None:
        """The board restarts: queues, positions and targets are lost; what is hot cools."""
        self.planner.stop(self.now, self.line)
        self._past.append(self.planner.records())
        self._boot()
        for heater in self.heaters:
            heater.set_target(0.0, self.now)
            heater.duty = 0.0
        self.watch_heat()
        if not quietly:
            self.say(replies.banner())

    def finish(self) -> bytes:
        """Let time pass until nothing moves and no command runs; returns what was said."""
        self._settle()
        while not self.halted and (self.planner.moves or self.working):
            self._step(self.next_event)
        return self.take()

    def take(self) -> bytes:
        """What the machine has said since the last time."""
        said = self._out.take()
        return said if self.connected else b""

    @property
    def connected(self) -> bool:
        """Whether the cable is in."""
        return self.now >= self.unplugged_until

    @property
    def working(self) -> bool:
        """Whether a command runs that time alone will end."""
        if self.now < self._held_until:
            return not self.halted
        return self._handler is not None and not self._wait.user and not self.halted

    @property
    def next_event(self) -> float:
        """Simulated time at which something happens by itself; inf for never."""
        if self.halted:
            return self._out.next_event
        return min(
            self.planner.next_event,
            self._command_event(),
            self._busy_at,
            self._temperature_at,
            self._position_at,
            self._heat_at,
            self._out.next_event,
            self._timed[0].at if self._timed else math.inf,
        )

    def _command_event(self) -> float:
        if self.now < self._held_until:
            return self._held_until
        return self._wait.until if self._handler is not None else math.inf

    def trace(self) -> Trace:
        """What the joints did so far, a row per planner block; `line` counts in `executed`, from 1."""
        from trunnion_sim.chain import forward

        rows = np.concatenate([*self._past, self.planner.records()])
        k = len(self.profile.joints)
        joints = rows[:, :k] / self.profile.to_shown
        filament = np.diff(rows[:, k], prepend=0.0)
        points, tool_axes = forward(self.profile, joints)
        return Trace(
            line=rows[:, k + 1].astype(np.int64),
            joints=joints,
            points=points,
            tool_axes=tool_axes,
            volume=filament * self.profile.filament_area,
            time=rows[:, k + 2],
        )

    # What commands use

    @property
    def line(self) -> int:
        """Place of the running command in `executed`, from 1."""
        return len(self.executed)

    def say(self, text: str) -> None:
        """Send text to the host."""
        self._out.say(text.encode("latin-1"), self.now)

    def say_ok(self, text: str) -> None:
        """An ok with text behind it, in place of the plain one."""
        self.say(f"ok{text}\n")
        self._ok_said = True

    def position_report(self) -> str:
        """Logical end of the queue, and where the motors are now."""
        return replies.position(self.motion, self.motion.logical(), self.planner.steps_now(self.now))

    def temperature_report(self) -> str:
        """Every heater's reading, target and duty."""
        return replies.temperatures(self.heaters)

    def set_heater(self, heater: Heater, target: float) -> None:
        """A new target for a heater."""
        self.refresh_heat()
        heater.set_target(target, self.now)
        self._heat_at = self.now + TICK

    def refresh_heat(self) -> None:
        """Bring readings of resting heaters up to now."""
        if self._heat_at == math.inf and self.now - self._heat_clock >= TICK:
            self._tick_heat()

    def schedule_reports(self) -> None:
        """Start the intervals of M154 and M155 anew."""
        every = self.report_temperature_every
        self._temperature_at = self.now + every if every else math.inf
        every = self.report_position_every
        self._position_at = self.now + every if every else math.inf

    def watch_heat(self) -> None:
        """Read the sensors from now on, though the heaters may be cold."""
        self.refresh_heat()
        self._heat_at = min(self._heat_at, self.now + TICK)

    def kill(self, reason: str | None) -> None:
        """Halt: heaters off, deaf and mute from here on."""
        self.say((f"echo:{reason}\n" if reason else "") + replies.KILLED)
        self._halt()

    # The firmware's insides

    def _boot(self) -> None:
        self.halted = False
        self.planner = Planner(self.profile)
        self.motion = Motion(self.profile)
        self.reader = LineReader()
        self.ring = ReceiveRing()
        self.emergency = EmergencyParser()
        self.coldest_extrusion = self.profile.extruder.min_temperature
        self.allow_cold = False
        self.waits_for_heat = False
        self.waits_for_user = False
        self.prompt_open = False
        self.busy_every = BUSY_EVERY
        self.report_temperature_every = 0.0
        self.report_position_every = 0.0
        self._queue: deque[bytes] = deque()
        self._handler: Steps | None = None
        self._wait = Wait()
        self._ok_said = False
        self._flushed = False
        self.resend_ok_after: float | None = 0.0
        self.refuses_lines = False
        self.dropped_moves = 0
        self._held_until = -math.inf
        self._busy_at = math.inf
        self._temperature_at = math.inf
        self._position_at = math.inf
        self._heat_at = math.inf

    def _arrive(self, data: bytes) -> None:
        """Bytes of which at most the last ends a line."""
        urgent = self.emergency.feed(data)
        if urgent is not None:
            self._emergency(*urgent)
        if self.halted or self._flushed:
            return
        if len(self._queue) >= QUEUE or self.ring:
            self.ring.put(data)
        else:
            self._take_line(data)

    def _take_line(self, data: bytes) -> None:
        found = self.reader.feed(data)
        if found is None:
            return
        if isinstance(found, LineError):
            self._ask_again(found.text)
        elif self.refuses_lines and found.lstrip().startswith(b"N"):
            self.reader.last -= 1
            self._ask_again(CHECKSUM)
        else:
            self._queue.append(found)

    def _settle(self) -> None:
        """All that takes no time."""
        while not self.halted:
            while self.ring and len(self._queue) < QUEUE:
                self._take_line(self.ring.take_line())
            if self.now < self._held_until:
                return
            if self._handler is not None:
                if not self._resume():
                    return
            elif self._queue:
                self._begin(self._queue[0])
            else:
                return

    def _ask_again(self, reason: str) -> None:
        last = self.reader.last
        self._flushed = True
        self.ring.flush()
        self.reader.forget()
        self.say(f"Error:{reason}{last}\nResend: {last + 1}\n")
        if self.resend_ok_after == 0.0:
            self.say("ok\n")
        elif self.resend_ok_after is not None:
            self._out.hold(b"ok\n", self.now, self.resend_ok_after)

    def _begin(self, line: bytes) -> None:
        delays = []
        for fault in self._faults.on_command(self.now):
            delay = strike(self, fault)
            if self.halted or not self._queue:
                return
            if delay is not None:
                delays.append(delay)
        text = bare(line)
        steps = self._delayed(delays, text) if delays else dispatch(self, text)
        if steps is None:
            self._finish()
        else:
            self._start(steps)

    def _delayed(self, delays: list[Steps], text: str) -> Steps:
        for delay in delays:
            yield from delay
        yield from dispatch(self, text) or ()

    def _start(self, steps: Steps) -> None:
        self._handler = steps
        self._wait = Wait(until=self.now)
        self._busy_at = self.now + self.busy_every if self.busy_every else math.inf

    def _resume(self) -> bool:
        wait = self._wait
        if self.now < wait.until and not (wait.ready is not None and wait.ready()):
            return False
        handler = self._handler
        if handler is None:
            return False
        following = next(handler, None)
        if following is None:
            self._handler = None
            self._busy_at = math.inf
            self._finish()
        else:
            self._wait = following
        return True

    def _finish(self) -> None:
        if self.halted:
            return
        if self._ok_said:
            self._ok_said = False
        elif self.advanced_ok:
            number = self._queue[0].decode("latin-1").split(" ", 1)[0]
            name = f" {number}" if number[:1] == "N" else ""
            self.say(f"ok{name} P{self.planner.free} B{QUEUE - len(self._queue)}\n")
        else:
            self._out.say(b"ok\n", self.now)
        self._queue.popleft()

    def _emergency(self, code: str, answer: int | None) -> None:
        if code == "M112":
            self.kill("M112 Shutdown")
        elif code == "M108":
            self.waits_for_heat = False
            self.waits_for_user = False
        elif code == "M410":
            self.motion.stand_at(self.planner.stop(self.now, self.line).tolist())
            self._held_until = self.now + QUICK_STOP
        elif code == "M876" and answer is not None:
            reason = "FILAMENT_RUNOUT_CONTINUE" if self.prompt_open else "UNKNOWN STATE"
            self.prompt_open = False
            self.waits_for_user = False
            self.say(f"M876 Responding PROMPT_{reason}\n")
        elif code == "S000":
            state = 5 if self.planner.moves else 3
            self.say(f"{self.position_report()}S_XYZ:{state}\n")

    def _step(self, at: float) -> None:
        """What is due at `at`, the time of the next event."""
        self.now = max(at, self.now)
        self._out.release(at)
        if not self.halted and self._strike_due(at) and self._motion_and_heat_due(at):
            self._reports_due(at)
            self._settle()

    def _strike_due(self, at: float) -> bool:
        while self._timed and self._timed[0].at <= at and not self.halted:
            strike(self, self._timed.popleft())
        return not self.halted

    def _motion_and_heat_due(self, at: float) -> bool:
        if self.planner.next_event <= at:
            self.planner.fire()
        if self._heat_at <= at:
            self._tick_heat()
        return not self.halted

    def _reports_due(self, at: float) -> None:
        if self._busy_at <= at:
            self._busy_at = at + self.busy_every if self.busy_every else math.inf
            if self._wait.busy:
                self.say(f"echo:busy: {self._wait.busy}\n")
        if self._temperature_at <= at:
            self._temperature_at = at + self.report_temperature_every
            self.refresh_heat()
            self.say(self.temperature_report() + "\n")
        if self._position_at <= at:
            self._position_at = at + self.report_position_every
            self.say(self.position_report())

    def _tick_heat(self) -> None:
        elapsed = self.now - self._heat_clock
        self._heat_clock = self.now
        for heater in self.heaters:
            error = heater.tick(self.now, elapsed)
            if error is not None:
                self.say(replies.heat_error(heater, error))
                self._halt()
                return
        self._heat_at = math.inf if all(heater.quiet for heater in self.heaters) else self.now + TICK

    def _halt(self) -> None:
        for heater in self.heaters:
            heater.target = heater.duty = 0.0
        self.planner.stop(self.now, self.line)
        self.halted = True
        self._handler = None
        self._queue.clear()
