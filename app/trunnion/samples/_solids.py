"""Height fields over plane outlines as closed solids: a fine grid or a ring grid, lifted; and Boolean cuts."""

from collections.abc import Callable
from typing import Any

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.mesh import Mesh

SLIVER = 5e-4
"""mm. How far simplification may move the surface: less than the sag of any facet here."""

Height = Callable[[FloatArray, FloatArray], FloatArray]


def dome(outline: FloatArray, height: Height, rings: int) -> Mesh:
    """The solid between z = 0 and `height` over a star-shaped outline (n, 2) about the origin, anticlockwise.

    Rings shrink from the outline to the origin; every other ring is turned by half a step, so triangles stay even.
    Each ring has as many corners as suits its length, so there is no fan of needles in the middle.
    """
    n = len(outline)
    counts = [max(6, round(n * (rings - k) / rings)) for k in range(rings)]
    loops = [_ring(outline, count, (rings - k) / rings, 0.5 * (k % 2)) for k, count in enumerate(counts)]
    return _capped(loops, height)


def _ring(outline: FloatArray, count: int, scale: float, turn: float) -> FloatArray:
    closed = np.vstack([outline, outline[:1]])
    parameter = (np.arange(count) + turn) / count * len(outline)
    at = np.arange(len(outline) + 1)
    return scale * np.column_stack([np.interp(parameter % len(outline), at, closed[:, i]) for i in range(2)])


def _capped(loops: list[FloatArray], height: Height) -> Mesh:
    """Loops from the rim inwards, zipped together, lifted to `height`; a wall down to z = 0 and a flat bottom."""
    plan = np.vstack([*loops, np.zeros((1, 2))])
    starts = np.cumsum([0] + [len(loop) for loop in loops])
    pieces = [
        _zip(np.arange(a, b), np.arange(b, c), plan)
        for a, b, c in zip(starts[:-2], starts[1:-1], starts[2:], strict=True)
    ]
    last = np.arange(starts[-2], starts[-1])
    middle = np.full(len(last), starts[-1])
    top = np.vstack([*pieces, np.column_stack([last, np.roll(last, -1), middle])])
    return lifted(plan, top, height(plan[:, 0], plan[:, 1]), starts[1])


def lifted(plan: FloatArray, top: Any, z: FloatArray, rim: int) -> Mesh:
    """Close a lifted sheet: `top` (m, 3) over `plan` (n, 2), its first `rim` points the outline, anticlockwise."""
    n = len(plan)
    upper = np.column_stack([plan, z])
    lower = np.column_stack([plan, np.zeros(n)])
    here = np.arange(rim)
    after = np.roll(here, -1)
    side = np.vstack([np.column_stack([here + n, after + n, after]), np.column_stack([here + n, after, here])])
    faces = np.vstack([top, np.asarray(top)[:, ::-1] + n, side]).astype(np.int64)
    return Mesh(np.vstack([upper, lower]), faces)


def sheet(x: FloatArray, y: FloatArray, z: FloatArray) -> Mesh:
    """The solid between z = 0 and a grid of points, each (rows, columns); x grows with rows, y with columns."""
    rows, columns = x.shape
    grid = np.arange(rows * columns).reshape(rows, columns)
    ring = np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])
    inner = np.setdiff1d(grid.ravel(), ring)
    order = np.concatenate([ring, inner])
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    a, b, c, d = (place[part.ravel()] for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
    even = (np.add.outer(np.arange(rows - 1), np.arange(columns - 1)) % 2 == 0).ravel()
    one = np.where(even[:, None], np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    two = np.where(even[:, None], np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    plan = np.column_stack([x.ravel()[order], y.ravel()[order]])
    return lifted(plan, np.vstack([one, two]), z.ravel()[order], len(ring))


def _zip(outer: Any, inner: Any, plan: FloatArray) -> Any:
    """Triangles between two loops of different length, by advancing along whichever is behind in turn."""
    angle = np.concatenate([_turned(plan[outer]), _turned(plan[inner])])
    on_outer = np.concatenate([np.ones(len(outer), dtype=bool), np.zeros(len(inner), dtype=bool)])
    order = np.lexsort((on_outer, angle))
    outward = on_outer[order]
    i = (np.cumsum(outward) - 1) % len(outer)
    j = (np.cumsum(~outward) - 1) % len(inner)
    i_next, j_next = (np.roll(i, -1), np.roll(j, -1))
    moves_outer = np.roll(outward, -1)
    third = np.where(moves_outer, outer[i_next], inner[j_next])
    return np.column_stack([outer[i], third, inner[j]])


def _turned(points: FloatArray) -> FloatArray:
    return np.asarray(np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi))


def cut(mesh: Mesh, *tools: Any) -> Mesh:
    """`mesh` less every manifold3d solid of `tools`."""
    from manifold3d import Manifold, OpType

    return from_manifold(Manifold.batch_boolean([to_manifold(mesh), *tools], OpType.Subtract))


def to_manifold(mesh: Mesh) -> Any:
    """The mesh as a manifold3d solid."""
    from manifold3d import Manifold, Mesh64

    return Manifold(Mesh64(mesh.vertices.copy(order="C"), mesh.faces.astype(np.uint64, order="C")))


def from_manifold(solid: Any) -> Mesh:
    """A manifold3d solid as a mesh, without the slivers that Booleans leave."""
    out = solid.simplify(SLIVER).to_mesh64()
    vertices = np.array(out.vert_properties, dtype=np.float64)[:, :3].copy()
    return Mesh(vertices, np.array(out.tri_verts, dtype=np.int64))


def smooth_step(x: FloatArray) -> FloatArray:
    """0 below 0, 1 above 1, and a curve with continuous curvature between (Perlin 2002)."""
    t = np.clip(x, 0.0, 1.0)
    return np.asarray(t**3 * (t * (6 * t - 15) + 10))
