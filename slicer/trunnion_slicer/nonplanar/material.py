"""A mesh becomes points spread over its skin, bundled by place: what the head must not touch.

The points lie so close that nothing as thick as a bead slips between them. They are bundled in cubes, and cubes in
rooms, each with the ball that holds it, so that a search passes over what is far away.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, freeze
from trunnion_slicer.nonplanar.normals import face_normals

CUBE = 2.0
"""mm, side of a cube."""

ROOM = 8
"""Cubes along the side of a room."""

DOWNWARD = -0.05
"""Faces whose normal points down more than this are under something that is in the way itself."""


@dataclass(frozen=True, eq=False)
class Material:
    """Points on the skin of a part, sorted by cube and room."""

    points: FloatArray
    """(n, 3) mm."""
    face: IntArray
    """(n,) the face each lies on."""
    room_start: IntArray
    """(rooms + 1,) cubes of every room."""
    room_ball: FloatArray
    """(rooms, 4) mm: centre and radius."""
    cube_start: IntArray
    """(cubes + 1,) points of every cube."""
    cube_ball: FloatArray
    """(cubes, 4) mm: centre and radius."""

    def __post_init__(self) -> None:
        freeze(self.points, self.face, self.room_start, self.room_ball, self.cube_start, self.cube_ball)


def spread_points(triangles: FloatArray, spacing: float) -> tuple[FloatArray, IntArray]:
    """Points on triangles (m, 3, 3) at most `spacing` mm apart along rows and between rows, and whose they are.

    Every triangle is cut into rows parallel to its longest edge; its corners are among the points.
    """
    if not len(triangles):
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    edge = np.roll(triangles, -1, axis=1) - triangles
    length = np.linalg.norm(edge, axis=2)
    first = length.argmax(axis=1)
    each = np.arange(len(triangles))
    a, b, apex = (triangles[each, (first + k) % 3] for k in range(3))
    longest = length[each, first]
    height = np.linalg.norm(np.cross(b - a, apex - a), axis=1) / np.maximum(longest, 1e-12)
    rows = np.ceil(height / spacing).astype(np.int64) + 1
    owner = np.repeat(each, rows)
    up = _count_up(rows) / np.maximum(np.repeat(rows - 1, rows), 1)
    columns = np.ceil(longest[owner] * (1 - up) / spacing).astype(np.int64) + 1
    up, owner = np.repeat(up, columns), np.repeat(owner, columns)
    along = _count_up(columns) / np.maximum(np.repeat(columns - 1, columns), 1)
    base = a[owner] + along[:, None] * (b - a)[owner]
    return base + up[:, None] * (apex[owner] - base), owner


def material(vertices: FloatArray, faces: IntArray, spacing: float) -> Material:
    """Points at most `spacing` mm apart on every face that does not look down."""
    normal, _ = face_normals(vertices, faces)
    rows = np.flatnonzero(normal[:, 2] > DOWNWARD)
    points, owner = spread_points(vertices[faces[rows]], spacing)
    face = rows[owner]
    cube = np.floor(points / CUBE).astype(np.int64)
    keys = np.column_stack([cube // ROOM, cube])
    order = np.lexsort(keys.T[::-1])
    keys, points, face = keys[order], points[order], face[order]
    new_room = _changes(keys[:, :3])
    new_cube = _changes(keys)
    cube_start = np.append(np.flatnonzero(new_cube), len(points))
    room_start = np.append(np.flatnonzero(new_room[new_cube]), new_cube.sum())
    room_points = np.append(np.flatnonzero(new_room), len(points))
    return Material(points, face, room_start, _balls(points, room_points), cube_start, _balls(points, cube_start))


def _count_up(counts: IntArray) -> IntArray:
    """0, 1, ... counts[0] - 1, 0, 1, ... counts[1] - 1, ..."""
    return np.asarray(np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts))


def _changes(keys: IntArray) -> BoolArray:
    if not len(keys):
        return np.zeros(0, np.bool_)
    return np.concatenate([[True], (keys[1:] != keys[:-1]).any(axis=1)])


def _balls(points: FloatArray, starts: IntArray) -> FloatArray:
    if len(starts) < 2:
        return np.zeros((0, 4))
    low = np.minimum.reduceat(points, starts[:-1], axis=0)
    high = np.maximum.reduceat(points, starts[:-1], axis=0)
    return np.column_stack([(low + high) / 2, np.linalg.norm(high - low, axis=1) / 2])
