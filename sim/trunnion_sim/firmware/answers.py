"""The wire down: what the machine says, as the host gets it, late or damaged where a fault wants it so."""

import math
from collections import deque

from trunnion_sim.firmware.fault_plan import FaultPlan


class Answers:
    """Bytes on their way to the host."""

    def __init__(self, plan: FaultPlan) -> None:
        self._plan = plan if plan.touches_down else None
        self._ready = bytearray()
        self._held: deque[tuple[float, bytes]] = deque()

    def say(self, text: bytes, now: float) -> None:
        """Whole lines, now."""
        if self._plan is None:
            if self._held:
                self._held.append((self._held[-1][0], text))
            else:
                self._ready += text
            return
        for line in text.splitlines(keepends=True):
            for piece, delay in self._plan.down(line, now):
                if delay or self._held:
                    self.hold(piece, now, delay)
                else:
                    self._ready += piece

    def hold(self, text: bytes, now: float, delay: float) -> None:
        """Bytes that go out `delay` s from now, after what is held already."""
        at = max(now + delay, self._held[-1][0]) if self._held else now + delay
        self._held.append((at, text))

    @property
    def next_event(self) -> float:
        """When held bytes go out."""
        return self._held[0][0] if self._held else math.inf

    def release(self, now: float) -> None:
        """Send what is due."""
        while self._held and self._held[0][0] <= now:
            self._ready += self._held.popleft()[1]

    def __len__(self) -> int:
        return len(self._ready)

    def take(self) -> bytes:
        """What has reached the host since the last time."""
        out = bytes(self._ready)
        self._ready.clear()
        return out
