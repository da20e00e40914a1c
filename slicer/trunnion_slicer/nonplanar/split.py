"""Marked edges of a mesh become two each, and the faces on both sides are split to match: no gaps, no T-junctions."""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray


def split_edges(
    vertices: FloatArray, faces: IntArray, edges: IntArray, at: FloatArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Vertices, faces, and the old face of every face, with edge i (e, 2) split at vertices[edge[0]] + at[i] * way.

    The edges are given once each, in either direction. A face with one split edge becomes two, with two three, with
    three four; old vertices keep their rows, new ones follow in the order of `edges`.
    """
    count = len(vertices)
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    added = a + at[:, None] * (b - a)
    name = np.sort(edges, axis=1) @ np.array([count, 1])
    order = np.argsort(name)
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
    wanted = np.sort(sides, axis=2) @ np.array([count, 1])
    place = np.minimum(np.searchsorted(name[order], wanted), max(len(name) - 1, 0))
    found = name[order][place] == wanted if len(name) else np.zeros(wanted.shape, np.bool_)
    middle = np.where(found, count + order[place], -1) if len(name) else np.full(wanted.shape, -1)

    splits = found.sum(axis=1)
    # Turn every face so that the odd edge out (the split one of one, the whole one of two) is its first.
    turn = np.where(splits == 1, found.argmax(axis=1), np.where(splits == 2, found.argmin(axis=1), 0))
    turned = (turn[:, None] + np.arange(3)) % 3
    corner = np.take_along_axis(faces, turned, axis=1)
    middle = np.take_along_axis(middle, turned, axis=1)
    points = np.concatenate([vertices, added])
    pieces = [(corner[splits == 0], np.flatnonzero(splits == 0))]
    one, two, three = (np.flatnonzero(splits == k) for k in (1, 2, 3))
    p, q, r = corner[one].T
    m = middle[one, 0]
    pieces += [(np.column_stack([p, m, r]), one), (np.column_stack([m, q, r]), one)]
    p, q, r = corner[two].T
    m, n = middle[two, 1], middle[two, 2]
    pieces.append((np.column_stack([m, r, n]), two))
    shorter = _shorter(points, p, m, q, n)
    pieces.append((np.where(shorter[:, None], np.column_stack([p, q, m]), np.column_stack([p, q, n])), two))
    pieces.append((np.where(shorter[:, None], np.column_stack([p, m, n]), np.column_stack([q, m, n])), two))
    p, q, r = corner[three].T
    k, m, n = middle[three].T
    for triangle in ([p, k, n], [k, q, m], [n, m, r], [k, m, n]):
        pieces.append((np.column_stack(triangle), three))
    new = np.concatenate([piece for piece, _ in pieces]).astype(np.int64)
    parent = np.concatenate([rows for _, rows in pieces])
    order = np.argsort(parent, kind="stable")
    return points, new[order], parent[order]


def _shorter(points: FloatArray, p: IntArray, m: IntArray, q: IntArray, n: IntArray) -> BoolArray:
    """Whether the diagonal p-m of a quadrangle is shorter than q-n."""
    return np.asarray(np.linalg.norm(points[p] - points[m], axis=1) <= np.linalg.norm(points[q] - points[n], axis=1))
