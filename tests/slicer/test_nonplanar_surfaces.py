"""Normals, offsets, searches from above: the geometry under the non-planar layers."""

from itertools import pairwise

import manifold3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trunnion_core.arrays import FloatArray
from trunnion_core.mesh import Mesh
from trunnion_slicer.nonplanar.grid import build_grid
from trunnion_slicer.nonplanar.normals import face_normals, mean_normals, offset_steps
from trunnion_slicer.nonplanar.offset import offset_surfaces, prism_volumes
from trunnion_slicer.nonplanar.patch import Patch, split_patches
from trunnion_slicer.section_kernels import twins

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
CUBE_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def sheet(z: FloatArray, x: FloatArray, y: FloatArray) -> Mesh:
    """An open height field over the net x, y."""
    nx, ny = len(x), len(y)
    corner = np.arange(nx * ny).reshape(nx, ny)
    a, b = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel()
    c, d = corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    net = np.stack([*np.meshgrid(x, y, indexing="ij"), z], axis=2)
    return Mesh(net.reshape(-1, 3), faces)


def patch_of(mesh: Mesh) -> Patch:
    twin = twins(np.ascontiguousarray(mesh.faces), len(mesh.vertices))
    (patch,) = split_patches(mesh, np.ones(len(mesh.faces), np.bool_), twin)
    return patch


def ridge(step: float, slope: float = 25.0) -> Mesh:
    """A roof of two planes that meet at x = 0."""
    x = np.arange(-5.0, 5.0 + step / 2, step)
    y = np.arange(-3.0, 3.0 + step / 2, step)
    return sheet(np.repeat(-np.abs(x)[:, None] * np.tan(np.radians(slope)), len(y), axis=1), x, y)


def test_a_cube_corner_has_the_diagonal_as_normal_however_its_faces_are_split() -> None:
    mean = mean_normals(CUBE, CUBE_FACES)
    unit = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    assert_allclose(unit, (2 * CUBE - 1) / np.sqrt(3), atol=1e-12)


def test_the_step_at_a_crease_moves_both_planes_by_the_whole_distance() -> None:
    mesh = ridge(2.5)
    steps = offset_steps(mean_normals(mesh.vertices, mesh.faces))
    normal, _ = face_normals(mesh.vertices, mesh.faces)
    for corner in range(3):
        assert_allclose((steps[mesh.faces[:, corner]] * normal).sum(axis=1), -1.0, atol=1e-9)


def test_offsets_of_a_sphere_are_spheres() -> None:
    x = np.linspace(-8, 8, 41)
    z = np.sqrt(30.0**2 - x[:, None] ** 2 - x[None, :] ** 2)
    patch = patch_of(sheet(z, x, x))
    stack = offset_surfaces(patch, 5, 0.3)
    inner = np.setdiff1d(np.arange(len(patch.vertices)), patch.border)
    for depth, surface in enumerate(stack.surfaces):
        assert_allclose(np.linalg.norm(surface[inner], axis=1), 30 - 0.3 * depth, atol=2e-3)


def test_volume_between_spheres_agrees_with_the_curvature_formula() -> None:
    x = np.linspace(-8, 8, 81)
    z = np.sqrt(30.0**2 - x[:, None] ** 2 - x[None, :] ** 2)
    patch = patch_of(sheet(z, x, x))
    stack = offset_surfaces(patch, 2, 0.5)
    _, area = face_normals(patch.vertices, patch.faces)
    volume = prism_volumes(stack.surfaces[0][patch.faces], stack.surfaces[1][patch.faces])
    assert volume.sum() == pytest.approx(area.sum() * 0.5 * (1 - 0.5 / 30 + 0.25 / (3 * 900)), rel=1e-3)


def test_densities_share_out_exactly_the_volume_between_the_surfaces() -> None:
    stack = offset_surfaces(patch_of(ridge(0.5)), 1, 0.2)
    faces = stack.patch.faces
    triangles = stack.surfaces[0][faces]
    flat = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2] / 2
    integral = (flat * stack.densities(0)[faces].mean(axis=1)).sum()
    assert integral == pytest.approx(prism_volumes(triangles, stack.surfaces[1][faces]).sum(), rel=1e-12)


@pytest.mark.parametrize("tile", [2.5, 0.25, 0.1])
def test_layers_under_a_ridge_keep_their_thickness_however_fine_the_tiles(tile: float) -> None:
    # Fine tiles would pass through the ridge: each layer moves them towards it by 0.3 sin(25 deg) = 0.127 mm.
    patch = patch_of(ridge(tile))
    stack = offset_surfaces(patch, 2, 0.3)
    assert stack.layers == 2
    inner = (np.abs(patch.vertices[:, :2]) < 2.5).all(axis=1)
    moved = stack.surfaces[2][inner]
    ideal = -np.abs(moved[:, 0]) * np.tan(np.radians(25)) - 0.6 / np.cos(np.radians(25))
    assert np.abs(moved[:, 2] - ideal).max() < 0.1
    assert np.abs(moved[:, 2] - ideal).mean() < 0.015


