"""Patches and their lowest surfaces become closed solids, and the part without them the planar-only mesh.

Section 2.5 of Shahid 2024. The cutter's floor is the lowest offset surface, its roof the skin raised into the air, so
that the two solids never share a face and the Boolean difference is clean. Its sides run from the floor's border to the
skin's border, a hair outside of both (SIDE_CLEARANCE), and on upwards leaning away from whatever stands beside the
patch.
"""

from collections.abc import Sequence

import manifold3d
import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import MeshError
from trunnion_core.mesh import Mesh
from trunnion_slicer.nonplanar.offset import Surfaces

ROOF = 1.0
"""mm. How far the cutter stands above the skin."""

LEAN = 0.1
"""mm. How far its roof leans towards the free side of the face across the border."""

SIDE_CLEARANCE = 0.005
"""mm. How far its sides stand outside the border, so that they cut through the skin rather than graze it."""

SMALLEST_PIECE = 0.02
"""mm³. Crumbs below this that the difference leaves are dropped: less than a bead as long as it is wide."""


def planar_only(mesh: Mesh, stacks: Sequence[Surfaces]) -> Mesh:
    """The mesh without the space of the non-planar layers. Raises MeshError when the mesh is no closed solid."""
    part = _solid(mesh.vertices, mesh.faces)
    if part.status() != manifold3d.Error.NoError:
        raise MeshError(f"mesh: cannot be cut ({part.status()}), should be a closed solid; repair it first")
    cutters = [_solid(*cutter(stack)) for stack in stacks]
    cut = manifold3d.Manifold.batch_boolean([part, *cutters], manifold3d.OpType.Subtract)
    pieces = cut.decompose()
    kept = [piece for piece in pieces if piece.volume() > SMALLEST_PIECE]
    if len(kept) < len(pieces):
        cut = manifold3d.Manifold.compose(kept) if kept else manifold3d.Manifold()
    result = cut.to_mesh64()
    return Mesh(
        np.ascontiguousarray(result.vert_properties[:, :3], dtype=np.float64),
        np.ascontiguousarray(result.tri_verts, dtype=np.int64),
    )


def cutter(stack: Surfaces) -> tuple[FloatArray, IntArray]:
    """Vertices and faces of the closed solid that takes a patch's layers out of the part."""
    patch = stack.patch
    count = len(patch.vertices)
    rim = np.unique(patch.border)
    outward, free = _border_directions(stack)
    floor = stack.surfaces[-1].copy()
    floor[rim] += SIDE_CLEARANCE * outward
    skin = patch.vertices[rim] + SIDE_CLEARANCE * outward
    roof = patch.vertices + np.array([0.0, 0.0, ROOF])
    roof[rim] += LEAN * free + SIDE_CLEARANCE * outward

    middle = np.full(count, -1, np.int64)
    middle[rim] = 2 * count + np.arange(len(rim))
    a, b = patch.border[:, 0], patch.border[:, 1]
    roof_faces = patch.faces + count
    sides = [(a, middle[a], b), (b, middle[a], middle[b])]
    sides += [(middle[a], a + count, middle[b]), (middle[b], a + count, b + count)]
    # Seen from outside, the border of the floor runs the other way round than the sides' lower edges.
    faces = [patch.faces[:, ::-1], roof_faces, *(np.stack(side, axis=1)[:, ::-1] for side in sides)]
    return np.concatenate([floor, roof, skin]), np.concatenate(faces)


def _border_directions(stack: Surfaces) -> tuple[FloatArray, FloatArray]:
    """For every border vertex, in order: horizontally away from the patch, and into the air beside it; (r, 3) unit."""
    patch = stack.patch
    edge = patch.vertices[patch.border[:, 1]] - patch.vertices[patch.border[:, 0]]
    right = np.stack([edge[:, 1], -edge[:, 0], np.zeros(len(edge))], axis=1)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-12)
    rim, place = np.unique(patch.border.ravel(), return_inverse=True)
    outward, free = np.zeros((2, len(rim), 3))
    np.add.at(outward, place, np.repeat(right, 2, axis=0))
    np.add.at(free, place, np.repeat(patch.outside, 2, axis=0))
    return _unit(outward), _unit(free)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def _solid(vertices: FloatArray, faces: IntArray) -> manifold3d.Manifold:
    return manifold3d.Manifold(
        manifold3d.Mesh64(np.array(vertices, order="C"), np.array(faces, dtype=np.uint64, order="C"))
    )
