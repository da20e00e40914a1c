"""The two loops of slicing that must be loops: pairing the half-edges of a mesh, and walking its contours."""

import numpy as np
from numba import njit

from trunnion_core.arrays import FloatArray, IntArray


@njit(cache=True)
def twins(faces: IntArray, vertex_count: int) -> IntArray:
    """For half-edge 3 f + c (from corner c of face f to the next), the opposite half-edge; -1 where there is none.

    Half-edges are kept in one bucket per lower vertex; O(edges x valence). Where more than two faces share an edge
    they are paired in the order of the faces.
    """
    count = faces.shape[0] * 3
    start = np.zeros(vertex_count + 1, np.int64)
    for half in range(count):
        f, c = half // 3, half % 3
        low = min(faces[f, c], faces[f, (c + 1) % 3])
        start[low + 1] += 1
    for v in range(vertex_count):
        start[v + 1] += start[v]
    filled = start[:-1].copy()
    bucket = np.empty(count, np.int64)
    twin = np.full(count, -1, np.int64)
    for half in range(count):
        f, c = half // 3, half % 3
        a, b = faces[f, c], faces[f, (c + 1) % 3]
        low = min(a, b)
        found = -1
        for slot in range(start[low], filled[low]):
            other = bucket[slot]
            if twin[other] < 0:
                g, d = other // 3, other % 3
                if faces[g, d] == b and faces[g, (d + 1) % 3] == a:
                    found = other
                    break
        if found >= 0:
            twin[half] = found
            twin[found] = half
        else:
            bucket[filled[low]] = half
            filled[low] += 1
    return twin


@njit(cache=True)
def link(
    vertices: FloatArray, faces: IntArray, twin: IntArray, levels: FloatArray, first: IntArray, offset: IntArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Walk every contour once: points (n, 2), starts (loops + 1,), index of the level (loops,).

    Triangle t spans the levels first[t] ... first[t] + offset[t + 1] - offset[t] - 1; its segment at level k has the
    number offset[t] + k - first[t]. A segment runs from the edge that falls through the plane to the one that rises.
    """
    total = offset[-1]
    seen = np.zeros(total, np.bool_)
    points = np.empty((total, 2))
    starts = np.empty(total // 2 + 2, np.int64)
    planes = np.empty(total // 2 + 2, np.int64)
    loops = 0
    written = 0
    for t0 in range(faces.shape[0]):
        for segment0 in range(offset[t0], offset[t0 + 1]):
            if seen[segment0]:
                continue
            k = first[t0] + segment0 - offset[t0]
            level = levels[k]
            starts[loops] = written
            planes[loops] = k
            loops += 1
            t = t0
            segment = segment0
            while not seen[segment]:
                seen[segment] = True
                for c in range(3):
                    a = faces[t, c]
                    b = faces[t, (c + 1) % 3]
                    if vertices[a, 2] < level <= vertices[b, 2]:
                        low, high = (a, b) if a < b else (b, a)
                        share = (level - vertices[low, 2]) / (vertices[high, 2] - vertices[low, 2])
                        points[written, 0] = vertices[low, 0] + share * (vertices[high, 0] - vertices[low, 0])
                        points[written, 1] = vertices[low, 1] + share * (vertices[high, 1] - vertices[low, 1])
                        written += 1
                        t = twin[3 * t + c] // 3
                        break
                segment = offset[t] + k - first[t]
    starts[loops] = written
    return points, starts[: loops + 1], planes[:loops]
