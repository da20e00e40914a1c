"""Seconds become feed words: in the firmware's own length of the rounded words, so that rounding cannot change time.

With G94, F = 60 * metric / seconds (units a minute); with G93, F = 60 / seconds (one over minutes).
"""

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import GcodeError
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.moves import Moves
from trunnion_gcode.words import significant

FEED_SLACK = 5e-4
"""Relative. F is not written again while the last one is this close: with its four digits, F is true within 0.1 %."""

MOST_INVERSE = 1e6
"""Greatest F under G93: a move of 0.06 ms. Larger numbers are mistakes to most readers, and no drive can tell."""


def feed_words(moves: Moves, dialect: Dialect) -> list[str]:
    """(m,) `F...` where F must be written, empty where the last one holds. GcodeError where a move takes no time."""
    return _words(moves.row, moves.metric, moves.asked, dialect)[0]


def speeds_read(moves: Moves, asked: FloatArray, dialect: Dialect) -> FloatArray:
    """(m,) speed along the metric in units/s that the firmware reads where moves shall take `asked` (m,) s."""
    return _words(moves.row, moves.metric, asked, dialect)[1]


def _words(row: IntArray, metric: FloatArray, asked: FloatArray, dialect: Dialect) -> tuple[list[str], FloatArray]:
    if not len(row):
        return [], np.zeros(0)
    measured = metric > 0
    timeless = np.flatnonzero(measured & ~(asked > 0))
    if timeless.size:
        first = timeless[0]
        raise GcodeError(f"row {int(row[first])}: moves {metric[first]:g} in no time, should take some")
    if dialect.inverse_time:
        text, read = significant("F", np.minimum(60.0 / np.where(asked > 0, asked, 1.0), MOST_INVERSE))
        return [f"F{word}" for word in text], metric * read / 60.0
    wanted = np.where(measured, 60.0 * metric / np.where(measured, asked, 1.0), 1.0)
    text, read = significant("F", wanted)
    said, held = _only_changes(text, wanted.tolist(), read.tolist(), measured.tolist())
    return said, np.where(measured, held, 0.0) / 60.0


def slowest(moves: Moves) -> float:
    """The lowest speed along the metric that the moves ask for, in units a second; inf without moves."""
    measured = moves.metric > 0
    return float(np.min(moves.metric[measured] / moves.asked[measured], initial=np.inf))


def _only_changes(
    text: list[str], wanted: list[float], read_back: list[float], measured: list[bool]
) -> tuple[list[str], FloatArray]:
    """F where it must be written, and the F in force. One pass, since writing depends on the F written last."""
    out = []
    held = []
    modal = 0.0
    for word, value, back, moves in zip(text, wanted, read_back, measured, strict=True):
        if not moves or abs(value - modal) <= FEED_SLACK * value:
            out.append("")
        else:
            modal = back
            out.append(f"F{word}")
        held.append(modal)
    return out, np.array(held)
