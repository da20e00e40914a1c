"""No joint is asked to move faster than it can."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.findings import Finding
from trunnion_core.profile import Joint
from trunnion_sim.context import Context

CODES = {
    "joint-speed": (
        "error",
        "F asks a joint for more than its rated speed while printing or turning, or limits raised by the program let "
        "it exceed the rating.",
    ),
    "joint-speed-clamped": (
        "warning",
        "F asks a linear joint for more than its rated speed on a travel; the firmware slows the move down.",
    ),
}

SPEED_SLACK = 0.01
"""Relative: F and the words that it is measured over are rounded."""


def check(context: Context) -> Iterator[Finding]:
    """Speed of every joint as F asks for it, and as the firmware would drive it.

    Where the linear joints move less than the firmware takes for motion, F is about the rotaries or the filament and
    asks nothing of them.
    """
    replay = context.replay
    length = np.where(replay.length > 0, replay.length, np.inf)
    counts = ~context.homing & ~context.joined
    still = context.linear_way <= context.rules.shortest_linear
    for k, joint in enumerate(context.profile.joints):
        asked = np.abs(np.diff(context.motion.path[:, k])) / length * replay.asked
        driven = context.surely_moved(k) / length * replay.cruise
        limit = joint.speed * (1 + SPEED_SLACK)
        over = (asked > limit) & counts
        if not joint.rotary:
            over &= ~still
        serious = (over & (context.feeds | joint.rotary)) | ((driven > limit) & counts)
        message = partial(_message, joint, asked)
        yield from context.find("joint-speed", "error", serious, message, value=asked, limit=joint.speed, joint=joint)
        yield from context.find(
            "joint-speed-clamped",
            "warning",
            over & ~serious,
            message,
            value=asked,
            limit=joint.speed,
            joint=joint,
            together=True,
        )


def _message(joint: Joint, asked: FloatArray, row: int) -> str:
    return (
        f"{joint.letter} is asked for {joint.shown(asked[row]):.4g} {joint.unit}/s, "
        f"it is rated for {joint.shown(joint.speed):g}"
    )
