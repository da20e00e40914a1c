"""A mesh becomes the mask of the faces that are better printed along the skin than in planar layers.

Section 2.3 of Shahid 2024: faces that look up with a slope of at most the threshold angle (equation 1), without those
that have material above them, found by rays cast straight up. The rays start at the corners of each face, moved
inwards a little so that neighbours are not hit, and at points spread over large faces. Rays cast down at the same time
find faces whose material underneath is too thin to carry non-planar layers. What is flat anyway (a top, the floor of
a groove) stays planar, and so does what is too small to be worth it.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings
from trunnion_slicer.nonplanar.grid import build_grid
from trunnion_slicer.nonplanar.normals import face_normals

FLAT_DEG = 2.0
"""Degrees. A patch nowhere steeper than this has no stairs to speak of: its top layer is flat already."""

FLAT_EDGE_DEG = 15.0
"""Degrees. A flat place all of whose edges bend more than this is a top or a floor by itself (the bottom of a groove,
a plateau); the flat apex of a dome goes over into it smoothly."""

HYSTERESIS_DEG = 3.0
"""Degrees over the threshold that a face may have where two of its three neighbours are in: the border of a curved
region would follow the teeth of the tessellation otherwise."""

SAMPLE_DISTANCE = 2.0
"""mm. Rays over a large face are about this far apart."""

MOST_SAMPLES = 24
"""Rows of rays over one face; larger faces get no more."""

RAY_CLEARANCE = 1e-3
"""mm. What a ray meets nearer than this is the face it starts on."""


def find_region(mesh: Mesh, twin: IntArray, settings: PrintSettings) -> BoolArray:
    """Which faces (m,) to print non-planar; all False where the threshold angle is 0.

    `twin` (3 m,) is the opposite half-edge of each (`section_kernels.twins`). Patches that are flat within a layer
    and 2 degrees, and patches of less than `nonplanar_min_area`, are left out.
    """
    none = np.zeros(len(mesh.faces), np.bool_)
    if settings.max_angle_deg <= 0 or not len(mesh.faces):
        return none
    normal, area = face_normals(mesh.vertices, mesh.faces)
    upward = normal[:, 2] > 1e-6
    slope = np.degrees(np.arccos(np.clip(normal[:, 2], -1.0, 1.0)))
    wide = upward & (slope <= settings.max_angle_deg + HYSTERESIS_DEG)
    rows = np.flatnonzero(wide)
    if not rows.size:
        return none
    wide[rows[~_printable(mesh, rows, normal[rows, 2], settings)]] = False
    region = _smooth_border(wide & (slope <= settings.max_angle_deg + 1e-6), wide, twin)
    footprint = area * normal[:, 2]
    region = region & ~_plateaus(mesh, region & (slope < FLAT_DEG), twin, normal, footprint, settings)
    return _drop_small_and_flat(mesh, region, twin, slope, footprint, settings)


def worthwhile(mesh: Mesh, region: BoolArray, twin: IntArray, settings: PrintSettings) -> BoolArray:
    """The region (m,) without the pieces that are flat within a layer or smaller than `nonplanar_min_area`."""
    normal, area = face_normals(mesh.vertices, mesh.faces)
    slope = np.degrees(np.arccos(np.clip(normal[:, 2], -1.0, 1.0)))
    return _drop_small_and_flat(mesh, region, twin, slope, area * normal[:, 2], settings)


def components(region: BoolArray, twin: IntArray) -> tuple[int, IntArray]:
    """How many pieces joined by edges the region has, and the piece of every face (m,), -1 outside."""
    rows = np.flatnonzero(region)
    half = (3 * rows[:, None] + np.arange(3)).ravel()
    across = np.where(twin[half] >= 0, twin[half] // 3, -1)
    joined = (across >= 0) & region[across]
    number = np.cumsum(region) - 1
    a, b = number[half[joined] // 3], number[across[joined]]
    graph = coo_array((np.ones(len(a), np.int8), (a, b)), shape=(len(rows), len(rows)))
    count, label = connected_components(graph, directed=False)
    piece = np.full(len(region), -1, np.int64)
    piece[rows] = label
    return int(count), piece


def _printable(mesh: Mesh, rows: IntArray, cosine: FloatArray, settings: PrintSettings) -> BoolArray:
    """Which of the faces `rows` see the sky everywhere and stand on enough material."""
    points, owner = _samples(mesh.triangles[rows])
    above, below = build_grid(mesh.triangles).column(points, RAY_CLEARANCE)
    needed = settings.nonplanar_layers * settings.layer_height / cosine + settings.first_height
    bad = np.isfinite(above) | (below < needed[owner] - RAY_CLEARANCE)
    return np.asarray(np.bincount(owner, bad, len(rows)) == 0)


def _samples(triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points inside triangles (m, 3, 3), (n, 3), and the triangle of each: near the corners, the centre, and a net."""
    edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    rows = np.clip(np.ceil(edges / SAMPLE_DISTANCE).astype(np.int64), 1, MOST_SAMPLES)
    points, owner = [], []
    for count in np.unique(rows):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        keep = i + j <= count
        net = np.stack([i[keep], j[keep], count - i[keep] - j[keep]], axis=1) / count
        net = np.vstack([np.full(3, 1 / 3), 0.98 * net + 0.02 / 3])
        which = np.flatnonzero(rows == count)
        points.append(np.einsum("sk,mkd->msd", net, triangles[which]).reshape(-1, 3))
        owner.append(np.repeat(which, len(net)))
    return np.concatenate(points), np.concatenate(owner)


