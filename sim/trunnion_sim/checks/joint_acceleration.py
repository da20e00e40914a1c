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
    "corner-jump": (
        "warning",
        "The speed of a joint jumps at a corner by more than its corner speed allows.",
    ),
}

SLACK = 0.01
"""Relative."""


def check(context: Context) -> Iterator[Finding]:
    """Acceleration inside moves and jumps between them, as replayed."""
    replay, profile = context.replay, context.profile
    length = np.where(replay.length > 0, replay.length, np.inf)[:, None]
    ratio = (context.motion.joints - context.motion.before) / length
    changes = (replay.cruise > replay.entry + 1e-9) | (replay.cruise > replay.exit + 1e-9)
    for k, joint in enumerate(profile.joints):
        hard = np.abs(ratio[:, k]) * replay.acceleration
        over = (hard > joint.acceleration * (1 + SLACK)) & changes & ~context.homing
        yield from context.find(
            "joint-acceleration",
            "error",
            over,
            partial(_hard, joint, hard),
            value=hard,
            limit=joint.acceleration,
            joint=joint,
        )
        if profile.planner.junction_deviation is not None:
            continue
        moving = np.flatnonzero(replay.length > 0)
        jump = np.zeros(len(ratio))
        leave = ratio[moving, k] * replay.exit[moving]
        enter = ratio[moving, k] * replay.entry[moving]
        jump[moving[1:]] = np.abs(enter[1:] - leave[:-1])
        # a reversal counts by its larger side, so the jump may be twice the corner speed
        limit = 2 * joint.corner_speed * (1 + SLACK) + 1e-9
        jumps = (jump > limit) & ~context.homing
        yield from context.find(
            "corner-jump",
            "warning",
            jumps,
            partial(_jump, joint, jump),
            value=jump,
            limit=2 * joint.corner_speed,
            joint=joint,
        )


def _hard(joint: Joint, hard: FloatArray, row: int) -> str:
    return (
        f"{joint.letter} accelerates with {joint.shown(hard[row]):.4g} {joint.unit}/s², "
        f"it is rated for {joint.shown(joint.acceleration):g}"
    )


def _jump(joint: Joint, jump: FloatArray, row: int) -> str:
    return (
        f"{joint.letter} jumps by {joint.shown(jump[row]):.4g} {joint.unit}/s at a corner, "
        f"its corner speed is {joint.shown(joint.corner_speed):g}"
    )
