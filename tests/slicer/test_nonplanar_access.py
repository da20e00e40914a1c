"""Which skin the head can reach, against geometry done by hand: walls beside slopes, cones, boxes that turn."""

from dataclasses import replace
from itertools import pairwise

import manifold3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.mesh import Mesh
from trunnion_core.profile import Body, load_profile
from trunnion_core.settings import PrintSettings
from trunnion_core.solid_tables import BoxTable, ConeTable, CylinderTable, HullTable
from trunnion_slicer.nonplanar import access
from trunnion_slicer.nonplanar.access import footprints_of, reachable
from trunnion_slicer.nonplanar.access_kernel import signed_distance
from trunnion_slicer.nonplanar.head import frusta, head_of
from trunnion_slicer.nonplanar.material import material, spread_points
from trunnion_slicer.nonplanar.normals import face_normals
from trunnion_slicer.nonplanar.plan import plan_nonplanar
from trunnion_slicer.nonplanar.split import split_edges
from trunnion_slicer.section_kernels import twins

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
FLAT, LENGTH, WIDTH = 0.4, 20.0, 10.0
"""mm: radius of the cone's lower end; the plate from x = 0 to the wall, and along it."""


def cone(half_angle: float, height: float = 8.0, flat: float = FLAT) -> ConeTable:
    """A cone of that half angle (rad) standing on the tip."""
    wide = 2 * (flat + height * np.tan(half_angle))
    return ConeTable(shape="cone", name="cone", bottom=0, top=height, bottom_diameter=2 * flat, top_diameter=wide)


def plate_and_wall(height: float, tilt: float) -> tuple[Mesh, np.ndarray]:
    """A plate with a wall of `height` mm at x = LENGTH, tilted by `tilt` rad about x; mask of the plate's top."""
    solid = manifold3d.Manifold.cube([LENGTH, WIDTH, 4.0])
    if height > 0:
        solid += manifold3d.Manifold.cube([2.0, WIDTH, 4.0 + height]).translate([LENGTH, 0.0, 0.0])
    mesh = from_solid(solid.rotate([np.degrees(tilt), 0.0, 0.0]))
    normal, _ = face_normals(mesh.vertices, mesh.faces)
    up = normal @ [0.0, -np.sin(tilt), np.cos(tilt)] > 0.999
    return mesh, up & (mesh.triangles[:, :, 0].max(axis=1) < LENGTH + 1e-6)


def from_solid(solid: manifold3d.Manifold) -> Mesh:
    out = solid.to_mesh64()
    return Mesh(np.array(out.vert_properties)[:, :3].copy(), np.array(out.tri_verts, dtype=np.int64))


@settings(deadline=None, max_examples=25)
@given(
    height=st.floats(0.3, 3.0), half_angle=st.floats(0.2, 0.7), tilt=st.floats(0.1, 0.5), end=st.sampled_from([-1, 1])
)
def test_a_cone_stays_its_slant_away_from_a_wall(height: float, half_angle: float, tilt: float, end: int) -> None:
    """The wall runs along the tool, so it is met where the cone is as wide as the wall is far, plus the margin."""
    mesh, plate = plate_and_wall(height, end * tilt)
    reach = reachable(mesh, plate, SETTINGS, [cone(half_angle)])
    margin = access.MARGIN + SETTINGS.layer_height / 2
    away = FLAT + height * np.tan(half_angle) + margin / np.cos(half_angle)
    rim = LENGTH - reach.mesh.triangles[reach.region][:, :, 0].max()
    assert away - access.SLACK / np.cos(half_angle) - 0.04 <= rim <= away + 0.25
    (finding,) = reach.findings
    assert finding.code == "nonplanar-head-blocked"
    assert "cone" in finding.message
    assert finding.value == pytest.approx(away * WIDTH * np.cos(tilt), rel=0.1)
    assert finding.point is not None
    assert finding.point[0] == pytest.approx(LENGTH)


def test_a_border_is_straight_whatever_the_tessellation() -> None:
    mesh, plate = plate_and_wall(2.0, 0.3)
    reach = reachable(mesh, plate, SETTINGS, [cone(0.5)])
    inside = reach.mesh.triangles[reach.region][:, :, 0].ravel()
    outside = reach.mesh.triangles[plate[reach.parent] & ~reach.region][:, :, 0].ravel()
    assert outside.min() == pytest.approx(inside.max(), abs=0.1)


def test_without_a_wall_or_without_bodies_nothing_is_given_up() -> None:
    mesh, plate = plate_and_wall(0.0, 0.3)
    free = reachable(mesh, plate, SETTINGS, [cone(0.6)])
    assert (free.region == plate).all()
    assert not free.findings
    mesh, plate = plate_and_wall(3.0, 0.3)
    assert (reachable(mesh, plate, SETTINGS, []).region == plate).all()


def test_a_step_that_the_flat_smooths_is_no_wall() -> None:
    mesh, plate = plate_and_wall(0.8 * access.SQUEEZE, 0.3)
    assert (reachable(mesh, plate, SETTINGS, [cone(0.6)]).region == plate).all()


