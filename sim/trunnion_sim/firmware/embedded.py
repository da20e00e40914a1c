"""A software machine as a serial port inside this process."""

import threading
import time

from trunnion_sim.firmware.machine import SoftwareMachine

GRACE = 0.02
"""s of silence after which a machine as fast as possible takes it that nothing more is coming just now."""
LONGEST_SLEEP = 0.05
"""s between two looks at the clock."""


class Pace:
    """Hands the passing of real time to a machine."""

    def __init__(self, machine: SoftwareMachine) -> None:
        self._machine = machine
        self._clock = time.monotonic()
        self._busy_until = self._clock + GRACE

    def active(self) -> None:
        """Something was written: a machine as fast as possible stands still for a moment, more may follow."""
        self._busy_until = time.monotonic() + GRACE

    def elapsed(self) -> float:
        """Seconds to hand to `advance` now."""
        clock = time.monotonic()
        if self._machine.speed is None and clock < self._busy_until:
            self._clock = clock
            return 0.0
        seconds = clock - self._clock
        self._clock = clock
        return seconds

    def sleep(self) -> float:
        """Seconds until something can happen by itself."""
        machine = self._machine
        if machine.speed is None:
            if machine.working:
                return 0.0
            left = self._busy_until - time.monotonic()
            return left if left > 0 else LONGEST_SLEEP
        return min(max((machine.next_event - machine.now) / machine.speed, 0.0), LONGEST_SLEEP)


class EmbeddedPort:
    """What a host opens instead of a device; any thread may read, write and close.

    After the machine was unplugged a port stays dead; once it is back, a new one reaches it.
    """

    def __init__(self, machine: SoftwareMachine) -> None:
        self.machine = machine
        self._changed = threading.Condition()
        self._pace = Pace(machine)
        self._out = bytearray()
        self._closed = False
        self._gone = False

    def write(self, data: bytes) -> None:
        """Send bytes to the machine. Raises OSError once the port is closed or gone."""
        with self._changed:
            self._check()
            self._out += self.machine.advance(self._pace.elapsed())
            self.machine.receive(data)
            self._pace.active()
            self._changed.notify_all()

    def read(self, timeout: float) -> bytes:
        """What the machine said, as soon as there is something; empty after `timeout` s.

        Raises OSError once the port is closed or gone.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                self._out += self.machine.advance(self._pace.elapsed())
                self._check()
                if self._out:
                    said = bytes(self._out)
                    self._out.clear()
                    self._pace.active()
                    return said
                left = deadline - time.monotonic()
                if left <= 0:
                    return b""
                self._changed.wait(min(left, self._pace.sleep()))

    def close(self) -> None:
        """Readers in other threads get an OSError; the machine lives on."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _check(self) -> None:
        if self._closed:
            raise OSError("the port is closed")
        self._gone = self._gone or not self.machine.connected
        if self._gone:
            raise OSError("the port is gone: the printer was unplugged")
