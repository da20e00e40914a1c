"""Parts become non-planar layers: which faces, which space, which beads, how much plastic."""

from collections.abc import Callable
from functools import cache

import manifold3d
import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.arrays import FloatArray
from trunnion_core.bead import bead_area
from trunnion_core.layers import Bead, Layer
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.nonplanar.offset import FLOOR_RAISED
from trunnion_slicer.nonplanar.plan import NonplanarPlan, plan_nonplanar
from trunnion_slicer.section_kernels import twins

BASE = {
    "layer_height": 0.3,
    "extrusion_width": 0.4,
    "fill_density": 100.0,
    "skirts": 0,
    "nonplanar_smoothing": 0.0,
}


def over_box(height: Callable[[FloatArray, FloatArray], FloatArray], size: float, cells: int) -> Mesh:
    """A closed solid over a square about the origin, from z = 0 up to the height field."""
    x = np.linspace(-size / 2, size / 2, cells + 1)
    gx, gy = np.meshgrid(x, x, indexing="ij")
    top = np.stack([gx, gy, height(gx, gy) + 0 * gx], axis=2).reshape(-1, 3)
    at = np.arange(len(top)).reshape(cells + 1, cells + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    rim = np.concatenate([at[:-1, 0], at[-1, :-1], at[:0:-1, -1], at[0, :0:-1]])
    low = len(top) + np.arange(len(rim))
    rim2, low2 = np.roll(rim, -1), np.roll(low, -1)
    centre = np.full(len(rim), len(top) + len(rim))
    triples = [(a, b, c), (a, c, d), (rim, low, low2), (rim, low2, rim2), (centre, low2, low)]
    faces = np.concatenate([np.stack(triple, axis=1) for triple in triples])
    vertices = np.vstack([top, top[rim] * [1, 1, 0], [[0.0, 0.0, 0.0]]])
    return Mesh(vertices, faces.astype(np.int64))


def of_manifold(solid: manifold3d.Manifold) -> Mesh:
    found = solid.to_mesh64()
    return Mesh(found.vert_properties[:, :3].copy(), found.tri_verts.astype(np.int64))


SHAPES: dict[str, Callable[[], Mesh]] = {
    "dome": lambda: over_box(lambda x, y: 9 - 60 + np.sqrt(60.0**2 - x**2 - y**2), 24, 48),
    "wedge_5": lambda: over_box(lambda x, y: 5 + x * np.tan(np.radians(5.0)), 20, 2),
    "wedge_15": lambda: over_box(lambda x, y: 6 + x * np.tan(np.radians(15.0)), 20, 2),
    "wedge_30": lambda: over_box(lambda x, y: 8 + x * np.tan(np.radians(30.0)), 20, 2),
    "pipe": lambda: over_box(lambda x, y: 9 - 25 + np.sqrt(25.0**2 - y**2), 20, 60),
    "saddle": lambda: over_box(lambda x, y: 6 + (x**2 - y**2) / 60, 20, 40),
    "cone": lambda: over_box(lambda x, y: 9 - 0.3 * np.sqrt(x**2 + y**2 + 1.0), 20, 60),
}


@cache
def planned(name: str, layers: int = 2) -> tuple[Mesh, PrintSettings, NonplanarPlan]:
    mesh, settings = SHAPES[name](), PrintSettings(**BASE, nonplanar_layers=layers)
    plan = plan_nonplanar(mesh, settings)
    assert plan is not None
    return mesh, settings, plan


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def laid(layer: Layer) -> float:
    def of(bead: Bead) -> float:
        length = np.linalg.norm(np.diff(bead.points, axis=0), axis=1)
        return float((bead_area(bead.width, bead.height)[1:] * length).sum())

    return sum(of(bead) for bead in layer.beads)


def skin_area(mesh: Mesh, region: "np.typing.NDArray[np.bool_]") -> float:
    a, b, c = (mesh.triangles[region][:, k] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("name", SHAPES)
def test_the_space_taken_out_is_the_skin_times_the_thickness(name: str) -> None:
    mesh, settings, plan = planned(name)
    thickness = (settings.nonplanar_layers - FLOOR_RAISED) * settings.layer_height
    expected = skin_area(mesh, plan.region) * thickness
    # Curvature changes the area by up to thickness / radius on the way down: 0.6 / 25 on the pipe, half on average.
    assert volume(mesh) - volume(plan.planar_mesh) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", SHAPES)
def test_the_planar_mesh_is_closed(name: str) -> None:
    _, _, plan = planned(name)
    faces = np.ascontiguousarray(plan.planar_mesh.faces)
    assert (twins(faces, len(plan.planar_mesh.vertices)) >= 0).all()


@pytest.mark.parametrize("name", SHAPES)
def test_beads_hold_the_volume_of_their_layer(name: str) -> None:
    """All layers together fill the pocket; upper ones, which lie on a smooth surface, each fill their own part.

    Of the lowest the stairs under it take or give: its volume is that of the space over the planar tops.
    """
    mesh, settings, plan = planned(name)
    outermost = plan.layers[-1]
    area, h = skin_area(mesh, plan.region), settings.layer_height
    assert laid(outermost) == pytest.approx(area * h, rel=0.012)


@pytest.mark.parametrize("name", SHAPES)
def test_the_lowest_layer_fills_what_the_planar_layers_leave(name: str) -> None:
    mesh, settings, plan = planned(name, 1)
    h = settings.layer_height
    x = np.linspace(*mesh.bounds[:, 0], 402)[1:-1]
    y = np.linspace(*mesh.bounds[:, 1], 402)[1:-1]
    from trunnion_slicer.nonplanar.grid import build_grid

    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2).reshape(-1, 2)

    def highest(of: Mesh) -> FloatArray:
        _, below = build_grid(of.triangles).column(np.column_stack([points, np.full(len(points), 50.0)]), 0.0)
        return 50.0 - below

    printed_top = h * np.floor(highest(plan.planar_mesh) / h + 0.5)
    cell = np.ptp(mesh.bounds[:, 0]) * np.ptp(mesh.bounds[:, 1]) / len(points)
    space = (highest(mesh) - printed_top).sum() * cell
    # Steps have round edges, which take some more.
    assert 0.99 * space < sum(laid(layer) for layer in plan.layers) < 1.06 * space


def test_points_lie_on_the_sphere_and_tools_on_its_normals() -> None:
    _, _, plan = planned("dome")
    centre = np.array([0.0, 0.0, 9.0 - 60.0])
    for depth, layer in enumerate(reversed(plan.layers)):
        for bead in layer.beads:
            out = bead.points - centre
            radius = np.linalg.norm(out, axis=1)
            assert_allclose(radius, 60.0 - 0.3 * depth, atol=0.008)
            cosine = (bead.tool_axes * out).sum(axis=1) / radius
            inner = np.abs(bead.points[:, :2]).max(axis=1) < 11
            assert np.degrees(np.arccos(np.minimum(cosine[inner], 1.0))).max(initial=0.0) < 0.6


def test_between_points_a_bead_stays_on_the_surface() -> None:
    _, _, plan = planned("dome")
    centre = np.array([0.0, 0.0, 9.0 - 60.0])
    middles = np.concatenate([(bead.points[1:] + bead.points[:-1]) / 2 for bead in plan.layers[-1].beads])
    assert_allclose(np.linalg.norm(middles - centre, axis=1), 60.0, atol=0.01)


def test_layers_come_lowest_first_and_turn_by_a_quarter() -> None:
    _, _, plan = planned("saddle")
    assert [layer.kind for layer in plan.layers] == ["nonplanar", "nonplanar"]
    assert plan.layers[0].z < plan.layers[1].z

    def along_x(layer: Layer) -> float:
        steps = [np.diff(b.points[:, :2], axis=0) for b in layer.beads if b.role == Role.NONPLANAR_INFILL]
        every = np.abs(np.concatenate(steps)).sum(axis=0)
        return float(every[0] / every.sum())

    assert along_x(plan.layers[1]) > 0.9
    assert along_x(plan.layers[0]) < 0.1


def test_walls_follow_the_outline_half_a_bead_inside() -> None:
    mesh, _, plan = planned("wedge_5")
    (wall,) = [bead for bead in plan.layers[-1].beads if bead.role == Role.NONPLANAR_OUTER_WALL]
    assert wall.closed
    inside = mesh.bounds[1, 0] - np.abs(wall.points[:, :2]).max(axis=1)
    assert_allclose(inside, 0.2, atol=0.005)


@pytest.mark.parametrize("slope", [30.0, 36.0, 37.5, 45.0])
def test_only_slopes_up_to_the_threshold_of_equation_1_are_taken(slope: float) -> None:
    mesh = over_box(lambda x, y: 12 + x * np.tan(np.radians(slope)), 20, 2)
    plan = plan_nonplanar(mesh, PrintSettings(**BASE))
    assert (plan is not None) == (slope <= np.degrees(np.arctan(0.3 / 0.4)))


def test_angle_zero_flat_tops_and_small_tops_stay_planar() -> None:
    dome = SHAPES["dome"]()
    assert plan_nonplanar(dome, PrintSettings(**BASE, nonplanar_max_angle=0)) is None
    assert plan_nonplanar(dome, PrintSettings(**BASE, nonplanar_min_area=600)) is None
    assert plan_nonplanar(over_box(lambda x, y: 5.0 + 0 * x, 20, 4), PrintSettings(**BASE)) is None
    narrow = manifold3d.Manifold.cube([30, 0.7, 5]).warp(lambda p: [p[0], p[1], p[2] * (1 + 0.005 * p[0])])
    assert plan_nonplanar(of_manifold(narrow), PrintSettings(**BASE)) is None


def test_faces_with_material_above_are_left_out() -> None:
    dome = SHAPES["dome"]()
    under = manifold3d.Manifold(manifold3d.Mesh64(np.array(dome.vertices), dome.faces.astype(np.uint64)))
    roof = manifold3d.Manifold.cube([12, 24, 1]).translate([0, -12, 14])
    post = manifold3d.Manifold.cube([1, 24, 15]).translate([12, -12, 0])
    mesh = of_manifold(under + roof + post)
    plan = plan_nonplanar(mesh, PrintSettings(**BASE))
    assert plan is not None
    assert mesh.triangles[plan.region][:, :, 0].max() < 0.6
    assert mesh.triangles[plan.region][:, :, 0].min() < -11.9


def test_a_roof_inside_a_large_triangle_is_seen() -> None:
    """No corner of the two large triangles of the slope lies under the small roof."""
    wedge = of_manifold(manifold3d.Manifold.cube([40, 40, 5]).warp(lambda p: [p[0], p[1], p[2] * (1 + 0.02 * p[0])]))
    solid = manifold3d.Manifold(manifold3d.Mesh64(np.array(wedge.vertices), wedge.faces.astype(np.uint64)))
    roof = manifold3d.Manifold.cube([6, 6, 1]).translate([8, 22, 15])
    mesh = of_manifold(manifold3d.Manifold.compose([solid, roof]))
    open_sky, covered = plan_nonplanar(wedge, PrintSettings(**BASE)), plan_nonplanar(mesh, PrintSettings(**BASE))
    assert open_sky is not None
    assert covered is None or volume(wedge) - volume(covered.planar_mesh) < volume(wedge) - volume(open_sky.planar_mesh)


def test_paths_do_not_run_over_a_cliff_inside_a_patch() -> None:
    """A groove whose sloping floor runs out into the skin: one patch, with cliffs of no width on both sides."""

    solid = manifold3d.Manifold.cube([24, 20, 30]).translate([-12, -10, 0])
    slope = np.tan(np.radians(30.0))
    wedge = solid.trim_by_plane([slope, 0.0, -1.0], -10.0 / np.hypot(slope, 1.0))
    floor = solid.trim_by_plane([-0.1, 0.0, 1.0], 6.0 / np.hypot(0.1, 1.0))
    groove = floor ^ manifold3d.Manifold.cube([40, 4, 60]).translate([-20, -2, 0])
    mesh = of_manifold(wedge - groove)
    plan = plan_nonplanar(mesh, PrintSettings(**BASE))
    assert plan is not None
    for bead in plan.layers[-1].beads:
        step = np.diff(bead.points, axis=0)
        rise = np.abs(step[:, 2]) / np.linalg.norm(step[:, :2], axis=1)
        assert rise.max() < slope + 0.05


def test_the_flat_floor_of_a_groove_stays_planar_and_a_flat_apex_does_not() -> None:
    dome = over_box(lambda x, y: 9 - 15 + np.sqrt(15.0**2 - x**2 - y**2), 16, 48)
    solid = manifold3d.Manifold(manifold3d.Mesh64(np.array(dome.vertices), dome.faces.astype(np.uint64)))
    mesh = of_manifold(solid - manifold3d.Manifold.cube([30, 3, 10]).translate([-15, 2, 8.0]))
    plan = plan_nonplanar(mesh, PrintSettings(**BASE))
    assert plan is not None
    triangles = mesh.triangles[plan.region]
    middle = triangles.mean(axis=1)
    assert not (np.abs(triangles[:, :, 2] - 8.0).max(axis=1) < 1e-6).any()
    assert (np.linalg.norm(middle[:, :2], axis=1) < 1.0).any()


def test_skin_over_too_little_material_stays_planar() -> None:
    plate = over_box(lambda x, y: 1.0 + x * np.tan(np.radians(2.5)) / 2, 20, 4)
    assert plan_nonplanar(plate, PrintSettings(**BASE, nonplanar_layers=3)) is None


def test_folding_offsets_are_refused_and_said() -> None:
    """A dome of radius 2 mm shrinks to nothing after 6 layers of 0.3 mm."""
    dome = over_box(lambda x, y: 6 + np.sqrt(2.0**2 - x**2 - y**2), 2.4, 24)
    plan = plan_nonplanar(dome, PrintSettings(**BASE, nonplanar_layers=9))
    assert plan is not None
    assert 4 <= len(plan.layers) <= 6
    (finding,) = plan.findings
    assert (finding.code, finding.value, finding.limit) == ("nonplanar-offset-folds", len(plan.layers), 9.0)


def test_at_a_ridge_facets_keep_their_own_normal_and_the_tool_turns_over_a_bead() -> None:
    roof = over_box(lambda x, y: 8 - np.abs(x) * np.tan(np.radians(25.0)), 16, 2)
    plan = plan_nonplanar(roof, PrintSettings(**BASE))
    assert plan is not None
    for bead in plan.layers[-1].beads:
        far = np.abs(bead.points[:, 0]) > 0.42
        lean = np.degrees(np.arcsin(bead.tool_axes[far, 0] * np.sign(bead.points[far, 0])))
        assert_allclose(lean, 25.0, atol=0.1)
        step = np.degrees(np.arccos(np.clip((bead.tool_axes[1:] * bead.tool_axes[:-1]).sum(axis=1), -1, 1)))
        run = np.linalg.norm(np.diff(bead.points, axis=0), axis=1)
        assert (step <= 50.0 * run / 0.7 + 1.0).all()


def test_a_vertical_tool_lays_the_same_volume() -> None:
    mesh, settings, plan = planned("wedge_30", 1)
    upright = plan_nonplanar(mesh, settings.model_copy(update={"nonplanar_tool_axis": "vertical"}))
    assert upright is not None
    assert all((bead.tool_axes == [0, 0, 1]).all() for bead in upright.layers[0].beads)
    assert laid(upright.layers[0]) == pytest.approx(laid(plan.layers[0]), rel=1e-9)


def test_the_same_input_gives_the_same_beads() -> None:
    mesh, settings, plan = planned("dome", 1)
    again = plan_nonplanar(mesh, settings)
    assert again is not None
    for one, other in zip(plan.layers[0].beads, again.layers[0].beads, strict=True):
        assert (one.points == other.points).all()
        assert (one.width == other.width).all()


def test_lines_across_a_slope_are_a_bead_apart_on_the_surface() -> None:
    mesh = SHAPES["wedge_30"]()
    plan = plan_nonplanar(mesh, PrintSettings(**BASE, nonplanar_fill_angle=90.0))
    assert plan is not None
    (fill,) = [bead for bead in plan.layers[0].beads if bead.role == Role.NONPLANAR_INFILL]
    step = np.diff(fill.points, axis=0)
    along = np.abs(step[:, 1]) > 10 * np.abs(step[:, 0])
    lines = np.unique(np.round(fill.points[1:][along][:, 0], 3))
    apart = np.diff(lines) / np.cos(np.radians(30.0))
    spacing = 0.4 - 0.3 * (1 - np.pi / 4)
    assert_allclose(apart, spacing, rtol=0.02)
