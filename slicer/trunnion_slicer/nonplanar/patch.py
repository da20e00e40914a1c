"""A region of faces becomes patches: connected pieces of skin with their own vertices, normals and border."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, freeze
from trunnion_core.mesh import Mesh
from trunnion_slicer.nonplanar.normals import face_normals, mean_normals, offset_steps
from trunnion_slicer.nonplanar.regions import components

CREASE_DEG = 35.0
"""Degrees. Where the skin bends more than this at the border (the rim of a vertical wall, the foot of a rib), the
layers end on the face across the border; where less, they end square to the skin."""


@dataclass(frozen=True, eq=False)
class Patch:
    """One piece of skin, connected by edges, in `part`; a disc with holes as a mesh, without pinched vertices."""

    rows: IntArray
    """(m,) its faces, as rows of the mesh's."""
    vertices: FloatArray
    """(n, 3) mm."""
    faces: IntArray
    """(m, 3) rows of `vertices`."""
    mean: FloatArray
    """(n, 3) averaged normals as `normals.mean_normals` gives them: not of length 1 at creases."""
    steps: FloatArray
    """(n, 3) where each vertex goes for 1 mm of offset to the inside."""
    border: IntArray
    """(b, 2) edges of the border, the patch on the left seen from above."""
    outside: FloatArray
    """(b, 3) unit normal of the mesh's face across each border edge; of its own face where there is none."""

    def __post_init__(self) -> None:
        freeze(self.rows, self.vertices, self.faces, self.mean, self.steps, self.border, self.outside)

    @property
    def normals(self) -> FloatArray:
        """(n, 3) unit averaged normals, equation 2."""
        return np.asarray(self.mean / np.linalg.norm(self.mean, axis=1, keepdims=True))


def split_patches(mesh: Mesh, region: BoolArray, twin: IntArray) -> list[Patch]:
    """The patches of a region (m,), lowest first by the height of their middle."""
    count, piece = components(region, twin)
    if not count:
        return []
    normal, _ = face_normals(mesh.vertices, mesh.faces)
    order = np.flatnonzero(region)
    order = order[np.argsort(piece[order], kind="stable")]
    bounds = np.flatnonzero(np.diff(piece[order])) + 1
    patches = [_patch(mesh, rows, twin, normal) for rows in np.split(order, bounds)]
    return sorted(patches, key=lambda patch: (float(patch.vertices[:, 2].mean()), int(patch.rows[0])))


def _patch(mesh: Mesh, rows: IntArray, twin: IntArray, normal: FloatArray) -> Patch:
    number = np.full(len(mesh.faces), -1, np.int64)
    number[rows] = np.arange(len(rows))
    half = (3 * rows[:, None] + np.arange(3)).ravel()
    opposite = twin[half]
    across = np.where(opposite >= 0, number[np.maximum(opposite, 0) // 3], -1)
    faces, source = _unpinched(mesh.faces[rows], across, number, opposite)
    vertices = mesh.vertices[source]

    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    rim = across < 0
    outside = normal[np.where(opposite >= 0, opposite, half) // 3][rim]
    mean = mean_normals(vertices, faces)
    steps = offset_steps(mean)
    _end_on_walls(steps, mean, edges[rim], outside)
    return Patch(rows, vertices, faces, mean, steps, edges[rim], outside)


def _unpinched(corner: IntArray, across: IntArray, number: IntArray, opposite: IntArray) -> tuple[IntArray, IntArray]:
    """Faces over vertices of their own, and the mesh's vertex each stands for.

    Corners belong to one vertex where the patch's faces lead from one to the other over shared edges: a vertex where
    two fans of faces merely touch becomes two, so that every border runs through a vertex once.
    """
    inner = np.flatnonzero(across >= 0)
    # Half-edge i runs from corner i to the next of its face; its twin runs the other way.
    follow = 3 * (inner // 3) + (inner + 1) % 3
    twin_local = 3 * across[inner] + opposite[inner] % 3
    twin_follow = 3 * (twin_local // 3) + (twin_local + 1) % 3
    a = np.concatenate([inner, follow])
    b = np.concatenate([twin_follow, twin_local])
    size = corner.size
    graph = coo_array((np.ones(len(a), np.int8), (a, b)), shape=(size, size))
    count, label = connected_components(graph, directed=False)
    source = np.empty(count, np.int64)
    source[label] = corner.ravel()
    return label.reshape(-1, 3).astype(np.int64), source


def _end_on_walls(steps: FloatArray, mean: FloatArray, border: IntArray, outside: FloatArray) -> None:
    """Turn the steps of border vertices into the faces across the border, where the skin bends sharply there.

    The step x solves n.x = -1 for the patch and o.x = 0 for the one or two faces across (least squares, kept near the
    averaged normal where those leave a freedom).
    """
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    unit = mean / np.maximum(length, 1e-300)
    ends = border.ravel()
    wall = np.repeat(outside, 2, axis=0)
    sharp = (unit[ends] * wall).sum(axis=1) < np.cos(np.radians(CREASE_DEG))
    ends, wall = ends[sharp], wall[sharp]
    if not ends.size:
        return
    rows, place = np.unique(ends, return_inverse=True)
    matrix = np.einsum("ni,nj->nij", unit[rows], unit[rows]) * 2.0 + 1e-3 * np.eye(3)
    target = -2.0 * unit[rows] / np.maximum(length[rows], 1 / 3) + 1e-3 * steps[rows]
    np.add.at(matrix, place, np.einsum("ni,nj->nij", wall, wall))
    solved = np.linalg.solve(matrix, target[:, :, None])[:, :, 0]
    size = np.linalg.norm(solved, axis=1, keepdims=True)
    steps[rows] = solved * np.minimum(1.0, 3.0 / np.maximum(size, 1e-300))
