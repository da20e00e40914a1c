"""Seconds become feed words: in the firmware's own length of the rounded words, so that rounding cannot change time.

With G94, F = 60 * metric / seconds (units a minute); with G93, F = 60 / seconds (one over minutes).
"""

import numpy as np
from trunnion_core.errors import GcodeError

from trunnion_gcode.dialect import Dialect
from trunnion_gcode.moves import Moves
from trunnion_gcode.words import significant

FEED_SLACK = 2e-3
"""Relative. F is not written again while the last one is this close: a tenth of what a tip speed may be off."""

MOST_INVERSE = 1e6
"""Greatest F under G93: a move of 0.06 ms. Larger numbers are mistakes to most readers, and no drive can tell."""


def feed_words(moves: Moves, dialect: Dialect) -> list[str]:
    """(m,) `F...` where F must be written, empty where the last one holds. GcodeError where a move takes no time."""
    if not len(moves.row):
        return []
    measured = moves.metric > 0
    timeless = np.flatnonzero(measured & ~(moves.asked > 0))
    if timeless.size:
        row = int(moves.row[timeless[0]])
        raise GcodeError(f"row {row}: moves {moves.metric[timeless[0]]:g} in no time, should take some")
    if dialect.inverse_time:
        text, _ = significant("F", np.minimum(60.0 / np.where(moves.asked > 0, moves.asked, 1.0), MOST_INVERSE))
        return [f"F{word}" for word in text]
    wanted = np.where(measured, 60.0 * moves.metric / np.where(measured, moves.asked, 1.0), 1.0)
    text, read_back = significant("F", wanted)
    return _only_changes(text, wanted.tolist(), read_back.tolist(), measured.tolist())


def slowest(moves: Moves) -> float:
    """The lowest speed along the metric that the moves ask for, in units a second; inf without moves."""
    measured = moves.metric > 0
    return float(np.min(moves.metric[measured] / moves.asked[measured], initial=np.inf))


def _only_changes(text: list[str], wanted: list[float], read_back: list[float], measured: list[bool]) -> list[str]:
    """One pass over the rows, since whether F is written depends on the F written last."""
    out = []
    modal = 0.0
    for word, value, back, moves in zip(text, wanted, read_back, measured, strict=True):
        if not moves or abs(value - modal) <= FEED_SLACK * value:
            out.append("")
        else:
            modal = back
            out.append(f"F{word}")
    return out
