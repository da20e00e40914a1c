"""Straight lines joined into zig-zags, by boustrophedon decomposition.

Where the boundary crosses the scan lines is all there is to know: between two crossings that follow each other on a
ring, the boundary either runs on to the neighbouring line or turns back to the same one. Two intervals on
neighbouring lines belong to one cell when the boundary joins both their left and both their right ends; a cell ends
exactly where scan lines split or merge (Choset 2000, Coverage of known spaces: the boustrophedon cellular
decomposition). Cells are walked depth first over their adjacency, always into the nearest corner; the zig-zag turns
along the boundary, and runs on along it into the next cell where the boundary leads there.
"""

from dataclasses import dataclass

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from trunnion_core.arrays import BoolArray, FloatArray, IntArray

EDGE_SHARE = 0.05
"""Share of the spacing that the outermost lines keep from the edge, so that an edge which wavers does not cut them."""


def fill(region: MultiPolygon, spacing: float, angle: float, *, fit: bool = True) -> list[FloatArray]:
    """Zig-zag centre lines (n, 2) mm over `region`; see `trunnion_slicer.infill.fill`."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    lines: list[FloatArray] = []
    for island in region.geoms:
        scan = _scan(island, turn, spacing, fit)
        if scan is not None:
            lines += [path @ turn for path in _paths(scan)]
    return [line for line in lines if _length(line) >= spacing / 2]


@dataclass(frozen=True, eq=False)
class _Scan:
    """Where the rings of an island cross the scan lines; rows of crossings in the order of the rings.

    Interval j runs from crossing left[j] to right[j]; intervals are sorted by line, then from left to right.
    """

    vertices: FloatArray  # (v, 2) of all rings, without repeated ends, scan lines along X
    ring_start: IntArray  # (v,) first vertex of the ring that the vertex is on
    ring_size: IntArray  # (v,)
    points: FloatArray  # (c, 2)
    edge: IntArray  # (c,) vertex at which the crossed edge starts
    line: IntArray  # (c,)
    rises: BoolArray  # (c,) whether the ring runs towards higher lines
    above: IntArray  # (c,) the crossing reached by following the boundary upwards
    below: IntArray  # (c,)
    interval: IntArray  # (c,)
    left: IntArray  # (i,)
    right: IntArray  # (i,)


def _scan(island: Polygon, turn: FloatArray, spacing: float, fit: bool) -> _Scan | None:
    """Every crossing of the island's rings with the scan lines; None where there is none."""
    rings = [np.asarray(ring.coords)[:-1, :2] @ turn.T for ring in (island.exterior, *island.interiors)]
    sizes = np.array([len(ring) for ring in rings])
    vertices = np.concatenate(rings)
    ring_start = np.repeat(np.cumsum(sizes) - sizes, sizes)
    ring_size = np.repeat(sizes, sizes)
    origin, pitch = _lines(float(vertices[:, 1].min()), float(vertices[:, 1].max()), spacing, fit)

    # A vertex on a line counts as above it: level n means that lines below n are under the vertex.
    here = np.arange(len(vertices))
    following = ring_start + (here - ring_start + 1) % ring_size
    level = np.floor((vertices[:, 1] - origin) / pitch).astype(np.int64) + 1
    step = level[following] - level
    count = np.abs(step)
    total = int(count.sum())
    if total == 0:
        return None
    edge = np.repeat(here, count)
    nth = np.arange(total) - np.repeat(np.cumsum(count) - count, count)
    rises = step[edge] > 0
    line = np.where(rises, level[edge] + nth, level[edge] - 1 - nth)
    y = origin + line * pitch
    start, end = vertices[edge], vertices[following[edge]]
    x = start[:, 0] + (y - start[:, 1]) / (end[:, 1] - start[:, 1]) * (end[:, 0] - start[:, 0])

    ring = ring_start[edge]
    first = np.searchsorted(ring, ring, side="left")
    size = np.searchsorted(ring, ring, side="right") - first
    place = np.arange(total) - first
    ahead, behind = first + (place + 1) % size, first + (place - 1) % size
    order = np.lexsort((x, line))
    interval = np.empty(total, np.int64)
    interval[order] = np.arange(total) // 2
    return _Scan(
        vertices=vertices,
        ring_start=ring_start,
        ring_size=ring_size,
        points=np.column_stack([x, y]),
        edge=edge,
        line=line,
        rises=rises,
        above=np.where(rises, ahead, behind),
        below=np.where(rises, behind, ahead),
        interval=interval,
        left=order[0::2],
        right=order[1::2],
    )


def _lines(low: float, high: float, spacing: float, fit: bool) -> tuple[float, float]:
    """Where line 0 lies and how far the lines are apart."""
    if not fit:
        return 0.0, spacing
    edge = min(EDGE_SHARE * spacing, (high - low) / 4)
    span = high - low - 2 * edge
    gaps = round((high - low) / spacing)
    if gaps == 0:
        return (low + high) / 2, spacing
    return low + edge, span / gaps * (1 - 1e-12)


