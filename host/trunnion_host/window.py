"""Lines under way: sent, and not known to have been taken. How many there may be is learned from what gets lost."""

from collections import deque
from collections.abc import Iterable

from trunnion_host.limits import Limits


class Window:
    """Numbers on the wire in the order in which they were sent, with the bytes that each takes.

    `room` is how many lines may be under way: fewer after many were lost, more again after a calm stretch.
    """

    def __init__(self, limits: Limits) -> None:
        self.room = limits.window_lines
        self._limits = limits
        self._lines: deque[tuple[int, int]] = deque()
        self._bytes = 0
        self._missed = (0, 0)
        self._losses: deque[int] = deque(maxlen=5)

    def __len__(self) -> int:
        return len(self._lines)

    def takes(self, size: int) -> bool:
        """Whether so many bytes more fit the firmware's receive ring; an empty one takes any line."""
        return not self._lines or self._bytes + size <= self._limits.window_bytes

    def push(self, number: int, size: int) -> None:
        """A line went out."""
        self._lines.append((number, size))
        self._bytes += size

    def pop(self) -> int:
        """The number of the oldest line, which was taken."""
        number, size = self._lines.popleft()
        self._bytes -= size
        return number

    def restart(self, lines: Iterable[tuple[int, int]] = ()) -> None:
        """Exactly these (number, size) are under way."""
        self._lines = deque(lines)
        self._bytes = sum(size for _, size in self._lines)

    def reaches(self, number: int) -> bool:
        """Whether a line of this number or a later one is under way."""
        return any(sent >= number for sent, _ in self._lines)

    def missed(self, number: int) -> int:
        """The firmware asks for a line; how many times in a row it has."""
        self._missed = (number, self._missed[1] + 1 if number == self._missed[0] else 1)
        return self._missed[1]

    def taken(self, number: int) -> None:
        """The firmware has taken everything up to a number."""
        asked, times = self._missed
        if asked and number > asked + self._limits.calm:
            self.room = min(self.room + 1, self._limits.window_lines)
            self._missed = (number, 0)
        elif times and number > asked:
            self._missed = (asked, 0)

    def lost(self, number: int) -> None:
        """Everything from a number on was lost; lost this often, more is under way than the firmware can hold."""
        self.restart()
        self._losses.append(number)
        if len(self._losses) == 5 and number - self._losses[0] < self._limits.crowded and self.room > 1:
            self.room -= 1
            self._losses.clear()
