"""Turn a toolpath and one joint state a row into the rows of a program: subdivided, with hops where the machine turns.

The toolpath is cut where the joints cannot simply go on: at the start, at rewinds, and at travels on which the machine
would change to its other joint solution, swinging the tool far from the straight turn. Between cuts the rows are
subdivided so that the tip stays on its chords; at a cut a hop leads over the part. At the end the rotaries are level:
firmware that leaves tip control takes the words for joints then, and what is said after it moves where it says.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.findings import Finding
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_kinematics.branches import PathChoice
from trunnion_kinematics.subdivide import Subdivision, subdivide
from trunnion_motion.hop import CLEARANCE, HOME_CLEARANCE, Hop, Machine, hop, leave, same_pose_near, upright
from trunnion_motion.rows import Rows, joined, travelling

SWING_DEG = 10.0
"""Degrees that the tool may stray from the straight turn between the ends of a travel before it is done as a hop."""
PARK_HEIGHT = 10.0
"""mm over the printed part where the program ends, limits allowing."""


@dataclass(frozen=True, eq=False)
class _Assembly:
    toolpath: Toolpath
    machine: Machine
    choice: PathChoice
    settings: PrintSettings
    printed_z: FloatArray
    """(n,) mm: the highest point of any bead before the row; -inf before the first."""


def assemble(
    toolpath: Toolpath, machine: Machine, choice: PathChoice, settings: PrintSettings, home: FloatArray
) -> tuple[Rows, tuple[Finding, ...]]:
    """Rows from `home` (k,) through the toolpath (at least one row) to a last lift, upright; without filament."""
    z = np.where(toolpath.extrudes, toolpath.points[:, 2], -np.inf)
    z[:-1] = np.maximum(z[:-1], np.where(toolpath.extrudes[1:], toolpath.points[:-1, 2], -np.inf))
    printed = np.maximum.accumulate(z)
    work = _Assembly(toolpath, machine, choice, settings, np.concatenate([[-np.inf], printed[:-1]]))

    cuts = np.unique(np.concatenate([[0], choice.rewinds, _swings(work)]).astype(np.int64))
    blocks: list[Rows] = []
    findings: list[Finding] = []
    for first, last in zip(cuts, [*cuts[1:], len(toolpath)], strict=True):
        blocks += _stretch(work, int(first), int(last), home, findings)
    last_layer = int(toolpath.layer[-1])
    top = max(printed[-1], toolpath.points[-1, 2])
    last = choice.joints[-1]
    way = upright(machine, last, top + PARK_HEIGHT)
    parked = leave(machine, last, top + PARK_HEIGHT)[None] if way is None else way.joints
    if (parked != last).any():
        points, axes = machine.chain.forward(parked)
        blocks.append(travelling(parked, points, axes, last_layer, settings.travel_speed))
    if way is None:
        findings.append(_parked_tilted(points=toolpath.points[-1], layer=last_layer))
    return joined(blocks), tuple(findings)


def _stretch(work: _Assembly, first: int, last: int, home: FloatArray, findings: list[Finding]) -> list[Rows]:
    """The hop to row `first` and the subdivided rows up to `last`."""
    toolpath, machine, joints = work.toolpath, work.machine, work.choice.joints
    travels = toolpath.width[first] == 0
    if first == 0:
        start, end = home, joints[0]
        clear_z = max(HOME_CLEARANCE, toolpath.points[0, 2] + CLEARANCE)
    else:
        start = joints[first - 1]
        end = joints[first] if travels else same_pose_near(machine, start, joints[first])
        clear_z = max(work.printed_z[first], toolpath.points[first, 2], toolpath.points[first - 1, 2]) + CLEARANCE
    way = hop(machine, start, end, float(clear_z))
    findings += _said(work, first, way, travels)
    layer = int(toolpath.layer[first])
    lead = travelling(way.joints, way.points, way.tool_axes, layer, work.settings.travel_speed)
    if travels:
        lead.source[-1] = first
        lead.points[-1], lead.tool_axes[-1] = toolpath.points[first], work.choice.tool_axes[first]
    rows = slice(first, last)
    points, axes, states = toolpath.points[rows], work.choice.tool_axes[rows], joints[rows]
    offset = first
    if not travels:
        points = np.concatenate([toolpath.points[first - 1][None], points])
        axes = np.concatenate([work.choice.tool_axes[first - 1][None], axes])
        states = np.concatenate([end[None], states])
        offset = first - 1
    fine = subdivide(machine.chain, points, axes, states, work.settings.chord_tolerance)
    return [lead, _of_toolpath(toolpath, fine, offset)]


def _of_toolpath(toolpath: Toolpath, fine: Subdivision, offset: int) -> Rows:
    """A subdivision of the toolpath's rows from `offset` on, without its first state."""
    source = fine.source[1:] + offset
    return Rows(
        fine.joints[1:],
        fine.points[1:],
        fine.tool_axes[1:],
        source,
        toolpath.role[source],
        toolpath.layer[source],
        toolpath.width[source],
        toolpath.height[source],
        toolpath.speed[source],
        np.zeros(len(source)),
    )


def _swings(work: _Assembly) -> IntArray:
    """Travel rows on which the tool would stray by more than SWING_DEG from the straight turn."""
    joints, axes = work.choice.joints, work.choice.tool_axes
    rows = np.flatnonzero(work.toolpath.role[1:] == Role.TRAVEL) + 1
    if not work.machine.profile.rotary or not rows.size:
        return np.empty(0, dtype=np.int64)
    _, middle = work.machine.chain.forward(0.5 * (joints[rows] + joints[rows - 1]))
    straight = axes[rows] + axes[rows - 1]
    size = np.linalg.norm(straight, axis=1)
    cosine = np.einsum("ij,ij->i", middle, straight) / np.maximum(size, 1e-12)
    return np.asarray(rows[(cosine < np.cos(np.radians(SWING_DEG))) | (size < 1e-12)])


def _parked_tilted(points: FloatArray, layer: int) -> Finding:
    x, y, z = (float(value) for value in points)
    return Finding(
        "parked-tilted",
        "warning",
        "the program ends with the rotary joints turned: the machine's limits leave no way to level them clear of the "
        "part",
        layer=layer,
        point=(x, y, z),
    )


def _said(work: _Assembly, row: int, way: Hop, travels: bool) -> list[Finding]:
    x, y, z = (float(value) for value in work.toolpath.points[row])
    layer = int(work.toolpath.layer[row])
    found = []
    if not travels:
        found.append(
            Finding(
                "rewind-while-printing",
                "warning",
                f"row {row} of layer {layer}: a rotary joint runs out of travel inside a bead; the bead is interrupted "
                "for a rewind",
                row=row,
                layer=layer,
                point=(x, y, z),
            )
        )
    if not way.clear:
        found.append(
            Finding(
                "turn-near-part",
                "warning",
                f"row {row} of layer {layer}: the machine turns on its way here and its limits leave no room to do "
                "so clear of part and bed",
                row=row,
                layer=layer,
                point=(x, y, z),
            )
        )
    return found
