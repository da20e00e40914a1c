"""The rows of a machine program while it is being put together: joints with the poses that they make."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.roles import Role


@dataclass(frozen=True, eq=False)
class Rows:
    """Row i is the motion that ends in joints[i], where the tip is at points[i] with the tool along tool_axes[i]."""

    joints: FloatArray
    """(n, k) mm or rad."""
    points: FloatArray
    """(n, 3) mm, part."""
    tool_axes: FloatArray
    """(n, 3) unit, part."""
    source: IntArray
    """(n,) row of the toolpath, -1 for what motion inserted."""
    role: IntArray
    layer: IntArray
    width: FloatArray
    height: FloatArray
    tip_speed: FloatArray
    """(n,) mm/s wanted."""
    filament: FloatArray
    """(n,) mm."""

    def __len__(self) -> int:
        return len(self.source)

    def steps(self, start: FloatArray) -> FloatArray:
        """(n, k + 1): what every joint, and last the filament, moves in each row, from `start` (k,)."""
        return np.column_stack([np.diff(self.joints, axis=0, prepend=start[None]), self.filament])

    def tip_lengths(self, start_point: FloatArray) -> FloatArray:
        """(n,) mm that the tip moves over the part in each row, from `start_point` (3,)."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0, prepend=start_point[None]), axis=1))


def joined(blocks: Sequence[Rows]) -> Rows:
    """One after the other."""
    return Rows(*(np.concatenate([getattr(block, name) for block in blocks]) for name in _NAMES))


def inserted(rows: Rows, before: IntArray, blocks: Rows) -> Rows:
    """`rows` with row i of `blocks` put in front of row before[i]; before[i] = len(rows) puts it last."""
    return Rows(*(np.insert(getattr(rows, name), before, getattr(blocks, name), axis=0) for name in _NAMES))


def standing(rows: Rows, at: IntArray, role: Role, filament: float) -> Rows:
    """Rows that stand still where the rows `at` end, feeding `filament` mm."""
    n = len(at)
    still = Rows(*(getattr(rows, name)[at] for name in _NAMES))
    return replace(
        still,
        source=np.full(n, -1),
        role=np.full(n, int(role)),
        width=np.zeros(n),
        height=np.zeros(n),
        filament=np.full(n, filament),
    )


def travelling(joints: FloatArray, points: FloatArray, tool_axes: FloatArray, layer: int, speed: float) -> Rows:
    """Travel rows of motion's own through these poses."""
    n = len(joints)
    zero = np.zeros(n)
    role, layers = np.full(n, int(Role.TRAVEL)), np.full(n, layer)
    return Rows(joints, points, tool_axes, np.full(n, -1), role, layers, zero, zero, np.full(n, speed), zero)


_NAMES = tuple(field.name for field in fields(Rows))
