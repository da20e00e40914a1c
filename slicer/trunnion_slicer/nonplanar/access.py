"""Where the print head can stand on the skin without entering the part: the rest stays planar.

Section 2.3 of Shahid 2024 tests the extruder's collider at the vertices of candidate triangles and leaves the motion
between them to luck. Here the head, as solids of revolution about its axis, stands at every corner of every face of
the region, on the skin and at the depth of the lowest layer, and large faces are split until their corners tell the
whole truth. The border between what is reachable and what is not is then cut through the faces, where the clearance is
zero, so that it does not depend on the tessellation. What is given up becomes planar stairs, which stand higher than
the skin did, so the test is repeated until nothing more is lost.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, check_array
from trunnion_core.findings import Finding
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings
from trunnion_core.solid_tables import SolidTable
from trunnion_slicer.nonplanar.head import frusta
from trunnion_slicer.nonplanar.material import Material, material, spread_points
from trunnion_slicer.nonplanar.normals import face_normals
from trunnion_slicer.nonplanar.orient import corner_normals, inherited
from trunnion_slicer.nonplanar.patch import split_patches
from trunnion_slicer.nonplanar.regions import worthwhile
from trunnion_slicer.nonplanar.split import split_edges
from trunnion_slicer.section_kernels import twins

SQUEEZE = 0.05
"""mm above the plane of the tip up to which plastic does not count: the flat of the nozzle smooths that much."""

MARGIN = 0.1
"""mm kept between the head and the skin: what two neighbouring points of `material` can miss."""

FINE = 1.0
"""mm. Edges of faces that are partly reachable are split down to this before the border is cut."""

SLACK = 0.04
"""mm of MARGIN that may be missing: a border that is moved by less is not moved again."""

NEAR = 0.5
"""mm. Clearance beyond this is not looked for."""

UPRIGHT = 0.35
"""Tangent of the lean up to which a face under a border is a wall, cut down together with the skin that ends on it."""

SNAP = 0.15
"""Share of an edge: the border runs through a free corner rather than nearer to it, never nearer to a blocked one."""

SAME_AXIS = 1e-5
"""Tool axes that differ by less are tested once."""

MANY = 20_000
"""Poses that are tested one by one."""

BESIDE = 0.4
"""mm: a bead's width, in which one pose stands for all of many."""

ALIKE = 0.05
"""Difference of unit vectors up to which tool axes of such poses count as one direction: 3 degrees."""

ROUNDS = 6
"""How often the test is repeated at most."""

SPLITS = 16
"""How often faces are split at most: by half each time, from any size of face."""


@dataclass(frozen=True, eq=False)
class Reach:
    """What of a region the head can reach."""

    mesh: Mesh
    """The mesh with faces split where the border of what is reachable runs through them."""
    parent: IntArray
    """(m,) the face of the input mesh that every face lies on."""
    region: BoolArray
    """(m,) reachable faces worth printing non-planar."""
    normals: FloatArray
    """(m, 3, 3) unit: where the tool stands at the corners of the region's faces, as on the input mesh; 0 elsewhere."""
    findings: tuple[Finding, ...]
    scene: "Scene | None"
    """What stands around the region, to try other poses in; None without bodies or a region."""


def reachable(
    mesh: Mesh, region: BoolArray, settings: PrintSettings, head: Sequence[SolidTable], layers: int = 1
) -> Reach:
    """The part of `region` (m,) in which no body of the `head` keeps the nozzle from any of `layers` layers.

    The mesh is in `part`; the bodies are in the tool frame, mm. The tool stands along the averaged normals, or
    upright where the settings say so. Without bodies everything is reachable. One finding names each body that
    is in the way, where, and how many mm² (seen from above) stay planar for it.
    """
    check_array("region", region, (len(mesh.faces),))
    bodies = frusta(head)
    parent = np.arange(len(mesh.faces))
    whole, normals = mesh.triangles, corner_normals(mesh, region)
    if not len(bodies) or not region.any():
        return Reach(mesh, parent, region, normals, (), None)
    before = footprints_of(mesh, region).sum()
    scene = None
    lost = np.zeros(len(bodies))
    worst = np.full(len(bodies), np.inf)
    where = np.zeros((len(bodies), 3))
    for _ in range(ROUNDS):
        scene = Scene(mesh, region, settings, bodies, (layers - 1) * settings.layer_height, whole, normals)
        mesh, region, parent = _split_mixed(scene, mesh, region, parent)
        clearance, body = _at_corners(scene, mesh, region, parent)
        if clearance.min() >= -SLACK:
            break
        face, corner = np.nonzero(clearance < 0)
        gap, guilty = clearance[face, corner], body[face, corner]
        np.minimum.at(worst, guilty, gap)
        deepest = gap == worst[guilty]
        where[guilty[deepest]] = mesh.triangles[face, corner][deepest]
        first = clearance.argmin(axis=1)
        of_face = body[np.arange(len(body)), first]
        mesh, region, came, gone = _cut(mesh, region, clearance)
        parent = parent[came]
        lost += np.bincount(of_face[came][gone], footprints_of(mesh, gone)[gone], len(bodies))
        region = worthwhile(mesh, region, _twin(mesh), settings)
        if not region.any():
            break
    findings = tuple(
        _blocked(head[number].name, float(lost[number]), before, float(worst[number]), where[number])
        for number in np.flatnonzero(lost > 0).tolist()
    )
    assert scene is not None
    return Reach(mesh, parent, region, scene.tool_axes(mesh, region, parent), findings, scene)


