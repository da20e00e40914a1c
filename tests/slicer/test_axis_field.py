"""The field of tool axes over a surface: facets vanish, tessellations agree, lines agree, creases stay."""

import numpy as np
import pytest

from trunnion_core.mesh import Mesh
from trunnion_slicer.nonplanar.field import even_axes, normals_at
from trunnion_slicer.nonplanar.grid import Grid, build_grid
from trunnion_slicer.nonplanar.orient import corner_normals, inherited

RADIUS = 25.0
TOLERANCE = np.radians(2.0)
X, Y = np.arange(-13, 13.001, 0.2), np.arange(-6, 6.001, 0.4)
LINES = np.stack([*np.meshgrid(X, Y), np.zeros((len(Y), len(X)))], axis=-1)
"""(lines, rows, 3) mm, along x."""


def dome(rings: int, around: int, turn: float) -> Mesh:
    """The top of a sphere, out to 16 mm, as rings of triangles, turned by `turn` rad."""
    vertices = [np.array([[0.0, 0.0, RADIUS]])]
    for ring, radius in enumerate(np.linspace(0, 16, rings + 1)[1:]):
        angle = turn + (np.arange(around) + 0.5 * (ring % 2)) * 2 * np.pi / around
        height = np.full(around, np.sqrt(RADIUS**2 - radius**2))
        vertices.append(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]))
    here = np.arange(around)
    following = (here + 1) % around
    faces = [np.column_stack([np.zeros_like(here), 1 + here, 1 + following])]
    for ring in range(rings - 1):
        a, b = 1 + ring * around + here, 1 + ring * around + following
        c, d = a + around, b + around
        if ring % 2:
            faces += [np.column_stack([a, c, d]), np.column_stack([a, d, b])]
        else:
            faces += [np.column_stack([a, c, b]), np.column_stack([b, c, d])]
    return Mesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int64))


def over(mesh: Mesh) -> tuple[Grid, np.ndarray, np.ndarray]:
    """The grid over a mesh, its normals at corners, and those at LINES."""
    grid, corners = build_grid(mesh.triangles), corner_normals(mesh, np.ones(len(mesh.faces), np.bool_))
    return grid, corners, normals_at(np.ascontiguousarray(LINES[..., :2].reshape(-1, 2)), grid, corners)[0]


def field(mesh: Mesh) -> np.ndarray:
    grid, corners, _ = over(mesh)
    return even_axes(LINES.reshape(-1, 3), grid, corners, TOLERANCE).reshape(LINES.shape)


def bends(axes: np.ndarray, way: int) -> float:
    """Greatest second difference between rows (1) or lines (0), degrees."""
    return float(np.degrees(np.linalg.norm(np.diff(axes.reshape(LINES.shape), 2, axis=way), axis=2)).max())


def apart(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.degrees(2 * np.arcsin(np.linalg.norm(one - other, axis=-1) / 2)).max())


@pytest.mark.parametrize(("rings", "around"), [(10, 36), (7, 24)])
def test_facets_vanish_along_lines_and_between_them(rings: int, around: int) -> None:
    mesh = dome(rings, around, 0.1)
    normals, axes = over(mesh)[2], field(mesh)
    true = np.concatenate([LINES[..., :2] / RADIUS, np.zeros((*LINES.shape[:2], 1))], axis=-1)
    true[..., 2] = np.sqrt(1 - (true**2).sum(axis=-1))
    assert bends(axes, 1) < 0.3 * bends(normals, 1)
    assert bends(axes, 0) < 0.5 * bends(normals, 0)
    assert bends(axes, 1) < 1.1 * bends(true, 1)
    assert apart(axes, normals.reshape(LINES.shape)) < np.degrees(TOLERANCE)


def test_tessellations_of_one_dome_agree() -> None:
    """Their own normals are up to half a degree apart."""
    fields = [field(dome(*mesh)) for mesh in ((10, 36, 0.0), (13, 52, 0.3), (7, 24, 0.1), (40, 160, 0.0))]
    assert max(apart(fields[0], other) for other in fields[1:]) < 0.2


def test_a_plane_keeps_its_normal_and_so_does_each_side_of_a_ridge() -> None:
    slope = np.tan(np.radians(20.0))
    x, z = np.array([-15.0, 0.0, 15.0]), np.array([-15 * slope, 0.0, -15 * slope])
    vertices = np.concatenate([np.column_stack([x, np.full(3, y), z]) for y in (-8.0, 8.0)])
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    axes = field(Mesh(vertices, faces))
    for side, lean in ((LINES[..., 0] < -0.6, -20.0), (LINES[..., 0] > 0.6, 20.0)):
        normal = np.array([np.sin(np.radians(lean)), 0.0, np.cos(np.radians(lean))])
        assert apart(axes[side], np.broadcast_to(normal, axes[side].shape)) < 1e-6


def test_the_border_of_a_region_does_not_bend_its_normals() -> None:
    mesh = dome(10, 36, 0.0)
    everywhere = corner_normals(mesh, np.ones(len(mesh.faces), np.bool_))
    inner = mesh.triangles[:, :, :2].mean(axis=1)[:, 0] < 3.0
    some = corner_normals(mesh, inner)
    assert (some[inner] == everywhere[inner]).all()
    assert not some[~inner].any()


def test_parts_of_a_face_stand_as_the_face_does() -> None:
    random = np.random.default_rng(3)
    whole = random.normal(0, 1, (50, 3, 3))
    normals = np.array([0.0, 0.0, 1.0]) + random.normal(0, 0.1, (50, 3, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    share = random.dirichlet(np.ones(3), (50, 3))
    parts = np.einsum("mck,mkd->mcd", share, whole)
    wanted = np.einsum("mck,mkd->mcd", share, normals)
    wanted /= np.linalg.norm(wanted, axis=2, keepdims=True)
    assert apart(inherited(parts, whole, normals), wanted) < 1e-5
