"""Turn blocks of commands into executed motions: modal state, units, offsets, homing, arcs.

Every motion row ends in joint values; non-motion commands are kept beside, each with the row before which it stands.
The state machine runs over the words in one compiled loop and is carried from block to block.
"""

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.errors import GcodeError
from trunnion_core.profile import MachineProfile
from trunnion_sim import motion_kernel as kernel
from trunnion_sim.reader import Block
from trunnion_sim.row_store import RowStore
from trunnion_sim.rules import Rules
from trunnion_sim.tip_control import SEGMENTS_PER_SECOND, TipControl, told
from trunnion_sim.tip_rows import cut_words, joints_of_tips, pieces_in_time, pieces_of_tips


@dataclass(frozen=True)
class Command:
    """A command that is no motion; it takes effect before `row`."""

    line: int
    row: int
    letter: str
    code: int
    """Ten times the number; -1 where the command has a name instead, which is then the letter."""
    words: tuple[tuple[str, float], ...]

    def get(self, letter: str) -> float | None:
        """The value of a word; None where it is missing or bare."""
        for name, value in self.words:
            if name == letter and not math.isnan(value):
                return value
        return None

    @property
    def name(self) -> str:
        """As people write it: G43.4."""
        return code_name(self.letter, self.code)


@dataclass(frozen=True, eq=False)
class Motion:
    """What the program tells the machine to do, one row per motion."""

    line: IntArray
    """(n,) line in the file, from 1."""
    kind: NDArray[np.uint8]
    """(n,) of `motion_kernel`: RAPID, LINEAR, ARC, HOME."""
    path: FloatArray
    """(n + 1, k) mm or rad: the joints where they are taken to stand at the start, then at the end of every row."""
    filament: FloatArray
    """(n,) mm fed, after M221."""
    feed: FloatArray
    """(n,) mm/s or deg/s as the F word in force says, after M220; with `inverse`, 1/s."""
    inverse: BoolArray
    """(n,) whether the feed is G93 inverse time."""
    relative: BoolArray
    """(n,) whether axis words were relative (G91)."""
    homed: NDArray[np.uint8]
    """(n,) bits of the joints that were homed when the row ran."""
    dwell: FloatArray
    """(n,) s of rest before the row; NaN where the machine only waits for its queue to empty; 0 if neither."""
    bytes: NDArray[np.int32]
    """(n,) of the line as it is sent, without number and checksum; 0 on further pieces of an arc."""
    commands: tuple[Command, ...]
    """Every non-motion command worth keeping, in order."""
    code_first_line: dict[tuple[str, int], int]
    """First line of every command that appears."""
    code_count: Counter[tuple[str, int]]
    dropped: dict[str, list[int]] = field(default_factory=dict)
    """Lines whose motion could not be understood, by reason."""
    of_tip: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_))
    """(n,) whether the row named the tip instead of joints; empty where none did."""

    def __len__(self) -> int:
        return len(self.line)

    @property
    def start(self) -> FloatArray:
        """(k,) joints before the first row."""
        return np.asarray(self.path[0])

    @property
    def joints(self) -> FloatArray:
        """(n, k) joints at the end of every row."""
        return self.path[1:]

    @property
    def before(self) -> FloatArray:
        """(n, k) joints at the start of every row."""
        return self.path[:-1]

    def part(self, begin: int, end: int) -> "Motion":
        """The rows from `begin` to `end` without copying them; commands are left out."""
        cut = {name: getattr(self, name)[begin:end] for name in PER_ROW}
        return dataclasses.replace(self, path=self.path[begin : end + 1], commands=(), **cut)


PER_ROW = ("line", "kind", "filament", "feed", "inverse", "relative", "homed", "dwell", "bytes", "of_tip")


KEPT = (
    {
        ("M", n * 10)
        for n in (
            *(0, 1, 82, 83, 104, 109, 112, 116, 140, 190, 191, 200, 201, 203, 204, 205, 302),
            *(566, 568, 572, 600, 665, 900),
        )
    }
    | {("G", n * 10) for n in (4, 10, 20, 28, 29, 49, 90, 91, 92, 93, 94)}
    | {("G", 434)}
)
"""Non-motion commands whose words matter later."""