class Scene:
    """The part as it stands around a region, and the bodies that must not enter it."""

    def __init__(
        self,
        mesh: Mesh,
        region: BoolArray,
        settings: PrintSettings,
        bodies: FloatArray,
        depth: float,
        whole: FloatArray,
        normals: FloatArray,
    ) -> None:
        self.bodies = bodies
        self.whole, self.normals = whole, normals
        self.depth = depth
        self.upright = settings.nonplanar_tool_axis == "vertical"
        self.skin: Material = material(mesh.vertices, mesh.faces, settings.extrusion_width / 2)
        normal, _ = face_normals(mesh.vertices, mesh.faces)
        on_skin = region[self.skin.face]
        # Planar stairs stand up to half a layer above the surface that they stand for.
        self.margins = np.where(on_skin, MARGIN, MARGIN + settings.layer_height / 2)
        self.sinks = np.where(on_skin, 1.0 / np.maximum(normal[self.skin.face, 2], 0.1), 0.0)
        walls = self._walls(mesh, region)
        self.sinks[walls] = 1.0
        self.margins[walls] = MARGIN

    def tool_axes(self, mesh: Mesh, region: BoolArray, parent: IntArray) -> FloatArray:
        """(m, 3, 3) unit at the corners of the region's faces, each a part of an input face; 0 elsewhere."""
        axes = np.zeros((len(mesh.faces), 3, 3))
        whole = parent[region]
        axes[region] = inherited(mesh.triangles[region], self.whole[whole], self.normals[whole])
        return axes

    def _walls(self, mesh: Mesh, region: BoolArray) -> IntArray:
        """Points that are no skin, but rise and fall with it: tops of walls that end at its border."""
        sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
        twin = _twin(mesh)
        half = np.flatnonzero(np.repeat(region, 3) & ((twin < 0) | ~region[twin // 3]))
        ends = mesh.vertices[sides[half]]
        edges, _ = spread_points(np.concatenate([ends, ends[:, 1:]], axis=1), SQUEEZE)
        outside = np.flatnonzero(self.sinks == 0)
        points = self.skin.points[outside]
        tree = cKDTree(edges[:, :2])
        reach = max(self.depth, SQUEEZE)
        away, closest = (np.asarray(found) for found in tree.query(points[:, :2], distance_upper_bound=reach))
        near = np.isfinite(away)
        under = edges[closest[near], 2] - points[near, 2]
        return np.asarray(outside[near][(away[near] <= UPRIGHT * under + SQUEEZE) & (under > -SQUEEZE)])

    def clearance(self, tips: FloatArray, axes: FloatArray, steps: FloatArray) -> tuple[FloatArray, IntArray]:
        """Least clearance (n,) and its body of the head on the skin (n, 3) and on the lowest layer under it."""
        least, body = np.full(len(tips), NEAR), np.full(len(tips), -1, np.int64)
        for depth in sorted({0.0, self.depth}):
            gap, nearby = self._nearest(tips + depth * steps, axes, depth, NEAR)
            body = np.where(gap < least, nearby, body)
            least = np.minimum(gap, least)
        return least, body

    def gap(self, tips: FloatArray, axes: FloatArray, far: float, *, depth: float) -> FloatArray:
        """Clearance (n,) of the head at poses (n, 3) on the layer that lies `depth` mm under the skin.

        Clearance beyond `far` mm is not looked for, and that is returned.
        """
        gap, _ = self._nearest(tips, axes, depth, far)
        return gap

    def _nearest(self, tips: FloatArray, axes: FloatArray, depth: float, far: float) -> tuple[FloatArray, IntArray]:
        from trunnion_slicer.nonplanar.access_kernel import nearest

        gap, body, _ = nearest(
            np.ascontiguousarray(tips),
            np.ascontiguousarray(axes),
            depth,
            self.bodies,
            SQUEEZE,
            far,
            self.skin.points,
            self.sinks,
            self.margins,
            self.skin.room_start,
            self.skin.room_ball,
            self.skin.cube_start,
            self.skin.cube_ball,
        )
        return gap, body


def _poses(scene: Scene, mesh: Mesh, region: BoolArray, parent: IntArray) -> tuple[FloatArray, FloatArray]:
    """Tool axes and inward steps (m, 3, 3) at the corners of the region's faces; zero elsewhere."""
    axes = scene.tool_axes(mesh, region, parent)
    steps = np.zeros((len(mesh.faces), 3, 3))
    for patch in split_patches(mesh, region, _twin(mesh)):
        steps[patch.rows] = patch.steps[patch.faces]
    if scene.upright:
        axes[:] = (0.0, 0.0, 1.0)
    return axes, steps


def _at_corners(scene: Scene, mesh: Mesh, region: BoolArray, parent: IntArray) -> tuple[FloatArray, IntArray]:
    """Clearance and nearest body (m, 3) at the corners of the region's faces; NEAR and 0 elsewhere.

    A corner shared by faces that hold the tool differently (a crease) has the least clearance of them all.
    """
    axes, steps = _poses(scene, mesh, region, parent)
    clearance = np.full((len(mesh.faces), 3), NEAR)
    body = np.zeros((len(mesh.faces), 3), np.int64)
    corner = mesh.faces[region].ravel()
    lean = np.round(axes[region].reshape(-1, 3) / SAME_AXIS).astype(np.int64)
    _, first = np.unique(np.column_stack([corner, lean]), axis=0, return_index=True)
    poses = [value[region].reshape(-1, 3)[first] for value in (mesh.triangles, axes, steps)]
    tested, same = _tested_once(poses[0], poses[1])
    gap, nearest = scene.clearance(*(value[tested] for value in poses))
    gap, nearest = gap[same], nearest[same]
    order = np.lexsort((gap, corner[first]))
    least = order[np.concatenate([[True], np.diff(corner[first][order]) != 0])]
    at, by = np.full(len(mesh.vertices), NEAR), np.zeros(len(mesh.vertices), np.int64)
    at[corner[first][least]], by[corner[first][least]] = gap[least], np.maximum(nearest[least], 0)
    clearance[region], body[region] = at[mesh.faces[region]], by[mesh.faces[region]]
    return clearance, body


def _tested_once(tips: FloatArray, axes: FloatArray) -> tuple[IntArray, IntArray]:
    """Which of many poses (n, 3) stand for all, and the place in them of the one that stands for each (n,).

    Up to MANY every pose is tested. A finer mesh says nothing new about where the head fits: there, poses in one cube
    of a BESIDE and of nearly one direction are tested once.
    """
    if len(tips) <= MANY:
        return np.arange(len(tips)), np.arange(len(tips))
    keys = np.column_stack([np.floor(tips / BESIDE), np.round(axes / ALIKE)]).astype(np.int64)
    _, tested, same = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return tested, same.ravel()


def _split_mixed(scene: Scene, mesh: Mesh, region: BoolArray, parent: IntArray) -> tuple[Mesh, BoolArray, IntArray]:
    """Split faces that are reachable in one place and not in another, until their edges are at most FINE long."""
    axes, steps = _poses(scene, mesh, region, parent)
    suspect = region.copy()
    for _ in range(SPLITS):
        length = np.linalg.norm(np.roll(mesh.triangles, -1, axis=1) - mesh.triangles, axis=2)
        rows = np.flatnonzero(suspect & (length.max(axis=1) > FINE))
        if not rows.size:
            break
        mixed = rows[_mixed(scene, mesh.triangles[rows], axes[rows], steps[rows])]
        if not mixed.size:
            break
        sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2)[mixed]
        # The longest edge only: faces stay as round as they were, and rounds are few.
        long = length[mixed] > np.maximum(0.7 * length[mixed].max(axis=1, keepdims=True), FINE)
        edges = np.unique(np.sort(sides[long], axis=1), axis=0)
        vertices, faces, came = split_edges(mesh.vertices, mesh.faces, edges, np.full(len(edges), 0.5))
        touched = np.zeros(len(mesh.faces), np.bool_)
        touched[mixed] = True
        changed = np.bincount(came, minlength=len(mesh.faces)) > 1
        mesh, region, parent = Mesh(vertices, faces), region[came], parent[came]
        suspect = region & (touched | (changed & suspect))[came]
        axes, steps = _poses(scene, mesh, region, parent)
    return mesh, region, parent


def _mixed(scene: Scene, triangles: FloatArray, axes: FloatArray, steps: FloatArray) -> BoolArray:
    """Which triangles (m, 3, 3) are reachable at some of the points spread over them and not at others."""
    points, owner = spread_points(triangles, FINE)
    weights = _weights(points, triangles[owner])
    lean = np.einsum("nk,nkd->nd", weights, axes[owner])
    lean /= np.linalg.norm(lean, axis=1, keepdims=True)
    gap, _ = scene.clearance(points, lean, np.einsum("nk,nkd->nd", weights, steps[owner]))
    blocked = np.bincount(owner, gap < 0, len(triangles))
    return np.asarray((blocked > 0) & (blocked < np.bincount(owner, minlength=len(triangles))))


def _weights(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of points (n, 3) in triangles (n, 3, 3)."""
    a = triangles[:, 1] - triangles[:, 0]
    b = triangles[:, 2] - triangles[:, 0]
    q = points - triangles[:, 0]
    aa, ab, bb = ((x * y).sum(axis=1) for x, y in ((a, a), (a, b), (b, b)))
    qa, qb = (q * a).sum(axis=1), (q * b).sum(axis=1)
    area = np.maximum(aa * bb - ab * ab, 1e-300)
    v, w = (bb * qa - ab * qb) / area, (aa * qb - ab * qa) / area
    return np.stack([1 - v - w, v, w], axis=1)


def _cut(mesh: Mesh, region: BoolArray, clearance: FloatArray) -> tuple[Mesh, BoolArray, IntArray, BoolArray]:
    """Cut the region's faces where the clearance (m, 3) is zero: mesh, what stays, the old faces, and what is lost."""
    at = np.full(len(mesh.vertices), NEAR)
    at[mesh.faces[region]] = clearance[region]
    sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2)[region].reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    edges = np.where((at[edges[:, 0]] < 0)[:, None], edges, edges[:, ::-1])
    blocked, free = at[edges].T
    crossing = (blocked < 0) & (free >= 0)
    edges, share = edges[crossing], (blocked / np.minimum(blocked - free, -1e-12))[crossing]
    at[edges[share > 1 - SNAP, 1]] = 0.0
    kept = at[edges[:, 1]] > 0
    share = np.maximum(share, SNAP)
    vertices, faces, came = split_edges(mesh.vertices, mesh.faces, edges[kept], share[kept])
    at = np.concatenate([at, np.zeros(int(kept.sum()))])
    least, most = at[faces].min(axis=1), at[faces].max(axis=1)
    lost = region[came] & ((least < 0) | (most <= 0))
    return Mesh(vertices, faces), region[came] & ~lost, came, lost


def footprints_of(mesh: Mesh, region: BoolArray) -> FloatArray:
    """(m,) mm² of the region's faces seen from above."""
    normal, area = face_normals(mesh.vertices, mesh.faces)
    return np.where(region, area * normal[:, 2], 0.0)


def _twin(mesh: Mesh) -> IntArray:
    found: IntArray = twins(np.ascontiguousarray(mesh.faces), len(mesh.vertices))
    return found


def _blocked(name: str, area: float, before: float, depth: float, tip: FloatArray) -> Finding:
    x, y, z = (float(value) for value in tip)
    return Finding(
        "nonplanar-head-blocked",
        "warning",
        f"{name} would enter the part on {area:.1f} of {before:.1f} mm² of skin, which stay planar; worst with the tip "
        f"at ({x:.2f}, {y:.2f}, {z:.2f}) mm, where {-depth:.2f} mm are missing",
        value=area,
        limit=before,
        point=(x, y, z),
    )