def _paths(scan: _Scan) -> list[FloatArray]:
    """The zig-zags of all cells, joined along the boundary where it leads from one to the next."""
    cells = _cells(scan)
    neighbours = _neighbours(scan, cells)
    left = [scan.left[cell] for cell in cells]
    right = [scan.right[cell] for cell in cells]
    corners = np.array([[side[end] for side in (left[c], right[c]) for end in (0, -1)] for c in range(len(cells))])
    todo = np.ones(len(cells), np.bool_)
    trail: list[int] = []
    runs: list[list[IntArray]] = []
    here: int | None = None
    while todo.any():
        while trail and not any(todo[n] for n in neighbours[trail[-1]]):
            trail.pop()
        choice = np.array([n for n in neighbours[trail[-1]] if todo[n]]) if trail else np.flatnonzero(todo)
        cell, corner, joined = _entry(scan, choice, corners, here)
        steps = _zigzag(left[cell], right[cell], top=corner % 2 == 1, from_right=corner >= 2)
        if joined:
            runs[-1].append(steps)
        else:
            runs.append([steps])
        here = int(steps[-1])
        todo[cell] = False
        trail.append(cell)
    return [_expand(scan, np.concatenate(run)) for run in runs]


def _entry(scan: _Scan, choice: IntArray, corners: IntArray, here: int | None) -> tuple[int, int, bool]:
    """The cell to walk next, the corner to enter it by, and whether the boundary leads there from `here`."""
    if here is None:
        return int(choice[0]), 0, False
    candidates = corners[choice]
    joined = (candidates == scan.above[here]) | (candidates == scan.below[here])
    distance = np.linalg.norm(scan.points[candidates] - scan.points[here], axis=2)
    if joined.any():
        distance = np.where(joined, distance, np.inf)
    row, corner = divmod(int(distance.argmin()), 4)
    return int(choice[row]), corner, bool(joined.any())


def _cells(scan: _Scan) -> list[IntArray]:
    """Intervals of every cell from its lowest line to its highest."""
    count = len(scan.left)
    over_left, over_right = scan.above[scan.left], scan.above[scan.right]
    up = scan.interval[over_left]
    same = (up == scan.interval[over_right]) & (over_left == scan.left[up]) & (over_right == scan.right[up])
    same &= scan.line[over_left] == scan.line[scan.left] + 1
    # Each interval points at the one below it in its cell; doubling the stride finds the lowest in log2(lines) steps.
    lowest = np.arange(count)
    lowest[up[same]] = np.flatnonzero(same)
    while True:
        further = lowest[lowest]
        if (further == lowest).all():
            break
        lowest = further
    order = np.argsort(lowest, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(lowest[order])) + 1)


def _neighbours(scan: _Scan, cells: list[IntArray]) -> list[list[int]]:
    """Cells that touch along a scan line's gap: an end of the one leads along the boundary to an end of the other."""
    owner = np.empty(len(scan.left), np.int64)
    for number, cell in enumerate(cells):
        owner[cell] = number
    mine = owner[scan.interval]
    pairs = np.concatenate([np.column_stack([mine, mine[scan.above]]), np.column_stack([mine, mine[scan.below]])])
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    found: list[list[int]] = [[] for _ in cells]
    for a, b in pairs:
        found[a].append(int(b))
        found[b].append(int(a))
    return [sorted(set(touching)) for touching in found]


def _zigzag(left: IntArray, right: IntArray, *, top: bool, from_right: bool) -> IntArray:
    """Crossings of one cell in the order of the tip: in and out of the first line, of the second, ..."""
    enter, leave = (right, left) if from_right else (left, right)
    if top:
        enter, leave = enter[::-1], leave[::-1]
    back = np.arange(len(enter)) % 2 == 1
    steps = np.empty(2 * len(enter), np.int64)
    steps[0::2] = np.where(back, leave, enter)
    steps[1::2] = np.where(back, enter, leave)
    return steps


def _expand(scan: _Scan, steps: IntArray) -> FloatArray:
    """Points of a path: its crossings, and the vertices of the boundary between a line's end and the next start."""
    out, into = steps[1:-1:2], steps[2::2]
    ahead = np.where(scan.above[out] == into, scan.rises[out], ~scan.rises[out])
    size, start = scan.ring_size[scan.edge[out]], scan.ring_start[scan.edge[out]]
    span = np.where(ahead, scan.edge[into] - scan.edge[out], scan.edge[out] - scan.edge[into]) % size
    nth = np.arange(int(span.sum())) - np.repeat(np.cumsum(span) - span, span)
    origin, sign = scan.edge[out] + ahead, np.where(ahead, 1, -1)
    rows = np.repeat(start, span) + (np.repeat(origin - start, span) + nth * np.repeat(sign, span)) % np.repeat(
        size, span
    )
    points = np.insert(scan.points[steps], np.repeat(np.arange(2, len(steps), 2), span), scan.vertices[rows], axis=0)
    moves = np.ones(len(points), np.bool_)
    moves[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9
    return points[moves]


def _length(line: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
