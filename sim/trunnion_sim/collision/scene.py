"""A profile as arrays for the compiled sweep: the joint chain, the bodies that move, the bed and what stands on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.solid_tables import BoxTable
from trunnion_sim.collision.solids import middle_of, radius_of, row_of

CELL = 0.25
"""mm between samples of what stands on the bed: finer than a bead is wide, so that no bead falls between two."""
BLOCK = 8
"""Cells along the side of a block, and blocks along the side of a tile, whose highest point prunes the search."""
UNDER = -1e9
"""Height in mm where nothing is: beyond the edge of the bed."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything of a machine that can touch something else."""

    work_side: NDArray[np.bool_]
    """(k,) which joints carry the part."""
    rotary: NDArray[np.bool_]
    """(k,)."""
    axes: FloatArray
    """(k, 3) unit."""
    pivots: FloatArray
    """(k, 3) mm."""
    origin: FloatArray
    """(3,) mm."""
    bodies: FloatArray
    """(b, 8) rows of `solids`."""
    middles: FloatArray
    """(b, 3) mm in the body's frame."""
    radii: FloatArray
    """(b,) mm about the middle."""
    turns: FloatArray
    """(b, 3, 3) machine from body, all joints at zero."""
    places: FloatArray
    """(b, 3) mm: origin of the body's frame in the machine, all joints at zero."""
    carried: IntArray
    """(b,) how many joints of the tool side, from the frame outwards, carry the body."""
    nozzle: NDArray[np.bool_]
    """(b,) bodies in the tool frame, whose tip touches the bead being laid."""
    names: tuple[str, ...]
    corner: FloatArray
    """(2,) mm in `part`: centre of the first cell."""
    ground: NDArray[np.float32]
    """(nx, ny) mm in `part`: top of bed and clamps; UNDER beyond the edge."""
    floor: float
    """mm in `part`: underside of the bed."""


def make_scene(profile: MachineProfile) -> Scene:
    """The arrays of a machine."""
    tool_turn = _tool_frame(profile.tool_axis)
    carriers = ["frame", *(joint.letter for joint in profile.joints if joint.side == "tool")]
    tool, others = profile.tool_bodies, profile.bodies
    rows = [row_of(solid) for solid in (*tool, *(body.solid for body in others))]
    corner, ground = _ground(profile)
    return Scene(
        work_side=np.array([joint.side == "work" for joint in profile.joints]),
        rotary=np.array([joint.rotary for joint in profile.joints]),
        axes=np.stack([joint.axis for joint in profile.joints]),
        pivots=np.stack([joint.point for joint in profile.joints]),
        origin=profile.origin,
        bodies=np.array(rows).reshape(len(rows), 8),
        middles=np.array([middle_of(row) for row in rows]).reshape(len(rows), 3),
        radii=np.array([radius_of(row) for row in rows]),
        turns=np.array([tool_turn] * len(tool) + [np.eye(3)] * len(others)).reshape(len(rows), 3, 3),
        places=np.array([profile.tip] * len(tool) + [np.zeros(3)] * len(others)).reshape(len(rows), 3),
        carried=np.array(
            [len(carriers) - 1] * len(tool) + [carriers.index(body.carried_by) for body in others], dtype=np.int64
        ),
        nozzle=np.array([True] * len(tool) + [False] * len(others), dtype=np.bool_),
        names=(*(solid.name for solid in tool), *(body.solid.name for body in others)),
        corner=corner,
        ground=ground,
        floor=-profile.bed.thickness,
    )


def _tool_frame(axis: FloatArray) -> FloatArray:
    """(3, 3) columns X, Y, Z of the tool frame: Z along the tool axis, X as near to the machine's X as can be."""
    guess = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = guess - guess @ axis * axis
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _ground(profile: MachineProfile) -> tuple[FloatArray, NDArray[np.float32]]:
    """Corner and heights of the empty bed, clamps included, padded to whole tiles."""
    bed = profile.bed
    if bed.shape == "circle" and bed.diameter is not None:
        low, high = np.full(2, -bed.diameter / 2), np.full(2, bed.diameter / 2)
    else:
        low, high = np.array(bed.min, dtype=float), np.array(bed.max, dtype=float)
    for solid in profile.work_bodies:
        row = row_of(solid)
        middle, radius = middle_of(row)[:2], radius_of(row)
        low, high = np.minimum(low, middle - radius), np.maximum(high, middle + radius)
    tile = BLOCK * BLOCK
    nx, ny = (int(np.ceil(span / CELL / tile)) * tile for span in high - low)
    x = low[0] + (np.arange(nx) + 0.5) * CELL
    y = low[1] + (np.arange(ny) + 0.5) * CELL
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    ground = np.full((nx, ny), UNDER, dtype=np.float32)
    if bed.shape == "circle" and bed.diameter is not None:
        ground[grid_x**2 + grid_y**2 <= (bed.diameter / 2) ** 2] = 0.0
    elif bed.min is not None and bed.max is not None:
        on = (grid_x >= bed.min[0]) & (grid_x <= bed.max[0]) & (grid_y >= bed.min[1]) & (grid_y <= bed.max[1])
        ground[on] = 0.0
    for solid in profile.work_bodies:
        if isinstance(solid, BoxTable):
            inside = (grid_x >= solid.min[0]) & (grid_x <= solid.max[0])
            inside &= (grid_y >= solid.min[1]) & (grid_y <= solid.max[1])
            top = solid.max[2]
        else:
            row = row_of(solid)
            inside = (grid_x - row[1]) ** 2 + (grid_y - row[2]) ** 2 <= max(row[5], row[6]) ** 2
            top = solid.top
        ground[inside] = np.maximum(ground[inside], top)
    return np.array([x[0], y[0]]), ground