def test_an_upright_tool_is_in_its_own_way_on_a_slope_unless_its_flat_is_small() -> None:
    """Uphill the skin rises by flat * tan(slope) under the flat, and a cone of 0.5 rad is clear of a slope of 0.3."""
    mesh, plate = plate_and_wall(0.0, 0.3)
    upright = SETTINGS.model_copy(update={"nonplanar_tool_axis": "vertical"})
    assert not reachable(mesh, plate, upright, [cone(0.5)]).region.any()
    pointed = reachable(mesh, plate, upright.model_copy(update={"extrusion_width": 0.1}), [cone(0.5, flat=0.01)])
    assert footprints_of(pointed.mesh, pointed.region).sum() > 0.9 * footprints_of(mesh, plate).sum()
    assert (reachable(mesh, plate, SETTINGS, [cone(0.5)]).region == plate).all()


def test_what_is_high_above_the_skin_keeps_a_wide_body_away() -> None:
    """A block 12 mm up meets only walls that reach it, and however the machine turns it."""
    block = BoxTable(shape="box", name="block", min=(-3, -2, 2.0), max=(3, 4, 9.0))
    mesh, plate = plate_and_wall(1.5, 0.3)
    assert not reachable(mesh, plate, SETTINGS, [block]).findings
    mesh, plate = plate_and_wall(3.0, 0.3)
    reach = reachable(mesh, plate, SETTINGS, [block])
    margin = access.MARGIN + SETTINGS.layer_height / 2
    rim = LENGTH - reach.mesh.triangles[reach.region][:, :, 0].max()
    assert rim == pytest.approx(5.0 + margin, abs=0.06)  # the corner (3, 4) is 5 from the axis


def test_deep_layers_are_kept_only_where_the_skin_ends_on_walls() -> None:
    """A lone tilted plate can have any number of layers; one that goes on in planar stairs only one."""
    mesh, plate = plate_and_wall(0.0, 0.3)
    deep = reachable(mesh, plate, SETTINGS, [cone(0.5)], layers=3)
    assert (deep.region == plate).all()
    vertices, faces, parent = split_edges(mesh.vertices, mesh.faces, *across(mesh, plate))
    half = plate[parent] & (Mesh(vertices, faces).triangles[:, :, 0].max(axis=1) < LENGTH / 2 + 1e-6)
    cut = Mesh(vertices, faces)
    single = reachable(cut, half, SETTINGS, [cone(0.5)])
    assert (single.region == half).all()
    deep = reachable(cut, half, SETTINGS, [cone(0.5)], layers=3)
    assert footprints_of(deep.mesh, deep.region).sum() < 0.95 * footprints_of(cut, half).sum()


