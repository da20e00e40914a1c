"""What the comments of a program say about its motions: role, width, height, wanted speed, layer.

A comment (see `comments`) holds until the next of its kind.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.roles import Role
from trunnion_sim.comments import OTHER, Meaning, meaning
from trunnion_sim.reader import Block
from trunnion_sim.stated import RELIES

LAST_LAYER = 1_000_000_000
HEADER_KEYS = 2000
"""`; key = value` comments kept at most."""


@dataclass
class Notes:
    """Collects comments while the blocks pass through; then answers for rows."""

    header: dict[str, str] = field(default_factory=dict)
    """Values of `; key = value` comments; the last one counts."""
    relies: list[str] = field(default_factory=list)
    """What follows `; the plan relies on`."""
    _events: dict[str, tuple[list[int], list[float]]] = field(
        default_factory=lambda: {key: ([], []) for key in ("type", "role", "width", "height", "speed", "layer")}
    )
    _known: dict[bytes, Meaning] = field(default_factory=dict)
    _layer: int = -1

    def watch(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """Pass blocks on and read their comments."""
        for block in blocks:
            for line, text in block.comments:
                self._read(line, text)
            yield block

    def _read(self, line: int, text: bytes) -> None:
        if text in self._known:
            found = self._known[text]
        else:
            found = meaning(text)
            if len(self._known) < 100_000:
                self._known[text] = found
        if not found:
            self._header(text)
        for key, value in found:
            if key == "layer":
                self._layer = self._layer + 1 if np.isnan(value) else int(value)
            lines, values = self._events[key]
            lines.append(line)
            values.append(float(self._layer) if key == "layer" else value)

    def _header(self, text: bytes) -> None:
        words = text.decode("utf-8", "replace").strip()
        if words.startswith(RELIES) and len(self.relies) < HEADER_KEYS:
            self.relies.append(words[len(RELIES) :])
        name, equals, value = text.partition(b" = ")
        if equals and len(self.header) < HEADER_KEYS:
            self.header[name.strip().decode("utf-8", "replace")] = value.strip().decode("utf-8", "replace")

    def says(self, key: str) -> bool:
        """Whether any comment of this kind was seen."""
        return bool(self._events[key][0])

    def of_lines(self, key: str, lines: IntArray, default: float) -> FloatArray:
        """(n,) the value of a kind that holds at each line of the file."""
        at, values = self._events[key]
        if not at:
            return np.full(len(lines), default)
        held = np.concatenate([[default], values])
        return held[np.searchsorted(np.asarray(at), lines, side="right")]


@dataclass(frozen=True, eq=False)
class RowNotes:
    """What the comments say, row by row; NaN, OTHER or -1 where they are silent.

    Width, height and speed are looked up when asked for: a long program keeps no array for what seldom changes.
    """

    role: NDArray[np.int8]
    """(n,) of `Role`, or OTHER."""
    layer: NDArray[np.int32]
    """(n,) from 0; -1 before the first layer."""
    own_roles: bool
    """Whether the program names the role of every row itself (`;ROLE:`), travels included."""
    notes: Notes
    lines: IntArray
    """(n,) of the file."""

    @property
    def width(self) -> FloatArray:
        """(n,) mm."""
        return self.notes.of_lines("width", self.lines, np.nan)

    @property
    def height(self) -> FloatArray:
        """(n,) mm."""
        return self.notes.of_lines("height", self.lines, np.nan)

    @property
    def speed(self) -> FloatArray:
        """(n,) mm/s wanted of the tip."""
        return self.notes.of_lines("speed", self.lines, np.nan)

    @property
    def bead(self) -> BoolArray:
        """(n,) whether the role is one that lays a bead."""
        return (self.role >= Role.SKIRT) & (self.role <= Role.NONPLANAR_INFILL)


def row_notes(notes: Notes, lines: IntArray) -> RowNotes:
    """Answers for the rows of a motion, given their lines."""
    own = notes.says("role")
    return RowNotes(
        role=notes.of_lines("role" if own else "type", lines, OTHER).astype(np.int8),
        layer=np.clip(notes.of_lines("layer", lines, -1.0), -1, LAST_LAYER).astype(np.int32),
        own_roles=own,
        notes=notes,
        lines=lines,
    )
