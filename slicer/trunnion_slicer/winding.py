"""Which faces hang together, and which way round each should be read so that neighbours agree.

A face and its flipped twin are two nodes of a double cover; neighbours that agree join like with like, neighbours
that do not join each with the other's twin. The connected halves of the cover are the consistent windings, and a
surface whose two halves are one has no inside (a Moebius strip). One pass of a graph routine, no search by hand.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from trunnion_core.arrays import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Edges:
    """The undirected edges of faces. Half-edge 3 f + i runs from corner i of face f to the next."""

    ends: IntArray
    """(e, 2) lower and higher vertex."""
    of_half: IntArray
    """(3 m,) edge of every half-edge."""
    forward: BoolArray
    """(3 m,) whether the half-edge runs from the lower to the higher vertex."""
    uses: IntArray
    """(e,) half-edges on the edge."""
    surplus: IntArray
    """(e,) forward half-edges less backward ones; 0 everywhere on a closed, consistent surface."""


def find_edges(faces: IntArray) -> Edges:
    """Edges of (m, 3) faces."""
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    stride = int(faces.max()) + 1
    key, of_half, uses = np.unique(low * stride + high, return_inverse=True, return_counts=True)
    forward = tail < head
    surplus = np.bincount(of_half, np.where(forward, 1.0, -1.0), len(key)).astype(np.int64)
    return Edges(np.column_stack([key // stride, key % stride]), of_half, forward, uses.astype(np.int64), surplus)


def consistent_winding(faces: IntArray, edges: Edges) -> tuple[BoolArray, IntArray, IntArray]:
    """(m,) faces to flip so that neighbours agree, as few as can be; (m,) body of every face; bodies without sides.

    Neighbours are faces that share an edge with nobody else. The last array holds the bodies that cannot be oriented.
    """
    m = len(faces)
    order = np.argsort(edges.of_half, kind="stable")
    pair = order[np.isin(edges.of_half[order], np.flatnonzero(edges.uses == 2))].reshape(-1, 2)
    one, other = pair[:, 0] // 3, pair[:, 1] // 3
    twisted = (edges.forward[pair[:, 0]] == edges.forward[pair[:, 1]]).astype(np.int64)
    rows = np.concatenate([one, one + m])
    columns = np.concatenate([other + m * twisted, other + m * (1 - twisted)])
    cover = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(2 * m, 2 * m))
    _, label = connected_components(cover, directed=False)
    as_read, flipped = label[:m].astype(np.int64), label[m:].astype(np.int64)
    representative = np.minimum(as_read, flipped)
    _, body = np.unique(representative, return_inverse=True)
    flip = as_read != representative
    count = np.bincount(body)
    too_many = np.bincount(body, flip.astype(np.float64)) > count / 2
    return flip ^ too_many[body], body.astype(np.int64), np.unique(body[as_read == flipped])
