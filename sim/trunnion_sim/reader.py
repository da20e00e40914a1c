"""Turn the bytes of a G-code file into blocks of commands and words: the judge's own reader.

The file is read in pieces of fixed size and each piece becomes a `Block` of flat arrays, so memory does not grow with
the program, nor with one endless line: what is longer than `LONGEST_LINE` is skipped and flagged. Nothing is refused
here; what is odd about a line stands in its flags, and the checks make findings of them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import GcodeError
from trunnion_sim import reader_kernel as kernel

CHUNK = 1 << 20
"""Bytes read at a time."""
LONGEST_LINE = 1 << 16
"""Bytes after which a line is no longer taken for G-code and skipped to its end."""
MOST_NAMED = 1000
"""Commands with names, of one piece, whose text is kept."""


@dataclass(frozen=True, eq=False)
class Block:
    """Some consecutive lines. Words of command i are letters and values `word_start[i]` to `word_start[i + 1]`."""

    line: IntArray
    """(m,) line in the file, from 1; only lines with a command or an oddity."""
    letter: NDArray[np.uint8]
    """(m,) letter of the command; 0 where there is none."""
    code: IntArray
    """(m,) ten times the number of the command, plus its decimal: G43.4 is 434; -1 where there is none."""
    flags: IntArray
    """(m,) bits of `reader_kernel`: JUNK, BARE, REPEATED, ..."""
    length: IntArray
    """(m,) bytes of the command without comment and trailing blanks: what goes over the wire."""
    word_start: IntArray
    """(m + 1,)."""
    word_letter: NDArray[np.uint8]
    word_value: FloatArray
    """NaN where a letter has no number."""
    comments: tuple[tuple[int, bytes], ...]
    """Line and text after the semicolon of comments that say something: `;KEY...`, `; key = value`."""
    named: tuple[tuple[int, bytes], ...] = ()
    """Line and text of commands that have a name instead of a number: SET_PRESSURE_ADVANCE ADVANCE=0.05."""


@dataclass(frozen=True)
class FileEnd:
    """How the file ends, known when every block was read."""

    lines: int
    """Lines in the file."""
    newline: bool
    """Whether the last line ends in a newline."""
    last_text: bytes
    """The last line, where it has no newline (at most 200 bytes)."""


class Reader:
    """Iterates over the blocks of one file; `end` is known afterwards."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.end = FileEnd(0, True, b"")

    def __iter__(self) -> Iterator[Block]:
        """Blocks in order. Raises GcodeError where the file cannot be opened or is empty."""
        try:
            file = self.path.open("rb")
        except OSError as error:
            raise GcodeError(f"{self.path}: cannot be read: {error.strerror}") from None
        with file:
            yield from self._blocks(file)
        if self.end.lines == 0:
            raise GcodeError(f"{self.path}: is empty, should be a program of at least one line")

    def _blocks(self, file: BinaryIO) -> Iterator[Block]:
        line = 1
        rest = b""
        skipped = 0  # bytes of the endless line that is being passed over
        while True:
            piece = file.read(CHUNK)
            if not piece:
                break
            if skipped:
                cut = piece.find(b"\n")
                skipped += len(piece) if cut < 0 else cut
                if cut < 0:
                    continue
                yield _overlong(line, skipped)
                piece = piece[cut + 1 :]
                line += 1
                skipped = 0
            data = rest + piece
            end = data.rfind(b"\n") + 1
            if end:
                block, lines = _parse(data[:end], line)
                line += lines
                yield block
            rest = data[end:]
            if len(rest) > LONGEST_LINE:
                rest, skipped = b"", len(rest)
        if skipped:
            yield _overlong(line, skipped)
            line += 1
        elif rest:
            block, _ = _parse(rest + b"\n", line)
            yield block
            line += 1
        torn = bool(rest) or skipped > 0
        self.end = FileEnd(line - 1, not torn, rest[:200])


def _parse(data: bytes, first_line: int) -> tuple[Block, int]:
    buffer = np.frombuffer(data, dtype=np.uint8)
    n = data.count(b"\n")
    words = len(data) // 2 + 1
    line = np.empty(n, np.int64)
    letter = np.empty(n, np.uint8)
    code = np.empty(n, np.int64)
    flags = np.empty(n, np.int64)
    length = np.empty(n, np.int64)
    word_start = np.zeros(n + 1, np.int64)
    word_letter = np.empty(words, np.uint8)
    word_value = np.empty(words, np.float64)
    comment = np.empty((n, 3), np.int64)
    m, w, c = kernel.parse(
        buffer,
        first_line,
        LONGEST_LINE,
        line,
        letter,
        code,
        flags,
        length,
        word_start,
        word_letter,
        word_value,
        comment,
    )
    block = Block(
        line=line[:m],
        letter=letter[:m],
        code=code[:m],
        flags=flags[:m],
        length=length[:m],
        word_start=word_start[: m + 1],
        word_letter=word_letter[:w].copy(),
        word_value=word_value[:w].copy(),
        comments=tuple((int(at), data[start:stop]) for at, start, stop in comment[:c].tolist()),
        named=_named(data, first_line, line[:m][(flags[:m] & kernel.NAMED) > 0][:MOST_NAMED]),
    )
    return block, n


def _named(data: bytes, first_line: int, lines: IntArray) -> tuple[tuple[int, bytes], ...]:
    """Those lines and what stands in them before a semicolon."""
    if not len(lines):
        return ()
    text = data.split(b"\n")
    return tuple((line, text[line - first_line].partition(b";")[0].strip()) for line in lines.tolist())


def _overlong(line: int, length: int) -> Block:
    """A block that only says that this line was too long to be read."""
    return Block(
        line=np.array([line]),
        letter=np.zeros(1, np.uint8),
        code=np.array([-1]),
        flags=np.array([kernel.OVERLONG]),
        length=np.array([length]),
        word_start=np.zeros(2, np.int64),
        word_letter=np.zeros(0, np.uint8),
        word_value=np.zeros(0),
        comments=(),
    )
