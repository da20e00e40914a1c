"""Closed, oriented bodies into one solid: outsides outwards, hollows kept, whatever overlaps united by manifold3d."""

from typing import Any

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.mesh import Mesh

POINT_BLOCK = 200_000
"""Faces looked at together for a winding number; bounds the memory."""


def outward(vertices: FloatArray, faces: IntArray, body: IntArray) -> tuple[BoolArray, IntArray]:
    """Which bodies are inside out (b,), and the body that each is a hollow of (b,): -1 for what is solid.

    A body whose volume is negative as wound is a hollow if it lies inside a body of positive volume; otherwise it is
    inside out.
    """
    volume = volumes(vertices, faces, body)
    count = len(volume)
    inside_out = np.zeros(count, dtype=np.bool_)
    hollow_of = np.full(count, -1, dtype=np.int64)
    low, high = _boxes(vertices, faces, body, count)
    for one in np.flatnonzero(volume < 0):
        around = (volume > 0) & (low <= low[one]).all(axis=1) & (high >= high[one]).all(axis=1)
        point = vertices[faces[np.flatnonzero(body == one)[0], 0]]
        holders = [
            other for other in np.flatnonzero(around) if _winding_number(vertices, faces[body == other], point) > 0.5
        ]
        if holders:
            hollow_of[one] = min(holders, key=lambda other: volume[other])
        else:
            inside_out[one] = True
    return inside_out, hollow_of


def volumes(vertices: FloatArray, faces: IntArray, body: IntArray) -> FloatArray:
    """(b,) mm³ enclosed by each body, negative where it is wound inwards (divergence theorem)."""
    a, b, c = (vertices[faces[:, i]] - vertices.mean(axis=0) for i in range(3))
    return np.asarray(np.bincount(body, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0), dtype=np.float64)


def united(vertices: FloatArray, faces: IntArray, body: IntArray, hollow_of: IntArray) -> tuple[Mesh, int] | None:
    """The union of all bodies with their hollows, and how many solids went in; None where none touches another."""
    from manifold3d import Manifold, OpType

    solids = np.flatnonzero(hollow_of < 0)
    low, high = _boxes(vertices, faces, body, len(hollow_of))
    if len(solids) < 2 or not _any_overlap(low[solids], high[solids]):
        return None
    parts = []
    for solid in solids:
        own = np.isin(body, np.append(np.flatnonzero(hollow_of == solid), solid))
        parts.append(manifold_of(vertices, faces[own]))
    whole = Manifold.batch_boolean(parts, OpType.Add)
    separate = sum(part.volume() for part in parts)
    if len(whole.decompose()) >= len(parts) and np.isclose(whole.volume(), separate, rtol=1e-12):
        return None
    return mesh_of(whole), len(parts)


def manifold_of(vertices: FloatArray, faces: IntArray) -> Any:
    """manifold3d's view of the faces; its `status()` says whether they are a manifold."""
    from manifold3d import Manifold, Mesh64

    used, rows = np.unique(faces, return_inverse=True)
    return Manifold(Mesh64(vertices[used], rows.reshape(-1, 3).astype(np.uint64)))


def mesh_of(manifold: Any) -> Mesh:
    """A `Mesh` of what manifold3d holds."""
    out = manifold.to_mesh64()
    vertices = np.array(out.vert_properties, dtype=np.float64)[:, :3].copy()
    return Mesh(vertices, np.array(out.tri_verts, dtype=np.int64))


def _boxes(vertices: FloatArray, faces: IntArray, body: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corners = vertices[faces]
    np.minimum.at(low, body, corners.min(axis=1))
    np.maximum.at(high, body, corners.max(axis=1))
    return low, high


def _any_overlap(low: FloatArray, high: FloatArray) -> bool:
    """Whether any two boxes touch; a sweep along X keeps the pairs few."""
    order = np.argsort(low[:, 0], kind="stable")
    low, high = low[order], high[order]
    last = np.searchsorted(low[:, 0], high[:, 0], side="right")
    for one, end in enumerate(last):
        others = slice(one + 1, end)
        touching = (low[others] <= high[one]).all(axis=1) & (high[others] >= low[one]).all(axis=1)
        if touching.any():
            return True
    return False


def _winding_number(vertices: FloatArray, faces: IntArray, point: FloatArray) -> float:
    """Times the faces wind around `point`: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    total = 0.0
    for start in range(0, len(faces), POINT_BLOCK):
        a, b, c = (vertices[faces[start : start + POINT_BLOCK, i]] - point for i in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
        total += float(np.arctan2(numerator, la * lb * lc + ab * lc + bc * la + ca * lb).sum())
    return total / (2 * np.pi)
