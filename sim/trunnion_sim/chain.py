"""The joint chain multiplied out: joint values become the tip and the direction of the tool over the part.

Each joint is a 4x4 matrix, each side of the machine the product of its joints from the frame outwards, and the part
sees the nozzle through the inverse of its own side (product of exponentials; Murray, Li, Sastry 1994, chapter 3).
"""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import Joint, MachineProfile

ROWS_AT_ONCE = 1 << 15
"""Rows whose matrices are held in memory together."""


def forward(profile: MachineProfile, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tip (n, 3) mm and tool axis (n, 3) unit in `part`, for joints (n, k) mm or rad in profile order."""
    if not profile.rotary:
        # every joint only shifts: one matrix, and the tool never leans
        tip, axis = _forward(profile, np.zeros((1, joints.shape[1])))
        ways = np.stack([joint.axis * (1 if joint.side == "tool" else -1) for joint in profile.joints])
        return tip + joints @ ways, np.broadcast_to(axis[0], (len(joints), 3))
    points = np.empty((len(joints), 3))
    tool_axes = np.empty((len(joints), 3))
    for begin in range(0, len(joints), ROWS_AT_ONCE):
        rows = slice(begin, begin + ROWS_AT_ONCE)
        points[rows], tool_axes[rows] = _forward(profile, joints[rows])
    return points, tool_axes


def side_matrices(profile: MachineProfile, joints: FloatArray, side: str) -> FloatArray:
    """(n, 4, 4) machine frame from the frame that one side carries, equal at joints zero."""
    product = np.broadcast_to(np.eye(4), (len(joints), 4, 4))
    for column, joint in enumerate(profile.joints):
        if joint.side == side:
            product = product @ joint_matrices(joint, joints[:, column])
    return product


def joint_matrices(joint: Joint, values: FloatArray) -> FloatArray:
    """(n, 4, 4) motion of one joint: a translation along its axis, or a rotation about its line (Rodrigues)."""
    matrices = np.tile(np.eye(4), (len(values), 1, 1))
    if not joint.rotary:
        matrices[:, :3, 3] = values[:, None] * joint.axis
        return matrices
    x, y, z = joint.axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, versine = np.sin(values)[:, None, None], (1 - np.cos(values))[:, None, None]
    turn = np.eye(3) + sine * cross + versine * (cross @ cross)
    matrices[:, :3, :3] = turn
    matrices[:, :3, 3] = joint.point - turn @ joint.point
    return matrices


def _forward(profile: MachineProfile, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    machine_from_tool = side_matrices(profile, joints, "tool")
    machine_from_work = side_matrices(profile, joints, "work")
    tip = (machine_from_tool @ np.append(profile.tip, 1.0))[:, :3]
    axis = machine_from_tool[:, :3, :3] @ profile.tool_axis
    work_from_machine = machine_from_work[:, :3, :3].transpose(0, 2, 1)
    from_origin = (work_from_machine @ (tip - machine_from_work[:, :3, 3])[:, :, None])[:, :, 0] - profile.origin
    turned = (work_from_machine @ axis[:, :, None])[:, :, 0]
    return from_origin, turned / np.linalg.norm(turned, axis=1, keepdims=True)
