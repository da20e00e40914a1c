"""No joint accelerates or jumps at a corner harder than it is rated for."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.findings import Finding
from trunnion_core.profile import Joint
from trunnion_sim.context import Context

CODES = {
    "joint-acceleration": (
        "error",
        "Limits raised by the program (M201, M204) let a joint accelerate harder than it is rated for.",
    ),
    "corner-raised": (
        "warning",
        "Limits raised by the program (M205, M566) let joints jump at corners by more than they are rated for.",
    ),
}

SLACK = 0.01
"""Relative."""


def check(context: Context) -> Iterator[Finding]:
    """Acceleration inside moves as replayed, and the corner speeds that the program sets.

    Only where the program has raised a joint's limit: the firmware keeps to its limits by itself, and what the replay
    calls a row's acceleration is that of the move which the firmware makes of it and its neighbours.
    """
    replay, profile = context.replay, context.profile
    length = np.where(replay.length > 0, replay.length, np.inf)
    changes = (replay.cruise > replay.entry + 1e-9) | (replay.cruise > replay.exit + 1e-9)
    for k, joint in enumerate(profile.joints):
        hard = context.surely_moved(k) / length * replay.acceleration
        raised = context.limits.acceleration[:, k] > joint.shown(joint.acceleration) * (1 + SLACK)
        over = (hard > joint.acceleration * (1 + SLACK)) & raised[context.limits.which] & changes & ~context.homing
        yield from context.find(
            "joint-acceleration",
            "error",
            over,
            partial(_hard, joint, hard),
            value=hard,
            limit=joint.acceleration,
            joint=joint,
        )
    corner = profile.array("corner_speed") * profile.to_shown * (1 + SLACK)
    raised = np.asarray((context.limits.corner[:, :-1] > corner).any(axis=1))[context.limits.which]
    yield from context.find(
        "corner-raised",
        "warning",
        raised & context.moved & ~context.homing,
        lambda row: "the program works with higher corner speeds (M205, M566) than the machine is rated for",
    )


def _hard(joint: Joint, hard: FloatArray, row: int) -> str:
    return (
        f"{joint.letter} accelerates with {joint.shown(hard[row]):.4g} {joint.unit}/s², "
        f"it is rated for {joint.shown(joint.acceleration):g}"
    )