MOST_PIECES = 20_000
"""Room for the pieces of an arc, of which there are 10,000 at most, beside a row for every line."""
MOST_BYTES = 1_700_000_000
"""For the motions of one program, so that judging takes less than 2 GB in all."""
BYTES, BYTES_PER_JOINT = 180, 50
"""That judging needs for each motion (`bench/judge.py --bad`: 5 million on three and on five axes)."""


def interpret(blocks: Iterable[Block], profile: MachineProfile, rules: Rules) -> Motion:
    """Run the modal state over every block; what cannot be understood is in `dropped`.

    Raises GcodeError where there are more motions than MOST_BYTES hold.
    """
    k = len(profile.joints)
    most = MOST_BYTES // (BYTES + BYTES_PER_JOINT * k)
    letters = np.array([ord(letter) for letter in profile.letters], np.int64)
    rotary = np.array([joint.rotary for joint in profile.joints])
    home = profile.array("home") * profile.to_shown
    state = kernel.fresh_state(k, profile.filament_area)
    store = RowStore(k)
    commands: list[Command] = []
    first_line: dict[tuple[str, int], int] = {}
    count: Counter[tuple[str, int]] = Counter()
    dropped: dict[str, list[int]] = {}
    for block in blocks:
        at = 0
        m = len(block.line)
        row_of_command = np.zeros(m, np.int64)
        problem = np.zeros(m, np.int64)
        while at < m:
            out = store.room(m - at + MOST_PIECES)
            at, made = kernel.execute(
                at, block.letter, block.code, block.flags, block.word_start, block.word_letter, block.word_value,
                block.line, block.length, letters, rotary, home, rules.g90_resets_e, rules.case_sensitive,
                rules.whole_percent, ord(rules.filament), state, out, row_of_command, problem, len(store),
            )  # fmt: skip
            store.take(made)
            if len(store) > most:
                raise GcodeError(
                    f"line {int(block.line[at - 1])}: here the program has more than {most:,} motions, "
                    "which is the most that is judged in one piece; split it"
                )
        _collect(block, row_of_command, commands, first_line, count)
        commands += _named(block, row_of_command, rules.names)
        for code, reason in kernel.PROBLEMS.items():
            hit = block.line[problem == code]
            if hit.size:
                dropped.setdefault(reason, []).extend(hit.tolist())
    rows, path = store.finished()
    path /= profile.to_shown
    of_tip = _of_tip(commands, rows.kind, rules)
    if of_tip.any():
        rows, path, of_tip, commands = _followed(profile, rows, path[0], of_tip, commands, rules)
    return Motion(
        line=rows.line,
        kind=rows.kind,
        path=path,
        filament=rows.filament,
        feed=rows.feed,
        inverse=(rows.flags & kernel.INVERSE) > 0,
        relative=(rows.flags & kernel.RELATIVE) > 0,
        homed=rows.homed,
        dwell=rows.dwell,
        bytes=rows.bytes,
        commands=tuple(commands),
        code_first_line=first_line,
        code_count=count,
        dropped=dropped,
        of_tip=of_tip if of_tip.any() else np.zeros(0, np.bool_),
    )


def _of_tip(commands: list[Command], kind: NDArray[np.uint8], rules: Rules) -> BoolArray:
    """(n,) rows whose X, Y and Z are the tip; homing always names joints."""
    named = np.full(len(kind), rules.tip_words == "always")
    if rules.tip_words == "G43.4":
        for command in commands:
            if command.name in ("G43.4", "G49"):
                named[command.row :] = command.name == "G43.4"
    return np.asarray(named & (kind != kernel.HOME))


def _followed(
    profile: MachineProfile,
    rows: kernel.Rows,
    start: FloatArray,
    of_tip: BoolArray,
    commands: list[Command],
    rules: Rules,
) -> tuple[kernel.Rows, FloatArray, BoolArray, list[Command]]:
    """Rows, path, which rows name the tip, and commands, when rows that name the tip are followed in joints."""
    joints = joints_of_tips(profile, rows.joints, of_tip, _told(profile, commands))
    pieces = pieces_of_tips(profile, start, joints, of_tip, rows.filament > 0)
    if rules.tip_words == "G43.4":
        per_second = np.full(len(joints), SEGMENTS_PER_SECOND)
        for command in commands:
            if command.name == "M665" and (value := command.get("S")) is not None and value > 0:
                per_second[command.row :] = value
        timed = pieces_in_time(
            profile, start, joints, rows.filament, of_tip, rows.feed, per_second, rules.least_steps
        )  # fmt: skip
        pieces = np.maximum(pieces, timed)
    if (pieces > 1).any():
        rows, commands = _cut(profile, start, joints, rows, pieces, commands)
        of_tip = np.repeat(of_tip, pieces)
        joints = joints_of_tips(profile, rows.joints, of_tip, _told(profile, commands))
    return rows, np.concatenate([start[None], joints]), of_tip, commands


