"""No joint leaves its travel, and no rotary winds its cable further than the profile allows."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.findings import Finding
from trunnion_core.profile import Joint
from trunnion_sim.context import Context

CODES = {
    "joint-limit": ("error", "A linear joint is sent outside its travel."),
    "winding-limit": ("error", "A rotary joint is sent past its stop or turns its cable too far."),
}

LIMIT_SLACK = 1e-5
"""mm or rad: what rounding of the words may add; 0.0006 degrees on a rotary."""


def check(context: Context) -> Iterator[Finding]:
    """Compare every row's joints with the limits; homing is the machine's own business."""
    for k, joint in enumerate(context.profile.joints):
        value = context.motion.joints[:, k]
        limit = np.where(value > joint.max, joint.max, joint.min)
        outside = ((value > joint.max + LIMIT_SLACK) | (value < joint.min - LIMIT_SLACK)) & ~context.homing
        code = "winding-limit" if joint.rotary else "joint-limit"
        message = partial(_message, joint, value, limit)
        yield from context.find(code, "error", outside, message, value=value, limit=limit, joint=joint)


def _message(joint: Joint, value: FloatArray, limit: FloatArray, row: int) -> str:
    sent, end = joint.shown(value[row]), joint.shown(limit[row])
    return f"{joint.letter} is sent to {sent:.3f} {joint.unit}, its limit is {end:g}"
