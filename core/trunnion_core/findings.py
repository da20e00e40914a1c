"""Outcomes that are values, not exceptions: what a repair did, what the judge dislikes."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["note", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """One thing worth saying about one place. Programs compare `code`; `message` is for people.

    `line` counts from 1 in the G-code file, `row` from 0 in the trace or toolpath, `layer` from 0. `axis` is the
    letter of a joint. `value` and `limit` are in the unit that `message` names (degrees for rotaries). `point` is
    in mm in the part frame. What does not apply is None.
    """

    code: str
    severity: Severity
    message: str
    line: int | None = None
    row: int | None = None
    layer: int | None = None
    axis: str | None = None
    value: float | None = None
    limit: float | None = None
    point: tuple[float, float, float] | None = None
    count: int = 1
    """How many rows in a row this finding stands for; the fields are those of the worst."""
