"""No body of the machine enters another, the bed, the clamps or what is printed at that moment."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.findings import Finding
from trunnion_sim.context import Context

CODES = {
    "collision": (
        "error",
        "A body of the machine enters the bed, a clamp, another body or the part as far as it is printed.",
    ),
}

MOST = 40
"""Findings that are listed; the last one counts the rest."""


def check(context: Context) -> Iterator[Finding]:
    """A finding for every run of rows in which one body enters one other, at its deepest place."""
    hits, names = context.hits, context.scene.names
    runs = []
    pairs = np.unique(np.column_stack([hits.body, hits.other]), axis=0)
    for body, other in pairs.tolist():
        mine = np.flatnonzero((hits.body == body) & (hits.other == other))
        ends = np.flatnonzero(np.diff(hits.rows[mine]) > 1) + 1
        runs += [(f"{names[body]} enters {names[other]}", run) for run in np.split(mine, ends)]
    runs.sort(key=lambda run: int(hits.rows[run[1][0]]))
    for number, (what, run) in enumerate(runs[:MOST]):
        deepest = int(run[hits.depth[run].argmax()])
        row, depth = int(hits.rows[deepest]), float(hits.depth[deepest])
        x, y, z = hits.points[deepest].tolist()
        count = len(run)
        if number == MOST - 1:
            count += sum(len(other) for _, other in runs[MOST:])
        yield Finding(
            code="collision",
            severity="error",
            message=f"{what} at ({x:.2f}, {y:.2f}, {z:.2f}) mm by {depth:.2f} mm ({count} rows)",
            line=int(context.motion.line[row]),
            row=row,
            layer=context.layer(row),
            value=-depth,
            limit=0.0,
            point=(x, y, z),
            count=count,
        )
