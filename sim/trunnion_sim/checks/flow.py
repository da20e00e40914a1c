"""The plastic fits the bead that was planned, and the hot end can melt it."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.bead import bead_area
from trunnion_core.findings import Finding
from trunnion_sim.context import Context
from trunnion_sim.pressure import phase_shares

CODES = {
    "flow-off": ("warning", "Plastic per way differs from the planned bead's section by more than 15 %."),
    "flow-wrong": ("error", "Plastic per way differs from the planned bead's section by a factor of 1.5 or more."),
    "flow-too-high": ("warning", "More plastic per second than the hot end is rated to melt."),
}

OFF = 0.15
WRONG = 1.5
RATE_SLACK = 0.02
"""Relative, for rounding."""
SMOOTH = 1.0
"""mm: rows shorter than this are judged together with what lies within it, since comments round, rows were merged, and
beside a pole the tip of a row of hundredths of a millimetre may go half as far again as its ends are apart."""
LONG = 5.0
"""mm over which flow that lags behind its drive has to be wrong to be an error: a ramp of speed is shorter."""
LEAST = 0.05
"""mm of tip travel under which the rounding of E says more than the bead."""


def check(context: Context) -> Iterator[Finding]:
    """Section from what leaves the nozzle over tip travel against the comments' width and height; volume over time."""
    volume = context.laid * context.profile.filament_area
    rows = context.feeds & (context.tip_length > LEAST)
    section = np.divide(volume, context.tip_length, out=np.zeros(len(volume)), where=rows)
    width, height = context.rows.width, context.rows.height
    named = rows & np.isfinite(width) & np.isfinite(height) & (width > 0) & (height > 0) & context.rows.bead
    planned = np.where(named, bead_area(np.where(named, width, 1.0), np.where(named, height, 1.0)), 1.0)
    ratio = _ratio(context, named, planned, SMOOTH)
    mean = ratio if context.pressure is None else _ratio(context, named, planned, LONG)
    section = section if context.pressure is None else ratio * planned
    wrong = (mean > WRONG) | (mean < 1 / WRONG)
    off = (np.abs(ratio - 1) > OFF) & ~wrong

    def message(row: int) -> str:
        return (
            f"a bead of {section[row]:.4f} mm² is laid where {width[row]:g} x {height[row]:g} mm "
            f"({planned[row]:.4f} mm²) was planned"
        )

    yield from context.find("flow-wrong", "error", wrong, message, value=section, limit=planned)
    yield from context.find("flow-off", "warning", off, message, value=section, limit=planned)
    per_length = np.divide(volume, context.replay.length, out=np.zeros(len(volume)), where=context.replay.length > 0)
    rate = np.where(rows, per_length * context.replay.cruise, 0.0)
    most = context.profile.extruder.max_flow
    yield from context.find(
        "flow-too-high",
        "warning",
        rate > most * (1 + RATE_SLACK),
        lambda row: f"{rate[row]:.3g} mm³/s, the hot end melts {most:g}",
        value=rate,
        limit=most,
    )


def _ratio(context: Context, named: BoolArray, planned: FloatArray, smooth: float) -> FloatArray:
    """(n,) section laid over section planned, of the `named` rows; 1 elsewhere. What is shorter than `smooth` mm counts
    with what lies around it.

    Where pressure is known it differs within a row, which counts by its worst part: its ramps or what lies between.
    """
    if context.pressure is None:
        parts, way = context.laid[:, None], context.tip_length[:, None]
    else:
        parts, way = context.pressure.phases, phase_shares(context.replay) * context.tip_length[:, None]
    laid = np.where(named[:, None], parts * context.profile.filament_area, 0.0).ravel()
    meant = np.where(named[:, None], planned[:, None] * way, 0.0).ravel()
    length = np.where(named[:, None], way, 0.0).ravel()
    ends = np.cumsum(length)
    short = length < smooth
    laid = np.where(short, _around(laid, ends, smooth), laid)
    meant = np.where(short, _around(meant, ends, smooth), meant)
    counts = (length > 0) & (meant > 0)
    ratio = np.divide(laid, meant, out=np.ones(len(laid)), where=counts).reshape(way.shape)
    worst = np.abs(np.log(np.maximum(ratio, 1e-9))).argmax(axis=1)
    return np.asarray(np.take_along_axis(ratio, worst[:, None], axis=1)[:, 0])


def _around(values: FloatArray, way: FloatArray, smooth: float) -> FloatArray:
    """(n,) sum of values over `smooth` mm of `way` about the middle of each row, of rows at the edge their share."""
    if not len(values):
        return values
    total = np.append(0.0, np.cumsum(values))
    ends = np.append(0.0, way)
    middle = (ends[:-1] + ends[1:]) / 2
    upper = np.interp(middle + smooth / 2, ends, total)
    return np.asarray(upper - np.interp(middle - smooth / 2, ends, total))