def _smooth_border(region: BoolArray, wide: BoolArray, twin: IntArray) -> BoolArray:
    """Take in faces of `wide` that have two neighbours in the region; twice."""
    across = np.where(twin >= 0, twin // 3, 0).reshape(-1, 3)
    known = (twin >= 0).reshape(-1, 3)
    for _ in range(2):
        neighbours = (region[across] & known).sum(axis=1)
        region = region | (wide & (neighbours >= 2))
    return region


def _plateaus(
    mesh: Mesh,
    flat: BoolArray,
    twin: IntArray,
    normal: FloatArray,
    footprint: FloatArray,
    settings: PrintSettings,
) -> BoolArray:
    """Of the flat faces, those of pieces with an edge all around; not of pieces below `nonplanar_min_area`."""
    count, piece = components(flat, twin)
    if not count:
        return flat
    half = (3 * np.flatnonzero(flat)[:, None] + np.arange(3)).ravel()
    face, across = half // 3, np.where(twin[half] >= 0, twin[half], half) // 3
    border = (across == face) | (piece[across] != piece[face])
    half, face, across = half[border], face[border], across[border]
    ends = mesh.triangles[face, half % 3], mesh.triangles[face, (half % 3 + 1) % 3]
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    bend = (normal[face] * normal[across]).sum(axis=1)
    smooth = (bend > np.cos(np.radians(FLAT_EDGE_DEG))) & (across != face)
    total = np.bincount(piece[face], length, count)
    edged = np.bincount(piece[face], length * smooth, count) <= 0.02 * total
    large = np.bincount(piece[flat], footprint[flat], count) >= settings.nonplanar_min_area
    return flat & (edged & large)[piece]


def _drop_small_and_flat(
    mesh: Mesh, region: BoolArray, twin: IntArray, slope: FloatArray, footprint: FloatArray, settings: PrintSettings
) -> BoolArray:
    count, piece = components(region, twin)
    inside = piece[region]
    area = np.bincount(inside, footprint[region], count)
    steep = np.bincount(inside, footprint[region] * (slope[region] > FLAT_DEG), count)
    z = mesh.triangles[region][:, :, 2]
    top = np.full(count, -np.inf)
    bottom = np.full(count, np.inf)
    np.maximum.at(top, inside, z.max(axis=1))
    np.minimum.at(bottom, inside, z.min(axis=1))
    flat = (steep <= 0.02 * area) & (top - bottom <= settings.layer_height)
    keep = ~flat & (area >= settings.nonplanar_min_area)
    return region & np.where(piece >= 0, keep[piece], False) if count else region
