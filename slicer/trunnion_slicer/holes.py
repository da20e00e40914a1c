"""The rims of holes in a surface into faces that close them.

A rim is capped in the plane that fits it best, with the triangulation of manifold3d, so no vertex is added and a
flat hole becomes flat again. A hole is filled if it is flat, or small against the part; else it is left.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.tolerance import FLAT_HOLE

LARGEST_BENT_HOLE = 0.25
"""Share of the part's diagonal. What bridges a larger bent hole would be an invention, not a repair."""


@dataclass(frozen=True, eq=False)
class Hole:
    """One rim, and the faces that would close it: none if it should not or cannot be closed."""

    rim: IntArray
    """(r,) vertices in the direction of the surface's own half-edges."""
    middle: FloatArray
    """(3,) mm."""
    size: float
    """mm; diagonal of the rim's bounding box."""
    faces: IntArray
    """(r - 2, 3), or (0, 3)."""


def find_holes(vertices: FloatArray, tails: IntArray, heads: IntArray, part_size: float) -> list[Hole]:
    """Every rim made of the half-edges tail -> head that have no partner, in the order of their lowest vertex.

    `part_size` is the diagonal of the part in mm. The cost is linear in the half-edges of rims, of which a printable
    mesh has few.
    """
    return [_hole(vertices, np.array(rim, dtype=np.int64), part_size) for rim in _rims(tails, heads)]


def _hole(vertices: FloatArray, rim: IntArray, part_size: float) -> Hole:
    points = vertices[rim]
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    _, _, frame = np.linalg.svd(points - middle, full_matrices=False)
    none = np.zeros((0, 3), dtype=np.int64)
    if len(rim) < 3 or len(frame) < 3:
        return Hole(rim, middle, size, none)
    off_plane = np.abs((points - middle) @ frame[2]).max()
    if len(rim) > 3 and off_plane > FLAT_HOLE and size > LARGEST_BENT_HOLE * part_size:
        return Hole(rim, middle, size, none)
    return Hole(rim, middle, size, _cap((points - middle) @ frame[:2].T, rim))


def _cap(flat: FloatArray, rim: IntArray) -> IntArray:
    """Faces against the rim's direction; none where the rim crosses itself in its plane."""
    from manifold3d import triangulate

    none = np.zeros((0, 3), dtype=np.int64)
    if len(rim) == 3:
        return rim[None, ::-1].copy()
    x, y = flat.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    loop = rim if area > 0 else rim[::-1]
    corners = flat if area > 0 else flat[::-1]
    triangles = np.asarray(triangulate([np.ascontiguousarray(corners)]), dtype=np.int64)
    if len(triangles) != len(rim) - 2:
        return none
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    pieces = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    if pieces.min() < -1e-9 * abs(area) or not np.isclose(pieces.sum(), abs(area)):
        return none
    faces = loop[triangles]
    # The cap's half-edges run against the rim's own; a loop that was turned round already does.
    return faces[:, ::-1].copy() if area > 0 else faces


def _rims(tails: IntArray, heads: IntArray) -> list[list[int]]:
    """Simple cycles of the half-edges; a walk that meets itself drops the cycle that it closed."""
    outgoing: dict[int, list[int]] = {}
    order = np.lexsort((heads, tails))[::-1]
    for tail, head in zip(tails[order].tolist(), heads[order].tolist(), strict=True):
        outgoing.setdefault(tail, []).append(head)
    rims: list[list[int]] = []
    for start in sorted(outgoing):
        walk, place = [start], {start: 0}
        while outgoing.get(walk[-1]):
            head = outgoing[walk[-1]].pop()
            if head in place:
                first = place[head]
                rims.append(walk[first:])
                for vertex in walk[first + 1 :]:
                    del place[vertex]
                del walk[first + 1 :]
            else:
                place[head] = len(walk)
                walk.append(head)
    return rims
