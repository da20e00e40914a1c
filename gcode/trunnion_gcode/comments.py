"""What stands between the moves: layers, roles, widths, wanted speeds, progress.

Spellings are those of PrusaSlicer, which existing viewers read (`;LAYER_CHANGE`, `;Z:`, `;HEIGHT:`, `;TYPE:` and
`;WIDTH:`); `;ROLE:` and `;SPEED:` (wanted speed of the tip over the part, mm/s) are Trunnion's own.
"""

from collections.abc import Mapping

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.program import MachineProgram
from trunnion_core.roles import VIEWER_TYPE, Role
from trunnion_core.settings import PrintSettings
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.moves import Moves
from trunnion_gcode.words import from_ticks, number, ticks, words

DECIMALS = 3


def comments_by_move(
    program: MachineProgram,
    moves: Moves,
    settings: PrintSettings,
    dialect: Dialect,
    layer_z: Mapping[int, float] | None = None,
) -> dict[int, list[str]]:
    """Lines that go before a move (by its place among the moves), each only where its value changes.

    layer_z gives mm of every layer's surface in `part`; without it layers are taken to be as thick as the settings say.
    """
    before: dict[int, list[str]] = {}
    _layers(before, program, moves, settings, layer_z or {})
    role = program.role[moves.row]
    for move in np.flatnonzero(np.diff(role, prepend=-1)).tolist():
        kind = Role(int(role[move]))
        if kind in VIEWER_TYPE:
            before.setdefault(move, []).append(f";TYPE:{VIEWER_TYPE[kind]}")
        before.setdefault(move, []).append(f";ROLE:{kind.text}")
    lays = moves.width > 0
    _changing(before, ";WIDTH:", moves.width, lays)
    _changing(before, ";HEIGHT:", moves.height, lays)
    _changing(before, ";SPEED:", program.tip_speed[moves.row], program.tip_speed[moves.row] > 0)
    if dialect.progress is not None:
        _progress(before, moves, dialect.progress)
    return before


def _layers(
    before: dict[int, list[str]],
    program: MachineProgram,
    moves: Moves,
    settings: PrintSettings,
    layer_z: Mapping[int, float],
) -> None:
    layer = program.layer[moves.row]
    for move in np.flatnonzero(np.diff(layer, prepend=-1)).tolist():
        index = int(layer[move])
        nominal = settings.first_height + index * settings.layer_height
        z = number(f"layer {index} Z", layer_z.get(index, nominal), DECIMALS)
        before.setdefault(move, []).extend([";LAYER_CHANGE", f";Z:{z}"])


def _changing(before: dict[int, list[str]], key: str, values: FloatArray, matters: BoolArray) -> None:
    """A comment where the rounded value differs from the last one said, among the rows where it matters."""
    rows = np.flatnonzero(matters)
    amounts: IntArray = ticks(key, values[rows], DECIMALS)
    changed = np.flatnonzero(np.diff(amounts, prepend=-1))
    for move, text in zip(rows[changed].tolist(), words(key, amounts[changed], DECIMALS), strict=True):
        before.setdefault(move, []).append(text)


def _progress(before: dict[int, list[str]], moves: Moves, template: str) -> None:
    """Progress about every percent of the planned time."""
    done = np.concatenate([[0.0], np.cumsum(moves.seconds)])
    if len(done) < 2 or not done[-1] > 0:
        return
    percent = ticks("percent", np.floor(100 * done[:-1] / done[-1]), 0)
    minutes = ticks("minutes", np.ceil(from_ticks(ticks("seconds", done[-1] - done[:-1], 0), 0) / 60), 0)
    for move in np.flatnonzero(np.diff(percent, prepend=-1)).tolist():
        before.setdefault(move, []).append(template % (percent[move], minutes[move]))