def across(mesh: Mesh, plate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges of the plate that cross x = LENGTH / 2, and where."""
    sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    x = mesh.vertices[edges][:, :, 0] - LENGTH / 2
    edges, x = edges[x[:, 0] * x[:, 1] < 0], x[x[:, 0] * x[:, 1] < 0]
    return edges, x[:, 0] / (x[:, 0] - x[:, 1])


def test_a_plan_says_what_the_head_took_and_cuts_the_rest_out() -> None:
    wedge = manifold3d.Manifold.cube([LENGTH, WIDTH, 12.0]).trim_by_plane([0.0, -np.sin(0.3), -np.cos(0.3)], -5.0)
    wall = manifold3d.Manifold.cube([2.0, WIDTH, 12.0]).translate([LENGTH, 0.0, 0.0])
    mesh = from_solid(wedge + wall)
    free = plan_nonplanar(mesh, SETTINGS)
    headed = plan_nonplanar(mesh, SETTINGS, [cone(0.5)])
    assert free is not None
    assert headed is not None
    assert [finding.code for finding in headed.findings] == ["nonplanar-head-blocked"]
    reach = max(bead.points[:, 0].max() for bead in free.layers[0].beads)
    kept = max(bead.points[:, 0].max() for bead in headed.layers[0].beads)
    assert reach > LENGTH - 0.3
    assert kept < LENGTH - FLAT
    assert volume(headed.planar_mesh) > volume(free.planar_mesh) + 1.0


def volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float((np.cross(a, b) * c).sum() / 6)


@settings(deadline=None, max_examples=60)
@given(
    data=st.tuples(st.floats(-1, 3), st.floats(0.1, 4), st.floats(0, 3), st.floats(0.05, 4)),
    beside=st.floats(0, 6),
    over=st.floats(-3, 9),
)
def test_signed_distance_is_that_of_the_outline(
    data: tuple[float, float, float, float], beside: float, over: float
) -> None:
    low, height, narrow, wide = data
    outline = np.array([[0, low], [narrow, low], [wide, low + height], [0, low + height]])
    t = np.linspace(0, 1, 4001)[:, None]
    line = np.concatenate([a + t * (b - a) for a, b in pairwise(outline)])
    away = np.linalg.norm(line - [beside, over], axis=1).min()
    radius = narrow + (over - low) / height * (wide - narrow)
    inside = low < over < low + height and beside < radius
    found = signed_distance(np.array([low, low + height, narrow, wide]), beside, over)
    assert found <= 1e-12 if inside else found == pytest.approx(away, abs=2e-3)
    if inside:
        assert -found == pytest.approx(away, abs=2e-3)


def test_bodies_off_the_axis_are_held_by_their_solids_of_revolution() -> None:
    bodies = frusta(
        [
            BoxTable(shape="box", name="a", min=(-8, -8, 12.5), max=(8, 15, 24)),
            CylinderTable(shape="cylinder", name="b", bottom=1, top=2, diameter=4, center=(3, 4)),
        ]
    )
    np.testing.assert_allclose(bodies, [[12.5, 24, 17, 17], [1, 2, 7, 7]])


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_a_hull_is_held_by_its_frustum_and_a_cone_of_corners_is_itself(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * 9
    low, high, narrow, wide = frusta([HullTable(shape="hull", name="h", points=tuple(map(tuple, points)))])[0]
    assert (low, high) == (points[:, 2].min(), points[:, 2].max())
    inside = rng.dirichlet(np.ones(20), 200) @ points
    share = (inside[:, 2] - low) / (high - low)
    assert (np.hypot(*inside[:, :2].T) <= narrow + share * (wide - narrow) + 1e-7).all()
    angle = np.arange(12) * np.pi / 6
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    corners = np.concatenate([np.column_stack([r * ring, np.full(12, z)]) for r, z in ((1.0, 2.0), (5.0, 7.0))])
    cone = HullTable(shape="hull", name="c", points=tuple(map(tuple, corners.tolist())))
    np.testing.assert_allclose(frusta([cone]), [[2, 7, 1, 5]], atol=1e-7)


def test_the_head_is_all_that_moves_with_the_tool_and_nothing_else() -> None:
    """What the last tool joint carries is seen from the tip; a beam on another joint is the judge's business."""
    cradle = load_profile("generic_ab_cradle")
    assert head_of(cradle) == cradle.tool_bodies
    duct = Body("Z", CylinderTable(shape="cylinder", name="duct", bottom=9, top=12, diameter=6, center=(5, 0)), ())
    tilted = replace(cradle, bodies=(duct,), tip=np.array([5.0, 0.0, 4.0]))
    found = frusta(head_of(tilted))[len(cradle.tool_bodies) :]
    np.testing.assert_allclose(found, [[5, 8, 3, 3]], rtol=0.006)
    sideways = replace(cradle, bodies=(duct,), tool_axis=np.array([1.0, 0.0, 0.0]))
    low, high, *_ = frusta(head_of(sideways))[-1]
    assert (low, high) == pytest.approx((2, 8), abs=0.02)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), share=st.floats(0, 1))
def test_split_edges_leave_a_closed_solid_of_the_same_shape(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    mesh = from_solid(manifold3d.Manifold.sphere(5.0, 16))
    sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    edges = edges[random.random(len(edges)) < share]
    vertices, faces, parent = split_edges(mesh.vertices, mesh.faces, edges, random.uniform(0.2, 0.8, len(edges)))
    assert (twins(np.ascontiguousarray(faces), len(vertices)) >= 0).all()
    normal, area = face_normals(vertices, faces)
    old_normal, old_area = face_normals(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(np.bincount(parent, area, len(mesh.faces)), old_area, rtol=1e-9)
    np.testing.assert_allclose(normal, old_normal[parent], atol=1e-7)
    assert len(faces) == len(mesh.faces) + 2 * len(edges)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), spacing=st.floats(0.1, 2.0))
def test_no_place_of_a_triangle_is_far_from_the_points_spread_over_it(seed: int, spacing: float) -> None:
    random = np.random.default_rng(seed)
    triangles = random.normal(scale=3.0, size=(3, 3, 3))
    points, owner = spread_points(triangles, spacing)
    weights = random.dirichlet([1, 1, 1], size=(3, 60))
    places = np.einsum("msk,mkd->msd", weights, triangles)
    for row in range(3):
        mine = points[owner == row]
        away = np.linalg.norm(places[row][:, None] - mine[None], axis=2).min(axis=1)
        assert away.max() <= 1.01 * spacing
        assert np.linalg.norm(mine[:, None] - triangles[row][None], axis=2).min(axis=0).max() < 1e-9


def test_material_keeps_every_point_in_its_ball() -> None:
    mesh = from_solid(manifold3d.Manifold.sphere(9.0, 32))
    skin = material(mesh.vertices, mesh.faces, 0.3)
    assert skin.cube_start[-1] == len(skin.points)
    assert skin.room_start[-1] == len(skin.cube_ball)
    assert len(skin.room_start) == len(skin.room_ball) + 1
    cube = np.repeat(np.arange(len(skin.cube_ball)), np.diff(skin.cube_start))
    room = np.repeat(np.arange(len(skin.room_ball)), np.diff(skin.room_start))[cube]
    for ball in (skin.cube_ball[cube], skin.room_ball[room]):
        assert (np.linalg.norm(skin.points - ball[:, :3], axis=1) <= ball[:, 3] + 1e-9).all()
