"""Broken meshes are mended with every repair listed, or refused with the place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manifold3d import Manifold
from numpy.testing import assert_allclose, assert_array_equal

from trunnion_core.errors import MeshError
from trunnion_core.mesh import Mesh
from trunnion_slicer.bodies import manifold_of, mesh_of, volumes
from trunnion_slicer.repair import CODES, make_solid

CUBE = mesh_of(Manifold.cube([10, 10, 10]).refine(3))
BALL = mesh_of(Manifold.sphere(10, 48))


def together(*meshes):
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def moved(mesh, shift, scale=1.0):
    return Mesh(mesh.vertices * scale + np.asarray(shift, dtype=float), mesh.faces.copy())


def inside_out(mesh):
    return Mesh(mesh.vertices.copy(), mesh.faces[:, ::-1].copy())


def without(mesh, faces):
    return Mesh(mesh.vertices.copy(), np.delete(mesh.faces, faces, axis=0))


def volume(mesh):
    return volumes(mesh.vertices, mesh.faces, np.zeros(len(mesh.faces), dtype=int))[0]


def mended(mesh, expected_volume, *codes):
    """The solid of a mesh, checked to be one, of that volume, with findings of just those codes."""
    solid, findings = make_solid(mesh)
    assert tuple(finding.code for finding in findings) == codes
    assert all(finding.severity == CODES[finding.code][0] for finding in findings)
    assert all(finding.point is not None and finding.count >= 1 for finding in findings)
    assert manifold_of(solid.vertices, solid.faces).status().name == "NoError"
    ends = np.stack([solid.faces, np.roll(solid.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    assert_array_equal(np.unique(ends, axis=0), np.unique(ends[:, ::-1], axis=0))
    assert volume(solid) == pytest.approx(expected_volume)
    return solid, findings


def test_a_clean_mesh_passes_with_its_triangles_untouched():
    solid, _ = mended(CUBE, 1000.0)
    key = np.lexsort(CUBE.triangles.reshape(-1, 9).T)
    other = np.lexsort(solid.triangles.reshape(-1, 9).T)
    assert_array_equal(solid.triangles[other], CUBE.triangles[key])


def test_a_soup_of_triangles_is_welded():
    soup = Mesh(CUBE.triangles.reshape(-1, 3).copy(), np.arange(3 * len(CUBE.faces)).reshape(-1, 3))
    solid, _ = mended(soup, 1000.0)
    assert len(solid.vertices) == len(CUBE.vertices)


def test_corners_a_hair_apart_are_joined():
    rng = np.random.default_rng(1)
    soup = CUBE.triangles.reshape(-1, 3) + rng.uniform(-2e-4, 2e-4, (3 * len(CUBE.faces), 3))
    solid, findings = make_solid(Mesh(soup, np.arange(len(soup)).reshape(-1, 3)))
    assert "mesh-gap-closed" in {finding.code for finding in findings}
    assert volume(solid) == pytest.approx(1000.0, rel=1e-3)


def test_a_small_hole_is_filled_and_its_place_named():
    top = int(np.argmax(BALL.triangles[:, :, 2].mean(axis=1)))
    holed = without(BALL, [top])
    _, (finding,) = mended(holed, volume(BALL), "mesh-hole-filled")
    assert_allclose(finding.point, BALL.triangles[top].mean(axis=0))
    assert "3 edges" in finding.message


def test_every_hole_is_its_own_finding():
    far_apart = [int(np.argmax(BALL.triangles[:, :, k].mean(axis=1))) for k in range(3)]
    mended(without(BALL, far_apart), volume(BALL), *["mesh-hole-filled"] * 3)


def test_a_missing_flat_side_is_capped_whatever_its_size():
    top = np.flatnonzero(CUBE.triangles[:, :, 2].min(axis=1) > 9.9)
    _, (finding,) = mended(without(CUBE, top), 1000.0, "mesh-hole-filled")
    assert finding.point == pytest.approx((5.0, 5.0, 10.0))


def test_a_large_bent_hole_is_refused():
    middle = BALL.triangles.mean(axis=1)
    with pytest.raises(MeshError, match=r"hole at \(.*\) mm, .* mm across with \d+ edges"):
        make_solid(without(BALL, np.flatnonzero(middle[:, 2] + 3 * np.sin(middle[:, 0]) > 0)))


@given(st.sets(st.integers(0, len(CUBE.faces) - 1), min_size=1, max_size=40))
def test_any_faces_turned_are_turned_back(turned):
    faces = CUBE.faces.copy()
    rows = sorted(turned)
    faces[rows] = faces[rows, ::-1]
    mended(Mesh(CUBE.vertices.copy(), faces), 1000.0, "mesh-winding")


def test_a_body_inside_out_is_turned():
    mended(inside_out(CUBE), 1000.0, "mesh-inside-out")


def test_faces_without_extent_and_faces_twice_are_dropped():
    flat = np.vstack([CUBE.faces, CUBE.faces[:2, [0, 0, 1]]])
    _, (finding,) = mended(Mesh(CUBE.vertices.copy(), flat), 1000.0, "mesh-degenerate-faces")
    assert finding.count == 2
    twice = Mesh(CUBE.vertices.copy(), np.vstack([CUBE.faces, CUBE.faces[5:8]]))
    _, (finding,) = mended(twice, 1000.0, "mesh-duplicate-faces")
    assert finding.count == 3
    mended(together(CUBE, CUBE), 1000.0, "mesh-duplicate-faces")


def test_overlapping_bodies_are_united_and_separate_ones_left_alone():
    _, (finding,) = mended(together(CUBE, moved(CUBE, [5, 5, 5])), 1875.0, "mesh-bodies-united")
    assert finding.count == 2
    mended(together(CUBE, moved(CUBE, [20, 0, 0])), 2000.0)
    mended(together(CUBE, moved(CUBE, [2, 2, 2], 0.5)), 1000.0, "mesh-bodies-united")


def test_bodies_that_touch_become_one():
    mended(together(CUBE, moved(CUBE, [10, 3, 0])), 2000.0, "mesh-bodies-united")
    touching = together(CUBE, moved(CUBE, [10, 0, 0]))
    solid, _ = mended(touching, 2000.0, "mesh-touching-edge", "mesh-bodies-united")
    assert len(manifold_of(solid.vertices, solid.faces).decompose()) == 1


def test_bodies_that_meet_in_an_edge_stay_two_solids():
    mended(together(CUBE, moved(CUBE, [10, 10, 0])), 2000.0, "mesh-touching-edge")


def test_a_hollow_stays_hollow_even_with_a_ball_in_it():
    hollow = inside_out(moved(CUBE, [2.5, 2.5, 2.5], 0.5))
    mended(together(CUBE, hollow), 875.0)
    mended(together(CUBE, hollow, moved(CUBE, [4, 4, 4], 0.2)), 883.0)


def test_a_fin_is_refused_with_its_edge():
    fin = Mesh(np.array([[0, 0, 10.0], [10 / 3, 0, 10], [0, 0, 15]]), np.array([[0, 1, 2]]))
    with pytest.raises(MeshError, match=r"non-manifold edge at \(1\.667, 0\.000, 10\.000\) mm with 3 faces"):
        make_solid(together(CUBE, fin))


def test_a_wall_inside_is_refused_with_its_edge():
    wall = Mesh(np.array([[0, 0, 0.0], [0, 0, 10], [10, 10, 10], [10, 10, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    with pytest.raises(MeshError, match=r"non-manifold edge at .* with 3 faces"):
        make_solid(together(mesh_of(Manifold.cube([10, 10, 10])), wall))


def test_a_sheet_encloses_nothing():
    corners = np.array([[0, 0, 0.0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    with pytest.raises(MeshError, match="no volume"):
        make_solid(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])))


def test_a_moebius_strip_has_no_inside():
    t = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    half = np.column_stack([np.cos(t / 2) * np.cos(t), np.cos(t / 2) * np.sin(t), np.sin(t / 2)])
    middle = 10 * np.column_stack([np.cos(t), np.sin(t), 0 * t])
    low, high = np.arange(24), np.arange(24) + 24
    low_next, high_next = np.roll(low, -1), np.roll(high, -1)
    low_next[-1], high_next[-1] = 24, 0
    faces = np.vstack([np.column_stack([low, low_next, high]), np.column_stack([low_next, high_next, high])])
    with pytest.raises(MeshError, match="one side"):
        make_solid(Mesh(np.vstack([middle - half, middle + half]), faces))


def test_nothing_is_refused():
    with pytest.raises(MeshError, match="no faces"):
        make_solid(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])))