def _told(profile: MachineProfile, commands: list[Command]) -> list[tuple[int, TipControl]]:
    """Rows from which on M665 makes the firmware believe in another geometry, and that."""
    telling = [
        command for command in commands if command.name == "M665" and any(c in "XYZIJK" for c, _ in command.words)
    ]
    believed = told(profile, [dict(command.words) for command in telling])
    return [(command.row, control) for command, control in zip(telling, believed, strict=True)]


def _cut(
    profile: MachineProfile,
    start: FloatArray,
    joints: FloatArray,
    made: kernel.Rows,
    count: IntArray,
    commands: list[Command],
) -> tuple[kernel.Rows, list[Command]]:
    """Rows cut into `count` (n,) pieces each, and the commands before them; rests and bytes stay with the first."""
    rows, piece, words = cut_words(profile, start, joints, made.joints, count)
    first = piece == 1
    pieces = kernel.Rows(
        line=made.line[rows],
        kind=made.kind[rows],
        joints=words,
        filament=made.filament[rows] / count[rows],
        feed=np.where(made.flags[rows] & kernel.INVERSE, made.feed[rows] * count[rows], made.feed[rows]),
        flags=made.flags[rows],
        homed=made.homed[rows],
        dwell=np.where(first, made.dwell[rows], 0.0),
        bytes=np.where(first, made.bytes[rows], 0),
    )
    begins = np.append(np.cumsum(count) - count, count.sum())
    return pieces, [dataclasses.replace(command, row=int(begins[command.row])) for command in commands]


def _collect(
    block: Block,
    rows: IntArray,
    commands: list[Command],
    first_line: dict[tuple[str, int], int],
    count: Counter[tuple[str, int]],
) -> None:
    """Keep what is not motion: counts of every command, and the words of those that matter."""
    plain = ((block.flags & kernel.NOT_A_COMMAND) == 0) & (block.code >= 0)
    index = np.flatnonzero(plain)
    key = block.letter[index].astype(np.int64) * 10_000_000 + block.code[index]
    values, first, inverse, counts = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    for which, value in enumerate(values.tolist()):
        name = (chr(value // 10_000_000), value % 10_000_000)
        count[name] += int(counts[which])
        first_line.setdefault(name, int(block.line[index[first[which]]]))
    kept = np.array(
        [(chr(v // 10_000_000), v % 10_000_000) in KEPT or v // 10_000_000 == ord("T") for v in values.tolist()], bool
    )
    if not kept.any():
        return
    for i in index[kept[inverse]].tolist():
        span = slice(int(block.word_start[i]), int(block.word_start[i + 1]))
        words = tuple(
            (chr(letter), value)
            for letter, value in zip(block.word_letter[span].tolist(), block.word_value[span].tolist(), strict=True)
        )
        commands.append(Command(int(block.line[i]), int(rows[i]), chr(int(block.letter[i])), int(block.code[i]), words))


def _named(block: Block, rows: IntArray, names: frozenset[str]) -> Iterator[Command]:
    """Commands of the block that have one of these names, with their words NAME=number."""
    for line, text in block.named:
        name, *words = text.decode("utf-8", "replace").upper().split()
        if name in names:
            row = int(rows[np.searchsorted(block.line, line)])
            yield Command(line, row, name, -1, tuple(_values(words)))


def _values(words: list[str]) -> Iterator[tuple[str, float]]:
    for word in words:
        key, equals, value = word.partition("=")
        try:
            yield key, float(value) if equals else math.nan
        except ValueError:
            yield key, math.nan


def code_name(letter: str, code: int) -> str:
    """('G', 434) as G43.4."""
    if code < 0:
        return letter
    whole, tenth = divmod(code, 10)
    return f"{letter}{whole}.{tenth}" if tenth else f"{letter}{whole}"
