"""Columns of numbers become words of G-code: the one place of the project where a float turns into text.

A number is first rounded to whole *ticks* of its last decimal. Everything that depends on what the firmware will
read (feed, changes, carried remainders) is computed from ticks, so text and arithmetic cannot disagree.
"""

from collections.abc import Sequence

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import GcodeError

MAX_MAGNITUDE = 1e9
"""Larger numbers are mistakes in any unit of a printer, and would not survive a firmware's single precision."""


def ticks(name: str, values: FloatArray, decimals: int) -> IntArray:
    """Whole numbers of the last decimal, same shape as `values`. GcodeError names the row that is not finite."""
    usable = np.isfinite(values) & (np.abs(values) < MAX_MAGNITUDE)
    if not usable.all():
        row = int(np.argwhere(~usable)[0][0])
        wrong = np.atleast_1d(values)[row]
        raise GcodeError(f"row {row}: {name} is {wrong}, should be a finite number below {MAX_MAGNITUDE:.0e}")
    return np.rint(np.asarray(values, dtype=np.float64) * 10.0**decimals).astype(np.int64)


def carried_ticks(name: str, values: FloatArray, decimals: int) -> IntArray:
    """Ticks of (n,) relative amounts whose sum stays within half a tick of the true sum at every row.

    What rounding drops in one row is carried to the next: tick i is round(sum to i) - round(sum to i - 1).
    """
    total = ticks(name, np.cumsum(values), decimals)
    return np.diff(total, prepend=0)


def from_ticks(amounts: IntArray, decimals: int) -> FloatArray:
    """The numbers that a reader of the words gets back."""
    return np.asarray(amounts / 10.0**decimals)


def words(letter: str, amounts: IntArray, decimals: int) -> list[str]:
    """One word a tick, such as `X12.3`: fixed point, no exponent, no trailing zeros, no minus before zero."""
    if decimals == 0:
        return [f"{letter}{amount}" for amount in amounts.tolist()]
    template = f"{letter}%.{decimals}f\n" * len(amounts)
    lines = (template % tuple(from_ticks(amounts, decimals).tolist())).split("\n")
    return [line.rstrip("0").rstrip(".") for line in lines[:-1]]


def number(name: str, value: float, decimals: int) -> str:
    """One number as text, by the same rules."""
    return words("", np.atleast_1d(ticks(name, np.array([value]), decimals)), decimals)[0]


def significant(name: str, values: FloatArray, digits: int = 4, most_decimals: int = 5) -> tuple[list[str], FloatArray]:
    """Texts of positive numbers with about `digits` digits, and (n,) what a reader of them gets back.

    The decimals depend on the size only: at least `digits` significant digits, never more than `most_decimals`.
    """
    if values.size and not (np.isfinite(values).all() and values.min() > 0):
        row = int(np.flatnonzero(~(np.isfinite(values) & (values > 0)))[0])
        raise GcodeError(f"row {row}: {name} is {values[row]}, should be a positive number")
    decimals = np.clip(digits - 1 - np.floor(np.log10(values)).astype(np.int64), 0, most_decimals)
    text = [""] * len(values)
    read_back = np.empty(len(values))
    for places in np.unique(decimals).tolist():
        rows = np.flatnonzero(decimals == places)
        amounts = np.maximum(ticks(name, values[rows], places), 1)
        read_back[rows] = from_ticks(amounts, places)
        for row, word in zip(rows.tolist(), words("", amounts, places), strict=True):
            text[row] = word
    return text, read_back


def joined(columns: Sequence[Sequence[str]]) -> list[str]:
    """The words of every row in one line, separated by blanks; empty words leave no trace."""
    return [" ".join(filter(None, row)) for row in zip(*columns, strict=True)]
