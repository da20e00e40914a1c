"""A profile as arrays for the compiled sweep: the joint chain, every body, which bodies can touch which."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.profile_file import BED
from trunnion_core.solid_tables import BoxTable, CylinderTable, SolidTable
from trunnion_sim.collision.field import PRESS
from trunnion_sim.collision.place import Bodies, Chain
from trunnion_sim.collision.solids import ball_of, rows_of

PART = "the part"
"""What findings call everything that is printed so far."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything of a machine that can touch something else."""

    chain: Chain
    bodies: Bodies
    """The last is a box around what is printed, which stands for `PART`."""
    names: tuple[str, ...]
    """(b,)."""
    pairs: IntArray
    """(p, 2) bodies that move against each other and are not meant to touch."""
    low: FloatArray
    """(2,) mm in `part`: corner of what the bed, or anything printed on it, covers."""
    high: FloatArray

    @property
    def part(self) -> int:
        """The body that stands for what is printed."""
        return len(self.names) - 1


def make_scene(profile: MachineProfile) -> Scene:
    """The arrays of a machine."""
    chain = Chain(
        work_side=np.array([joint.side == "work" for joint in profile.joints]),
        rotary=np.array([joint.rotary for joint in profile.joints]),
        axes=np.stack([joint.axis for joint in profile.joints]),
        pivots=np.stack([joint.point for joint in profile.joints]),
        origin=profile.origin,
    )
    tool_turn, upright = _tool_frame(profile.tool_axis), np.eye(3)
    work = chain.work_side
    bed = _plate(profile, 0.0)
    entries = [(solid, tool_turn, profile.tip, ~work) for solid in profile.tool_bodies]
    entries += [(body.solid, upright, np.zeros(3), _carriers(profile, body.carried_by)) for body in profile.bodies]
    entries += [(solid, upright, profile.origin, work) for solid in profile.work_bodies]
    # the nozzle may press on the plate as it may on plastic: for it the plate lies lower by as much
    entries += [(bed, upright, profile.origin, work), (_plate(profile, PRESS), upright, profile.origin, work)]
    part = BoxTable.model_construct(shape="box", name=PART, min=(0.0, 0.0, 0.0), max=(0.0, 0.0, 0.0))
    entries.append((part, upright, profile.origin, work))
    rows, corners, faces = rows_of([entry[0] for entry in entries])
    balls = [ball_of(row, corners) for row in rows]
    bodies = Bodies(
        rows=rows,
        corners=corners,
        faces=faces,
        middles=np.array([ball[0] for ball in balls]),
        radii=np.array([ball[1] for ball in balls]),
        turns=np.array([entry[1] for entry in entries]),
        places=np.array([entry[2] for entry in entries]),
        carried=np.array([entry[3] for entry in entries]),
        tool=np.arange(len(entries)) < len(profile.tool_bodies),
    )
    names = tuple(entry[0].name for entry in entries)
    chosen = np.array(list(_pairs(profile, bodies, names)), dtype=np.int64).reshape(-1, 2)
    low, high = _extent(bed)
    return Scene(chain, bodies, names, chosen, low, high)


def _pairs(profile: MachineProfile, bodies: Bodies, names: tuple[str, ...]) -> Iterator[tuple[int, int]]:
    """Pairs of bodies that some joint moves against each other, but for those that touch by design."""
    excused = {frozenset((body.solid.name, name)) for body in profile.bodies for name in body.touches}
    plate, lowered = len(names) - 3, len(names) - 2
    presses = bodies.tool & (np.array([_bottom(row, bodies.corners) for row in bodies.rows]) < PRESS)
    for first in range(len(names)):
        for second in range(first + 1, len(names)):
            moves = (bodies.carried[first] != bodies.carried[second]).any()
            other_plate = second == (plate if presses[first] else lowered)
            if moves and not other_plate and frozenset((names[first], names[second])) not in excused:
                yield first, second


def _bottom(row: FloatArray, corners: FloatArray) -> float:
    """mm: the lowest point of a solid in its own frame."""
    if row[0] == 2.0:
        return float(corners[int(row[1]) : int(row[2]), 2].min())
    return float(row[3])


def _carriers(profile: MachineProfile, carried_by: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(k,) which joints carry what the joint of that letter carries: those of its side, up to itself."""
    letters = [joint.letter for joint in profile.joints]
    if carried_by not in letters:
        return np.zeros(len(letters), np.bool_)
    last = letters.index(carried_by)
    side = profile.joints[last].side
    return np.array([joint.side == side and k <= last for k, joint in enumerate(profile.joints)])


def _tool_frame(axis: FloatArray) -> FloatArray:
    """(3, 3) columns X, Y, Z of the tool frame: Z along the tool axis, X as near to the machine's X as can be."""
    guess = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = guess - guess @ axis * axis
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _plate(profile: MachineProfile, lower: float) -> BoxTable | CylinderTable:
    """The bed as a solid in `part`, `lower` mm below its place."""
    bed = profile.bed
    bottom = -bed.thickness - lower
    if bed.min is not None and bed.max is not None:
        return BoxTable(shape="box", name=BED, min=(*bed.min, bottom), max=(*bed.max, -lower))
    assert bed.diameter is not None
    return CylinderTable(shape="cylinder", name=BED, bottom=bottom, top=-lower, diameter=bed.diameter)


def _extent(bed: SolidTable) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner (2,) mm of the bed seen from above."""
    if isinstance(bed, BoxTable):
        return np.array(bed.min[:2]), np.array(bed.max[:2])
    assert isinstance(bed, CylinderTable)
    return np.full(2, -bed.diameter / 2), np.full(2, bed.diameter / 2)
