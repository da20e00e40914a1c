"""Rows of a motion that grow in place while a program is read, so that they are in memory once and never twice."""

from trunnion_core.arrays import FloatArray
from trunnion_sim.motion_kernel import Rows, fresh_rows

LARGEST_STEP = 250_000
"""Rows by which a long program's arrays grow at a time; large arrays are moved by the memory's pages, not copied."""


class RowStore:
    """Row 0 is where the machine stands before the first motion; motions follow."""

    def __init__(self, k: int) -> None:
        """For k joints."""
        self._rows = fresh_rows(1, k)
        self._used = 1

    def __len__(self) -> int:
        """Motions so far."""
        return self._used - 1

    def room(self, count: int) -> Rows:
        """At least `count` free rows to write to; valid until the next call of any other method."""
        need = self._used + count
        held = len(self._rows.line)
        if need > held:
            self._resize(max(need, min(2 * held, held + LARGEST_STEP)))
        return _from(self._rows, self._used)

    def take(self, made: int) -> None:
        """Keep the first `made` rows of the room given last."""
        self._used += made

    def finished(self) -> tuple[Rows, FloatArray]:
        """The n motions; and the joints with where they start in front, (n + 1, k), of which theirs are views."""
        self._resize(self._used)
        return _from(self._rows, 1), self._rows.joints

    def _resize(self, count: int) -> None:
        for column in self._rows:
            # views that are given out are not used again: see `room`
            column.resize((count, *column.shape[1:]), refcheck=False)


def _from(rows: Rows, begin: int) -> Rows:
    """Views of the rows from `begin`."""
    return Rows._make(column[begin:] for column in rows)
