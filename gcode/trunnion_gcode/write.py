"""A machine program becomes a G-code file in the dialect of its firmware.

Words are rounded first; the moves, the feed and the carried filament are computed from what the firmware will read.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from trunnion_core.errors import GcodeError
from trunnion_core.output import whole_file
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_core.settings import PrintSettings
from trunnion_gcode import header
from trunnion_gcode.advance import advance_lines
from trunnion_gcode.comments import comments_by_move
from trunnion_gcode.dialect import Dialect, find_dialect
from trunnion_gcode.events import command, commands_by_row, heating
from trunnion_gcode.feed import feed_words, slowest
from trunnion_gcode.moves import Moves, joint_decimals, make_moves
from trunnion_gcode.template import filled, placeholders
from trunnion_gcode.words import joined, number, words


@dataclass(frozen=True)
class WriteSummary:
    """What was written: all lines of the file, planned seconds, mm of filament fed on balance."""

    lines: int
    time_s: float
    filament_mm: float


def write_program(
    program: MachineProgram,
    profile: MachineProfile,
    settings: PrintSettings,
    *,
    title: str,
    out: Path | TextIO,
    placement: tuple[float, float, float] = (0.0, 0.0, 0.0),
    digest: str | None = None,
    layer_z: Mapping[int, float] | None = None,
) -> WriteSummary:
    """Write the whole program; a file appears whole or not at all.

    placement is mm that the slicer added to the model's coordinates. layer_z: mm of a layer's highest point in `part`,
    by layer; without it layers are nominal. The machine must stand at `program.start` when the profile's start code is
    through. Raises GcodeError (a number that cannot be written, an unknown placeholder, a line that is too long,
    pressure advance that the firmware would leave out) and ProfileError (no such dialect).
    """
    dialect = find_dialect(profile.firmware, profile.file)
    lines = program_lines(
        program, profile, settings, dialect, title=title, placement=placement, digest=digest, layer_z=layer_z
    )
    with _whole(out) as file:
        file.write("\n".join(lines))
        file.write("\n")
    return WriteSummary(len(lines), float(program.duration.sum()), float(program.filament.sum()))


def program_lines(
    program: MachineProgram,
    profile: MachineProfile,
    settings: PrintSettings,
    dialect: Dialect,
    *,
    title: str,
    placement: tuple[float, float, float] = (0.0, 0.0, 0.0),
    digest: str | None = None,
    layer_z: Mapping[int, float] | None = None,
) -> list[str]:
    """Every line of the file, without line ends."""
    if dialect.extruder in profile.letters:
        raise GcodeError(f"{profile.file}: joint {dialect.extruder} has the letter of {dialect.name}'s filament")
    moves = make_moves(program, profile, dialect)
    values = placeholders(profile, settings)
    layers = int(program.layer.max()) + 1 if len(program) else 0
    heat = [(event.kind.startswith("wait"), command(event, dialect)) for event in heating(settings)]
    lines = [
        *header.head(title, profile, settings, placement, layers, digest),
        *header.totals(float(program.duration.sum()), float(program.filament.sum())),
        *dialect.setup(profile),
        *dialect.start,
        *_permission_for_slow_moves(moves, dialect),
        *(text for waits, text in heat if not waits),
        *filled(profile.gcode.start, f"{profile.file}: gcode.start", values),
        *(text for waits, text in heat if waits),
        *advance_lines(program.advance, moves, profile, dialect),
        *dialect.enter,
        *_body(program, moves, profile, settings, dialect, layer_z),
        *dialect.leave,
        *filled(profile.gcode.end, f"{profile.file}: gcode.end", values),
        *dialect.finish,
        *header.tail(settings, profile),
    ]
    _check_lengths(lines, dialect)
    return lines


def _body(
    program: MachineProgram,
    moves: Moves,
    profile: MachineProfile,
    settings: PrintSettings,
    dialect: Dialect,
    layer_z: Mapping[int, float] | None,
) -> list[str]:
    """The moves with their comments and events between them."""
    moving = _move_lines(moves, profile, dialect)
    before = comments_by_move(program, moves, settings, dialect, layer_z)
    for row, commands in commands_by_row(program, settings, dialect).items():
        move = int(np.searchsorted(moves.row, row))
        before[move] = [*before.get(move, ()), *commands]
    lines: list[str] = []
    done = 0
    for move in sorted(before):
        lines += filter(None, moving[done:move])
        lines += before[move]
        done = move
    lines += filter(None, moving[done:])
    if dialect.progress is not None and moving:
        lines.append(dialect.progress % (100, 0))
    return lines


def _move_lines(moves: Moves, profile: MachineProfile, dialect: Dialect) -> list[str]:
    """One line a move, empty where none of its words changes; the first move says every joint."""
    count = len(moves.row)
    if not count:
        return []
    columns: list[list[str]] = [[dialect.travel if fed == 0 else "G1" for fed in moves.filament_ticks.tolist()]]
    said = np.zeros(count, dtype=bool)
    for k, (joint, decimals) in enumerate(zip(profile.joints, joint_decimals(profile), strict=True)):
        changed = np.diff(moves.joint_ticks[:, k], prepend=moves.joint_ticks[0, k]) != 0
        changed[0] = True
        columns.append(_sparse(joint.letter, moves.joint_ticks[:, k], changed, decimals))
        said |= changed
    feeds = moves.filament_ticks != 0
    amounts = moves.filament_ticks if dialect.relative_extrusion else np.cumsum(moves.filament_ticks)
    columns.append(_sparse(dialect.extruder, amounts, feeds, profile.gcode.decimals_extruder))
    said |= feeds
    columns.append(feed_words(moves, dialect))
    return [line if keep else "" for line, keep in zip(joined(columns), said.tolist(), strict=True)]


def _sparse(
    letter: str, amounts: "np.typing.NDArray[np.int64]", where: "np.typing.NDArray[np.bool_]", decimals: int
) -> list[str]:
    """Words at the rows asked for, empty texts elsewhere."""
    out = [""] * len(amounts)
    rows = np.flatnonzero(where)
    for row, word in zip(rows.tolist(), words(letter, amounts[rows], decimals), strict=True):
        out[row] = word
    return out


def _permission_for_slow_moves(moves: Moves, dialect: Dialect) -> list[str]:
    """Lower the firmware's minimum speed where the program is slower than that, as far as the slowest move needs."""
    if dialect.allow_slower is None or slowest(moves) >= dialect.minimum_speed:
        return []
    return [dialect.allow_slower % number("minimum speed", 60 * slowest(moves) / 2, 4)]


def _check_lengths(lines: list[str], dialect: Dialect) -> None:
    """GcodeError if a line would be too long on the wire, with its number and checksum."""
    around = len(f"N{len(lines)} *255") if dialect.checksums else 0
    room = dialect.max_line - around
    for index, line in enumerate(lines):
        if len(line) > room and len(line.partition(";")[0].rstrip().encode()) > room:
            raise GcodeError(
                f"line {index + 1}: '{line[:40]}...' is {len(line)} bytes, {dialect.name} takes {room} beside the "
                "number and checksum; write fewer decimals (gcode.decimals_... in the profile)"
            )


@contextmanager
def _whole(out: Path | TextIO) -> Iterator[TextIO]:
    """A text to write to. A file takes its place only when all is written."""
    if not isinstance(out, Path):
        yield out
        return
    with whole_file(out) as part, part.open("w", encoding="utf-8", newline="\n") as file:
        yield file