def test_a_tight_dome_takes_as_many_layers_as_its_radius_holds() -> None:
    x = np.linspace(-1.2, 1.2, 25)
    z = np.sqrt(2.0**2 - x[:, None] ** 2 - x[None, :] ** 2)
    stack = offset_surfaces(patch_of(sheet(z, x, x)), 8, 0.3)
    assert 5 <= stack.layers <= 6


def test_fans_that_touch_in_one_vertex_get_one_vertex_each() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [2, 4, 5], [2, 5, 6]])
    twin = twins(faces, len(vertices))
    patches = split_patches(Mesh(vertices, faces), np.ones(4, np.bool_), twin)
    assert [len(patch.vertices) for patch in patches] == [4, 4]


def test_a_ring_that_touches_itself_has_no_pinched_vertex() -> None:
    """Two triangles joined over a strip and once more at a point: the border passes that point twice."""
    vertices = np.array([[0, 0, 0], [2, -1, 0], [2, 1, 0], [4, 0, 0], [2, 3, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]])  # a closed fan around vertex 2: no pinch
    patch = patch_of(Mesh(vertices, faces))
    assert len(patch.vertices) == 5
    open_fan = patch_of(Mesh(vertices, faces[:3]))
    _, count = np.unique(open_fan.border[:, 0], return_counts=True)
    assert (count == 1).all()


def test_border_vertices_at_a_vertical_wall_stay_on_it() -> None:
    twin = twins(CUBE_FACES, 8)
    tilted = CUBE.copy()
    tilted[:, 2] += 0.4 * CUBE[:, 0] * CUBE[:, 2]
    region = np.zeros(12, np.bool_)
    region[10:] = True
    (patch,) = split_patches(Mesh(tilted, CUBE_FACES), region, twin)
    moved = patch.vertices + 0.1 * patch.steps
    assert_allclose(moved[:, :2], patch.vertices[:, :2], atol=1e-3)
    thickness = (patch.steps * patch.normals).sum(axis=1)
    assert_allclose(thickness, -1.0, atol=2e-3)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31))
def test_locate_finds_the_triangle_that_a_full_search_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = np.sort(rng.uniform(0, 10, 6)), np.sort(rng.uniform(0, 10, 7))
    mesh = sheet(rng.uniform(0, 3, (6, 7)), x, y)
    grid = build_grid(mesh.triangles)
    points = rng.uniform([x[0], y[0]], [x[-1], y[-1]], (50, 2))
    triangle, weights = grid.locate(points)
    assert (weights >= -1e-9).all()
    there = np.einsum("nk,nkd->nd", weights, mesh.triangles[triangle])
    assert_allclose(there[:, :2], points, atol=1e-9)


def test_a_point_outside_gets_the_nearest_point_of_the_nearest_triangle() -> None:
    mesh = sheet(np.zeros((5, 5)), np.arange(5.0), np.arange(5.0))
    grid = build_grid(mesh.triangles)
    triangle, weights = grid.locate(np.array([[-3.0, 1.5], [7.0, 9.0]]))
    there = np.einsum("nk,nkd->nd", weights, mesh.triangles[triangle])[:, :2]
    assert_allclose(there, [[0.0, 1.5], [4.0, 4.0]], atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31))
def test_cut_lines_have_every_piece_over_one_triangle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = sheet(rng.uniform(0, 3, (6, 6)), np.arange(6.0), np.arange(6.0))
    grid = build_grid(mesh.triangles)
    line = rng.uniform(0.0, 5.0, (5, 2))
    points, starts = grid.cut(np.concatenate([line, line[::-1]]), np.array([0, 5, 10]))
    assert starts[0] == 0
    assert starts[-1] == len(points)
    for a, b in pairwise(starts):
        run = points[a:b]
        total = np.linalg.norm(np.diff(run, axis=0), axis=1).sum()
        assert total == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum(), rel=1e-9)
        near = np.stack([0.999 * run[:-1] + 0.001 * run[1:], 0.001 * run[:-1] + 0.999 * run[1:]])
        length = np.linalg.norm(np.diff(run, axis=0), axis=1)
        both = [grid.locate(points_)[0] for points_ in near]
        assert (both[0] == both[1])[length > 1e-3].all()


def test_rays_see_what_is_above_and_below() -> None:
    solid = manifold3d.Manifold.cube([10, 10, 2]) + manifold3d.Manifold.cube([4, 4, 1]).translate([3, 3, 5])
    found = solid.to_mesh64()
    mesh = Mesh(found.vert_properties[:, :3].copy(), found.tri_verts.astype(np.int64))
    above, below = build_grid(mesh.triangles).column(np.array([[5.0, 5.2, 2.0], [1.0, 1.3, 2.0]]), 1e-3)
    assert_allclose(above, [3.0, np.inf])
    assert_allclose(below, [2.0, 2.0])
