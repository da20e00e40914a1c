"""Which line each number on the wire carries: the program's, and between them the host's own."""

from array import array
from collections.abc import Sequence

from trunnion_host.wire import numbered

FINISH = "M400"
"""Waits until everything before it has moved."""


class LineLog:
    """Number n carries `text(n)` for ever: a Resend is served from here.

    Entries from 0 are indices into the program, then FINISH, then the farewell; below 0 they are the host's own lines.
    `next_line` is the next entry of the program to go out, `end` the entry at which feeding ends.
    """

    def __init__(self, program: Sequence[str], farewell: Sequence[str], own: Sequence[str]) -> None:
        """`own` [k] is the text of entry -1 - k; number 0 is M110's, number 1 carries entry -1."""
        self.total = len(program)
        self.next_line = 0
        self.end = self.total + 1
        self._texts = (*program, FINISH, *farewell)
        self._own = tuple(own)
        self._entries = array("q", [-1, -1])

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, number: int) -> int:
        return self._entries[number]

    def append(self, entry: int) -> None:
        """The next number carries this."""
        self._entries.append(entry)

    def pop(self) -> None:
        """The last number was not used after all."""
        self._entries.pop()

    def text(self, number: int) -> str:
        """The command under a number."""
        entry = self._entries[number]
        return self._texts[entry] if entry >= 0 else self._own[-1 - entry]

    def wire(self, number: int) -> bytes:
        """The whole line under a number."""
        return numbered(number, self.text(number))

    def last_of_program(self, first: int, last: int) -> int:
        """How many lines of the program are executed when numbers `first` to `last` are; 0 if none is among them."""
        return max((entry + 1 for entry in self._entries[first : last + 1] if 0 <= entry < self.total), default=0)

    def say_farewell(self) -> None:
        """Leave the rest of the program out."""
        self.next_line = self.total + 1
        self.end = len(self._texts)
