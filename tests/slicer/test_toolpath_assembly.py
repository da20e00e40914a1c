"""From layers to a toolpath: order, seams, travels that clear what is printed, speeds."""

import itertools

import manifold3d as m3
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString

from trunnion_core.bead import bead_area
from trunnion_core.errors import MeshError
from trunnion_core.layers import Bead, Layer, LayerStack
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_slicer.assemble import to_toolpath
from trunnion_slicer.beads import flat_bead, reversed_bead, started_at
from trunnion_slicer.planar import planar_layers

PLAIN = PrintSettings(layer_height=0.3, nonplanar_max_angle=0, skirts=1)


def to_mesh(solid: m3.Manifold) -> Mesh:
    data = solid.to_mesh64()
    return Mesh(np.array(data.vert_properties[:, :3], dtype=np.float64), np.array(data.tri_verts, dtype=np.int64))


@pytest.fixture(scope="module")
def towers() -> LayerStack:
    """A plate with a window that carries two towers and a tube."""
    solid = m3.Manifold.cube((40, 30, 3)) - m3.Manifold.cube((8, 12, 3)).translate((16, 9, 0))
    solid += m3.Manifold.cube((8, 8, 8)).translate((2, 2, 0)) + m3.Manifold.cylinder(6, 5, 3, 48).translate((32, 22, 0))
    solid += (m3.Manifold.cylinder(7, 5, 5, 48) - m3.Manifold.cylinder(7, 3, 3, 48)).translate((8, 22, 0))
    return LayerStack(planar_layers(to_mesh(solid), PLAIN))


@pytest.fixture(scope="module")
def toolpath(towers: LayerStack) -> Toolpath:
    return to_toolpath(towers, PLAIN)


def runs(path: Toolpath) -> list[tuple[int, int]]:
    """First and last row of every unbroken run of one bead role."""
    on = path.extrudes
    cut = np.flatnonzero((on[1:] != on[:-1]) | (path.role[1:] != path.role[:-1])) + 1
    edges = [0, *cut.tolist(), len(path)]
    return [(a, b - 1) for a, b in itertools.pairwise(edges) if on[a]]


def test_a_toolpath_starts_with_a_travel_and_its_layers_never_fall(toolpath: Toolpath, towers: LayerStack) -> None:
    assert toolpath.role[0] == Role.TRAVEL
    assert (np.diff(toolpath.layer) >= 0).all()
    assert set(toolpath.layer) == set(range(len(towers.layers)))
    laid = toolpath.extrudes
    tops = np.array([layer.z for layer in towers.layers])
    assert (toolpath.points[laid, 2] == tops[toolpath.layer[laid]]).all()


def test_every_bead_is_laid_once(toolpath: Toolpath, towers: LayerStack) -> None:
    for index, layer in enumerate(towers.layers):
        rows = np.flatnonzero(toolpath.extrudes & (toolpath.layer == index))
        step = np.linalg.norm(toolpath.points[rows] - toolpath.points[rows - 1], axis=1)
        for role in {bead.role for bead in layer.beads}:
            mine = toolpath.role[rows] == role
            laid = (step * bead_area(toolpath.width[rows], toolpath.height[rows]))[mine].sum()
            wanted = sum(
                (np.linalg.norm(np.diff(bead.points, axis=0), axis=1) * bead_area(bead.width, bead.height)[1:]).sum()
                for bead in layer.beads
                if bead.role == role
            )
            assert laid == pytest.approx(wanted, rel=1e-9)


def test_no_row_extrudes_in_place_and_no_travel_stands_still(toolpath: Toolpath) -> None:
    step = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1)
    assert step.min() > 0


def test_without_lift_there_are_no_rows_that_stand_still(towers: LayerStack) -> None:
    path = to_toolpath(towers, PLAIN.model_copy(update={"retract_lift": 0.0}))
    assert np.linalg.norm(np.diff(path.points, axis=0), axis=1).min() > 0


def test_the_same_layers_give_the_same_toolpath(toolpath: Toolpath, towers: LayerStack) -> None:
    again = to_toolpath(towers, PLAIN)
    assert (again.points == toolpath.points).all()
    assert (again.role == toolpath.role).all()


def test_loops_close_exactly(toolpath: Toolpath) -> None:
    loops = 0
    for first, last in runs(toolpath):
        if toolpath.role[first] == Role.OUTER_WALL:
            assert (toolpath.points[first - 1] == toolpath.points[last]).all()
            loops += 1
    assert loops > 60


def test_speeds_are_those_of_the_role_and_capped_on_the_first_layer(toolpath: Toolpath) -> None:
    laid = toolpath.extrudes
    assert toolpath.speed[laid & (toolpath.layer == 0)].max() == PLAIN.first_layer_speed
    assert set(toolpath.speed[toolpath.role == Role.TRAVEL]) == {PLAIN.travel_speed}
    above = toolpath.layer > 0
    for role, speed in (
        (Role.OUTER_WALL, PLAIN.external_perimeter_speed),
        (Role.INNER_WALL, PLAIN.perimeter_speed),
        (Role.INFILL, PLAIN.infill_speed),
        (Role.SOLID_INFILL, PLAIN.solid_infill_speed),
        (Role.TOP_SOLID_INFILL, PLAIN.top_solid_infill_speed),
    ):
        assert set(toolpath.speed[above & (toolpath.role == role)]) == {speed}


def test_walls_of_an_island_go_from_the_inside_out_and_infill_comes_last(toolpath: Toolpath) -> None:
    order = {Role.SKIRT: 0, Role.INNER_WALL: 1, Role.OUTER_WALL: 2}
    first_layer = [toolpath.role[first] for first, _ in runs(toolpath) if toolpath.layer[first] == 0]
    ranks = [order.get(Role(int(role)), 3) for role in first_layer]
    assert ranks == sorted(ranks)


def test_links_stay_inside_the_island_and_are_short_or_hidden(toolpath: Toolpath, towers: LayerStack) -> None:
    rows = np.flatnonzero(toolpath.role == Role.LINK)
    assert len(rows) > 50
    for row in rows:
        layer = towers.layers[toolpath.layer[row]]
        rings = [LineString(bead.points[:, :2]) for bead in layer.beads if bead.role == Role.OUTER_WALL]
        inside = shapely.build_area(shapely.union_all(rings)).buffer(2e-3)
        hop = LineString(toolpath.points[row - 1 : row + 1, :2])
        assert inside.covers(hop)
        hidden = toolpath.role[row - 1] == Role.INFILL and toolpath.role[row + 1] == Role.INFILL
        assert hidden or hop.length < PLAIN.retract_before_travel


def test_planar_travels_cross_a_lift_above_the_layer(toolpath: Toolpath) -> None:
    across = np.flatnonzero(
        (toolpath.role[1:] == Role.TRAVEL) & (np.abs(np.diff(toolpath.points[:, :2], axis=0)).max(axis=1) > 0)
    )
    tops = np.maximum.accumulate(np.where(toolpath.extrudes, toolpath.points[:, 2], 0.0))
    lowest = np.minimum(toolpath.points[across, 2], toolpath.points[across + 1, 2])
    assert (lowest >= tops[across] + PLAIN.retract_lift - 1e-9).all()
    assert (lowest <= tops[across] + PLAIN.layer_height + PLAIN.retract_lift + 1e-9).all()


def test_seams_stand_above_each_other() -> None:
    cone = to_mesh(m3.Manifold.cylinder(9, 15, 9, 128))
    path = to_toolpath(LayerStack(planar_layers(cone, PLAIN)), PLAIN)
    seams = np.array([path.points[last] for first, last in runs(path) if path.role[first] == Role.OUTER_WALL])
    angle = np.unwrap(np.arctan2(seams[:, 1], seams[:, 0]))
    assert np.ptp(angle) < np.radians(5)


def test_a_part_too_thin_for_any_bead_is_refused() -> None:
    thread = to_mesh(m3.Manifold.cylinder(5, 0.03, 0.03, 16))
    with pytest.raises(MeshError, match="no bead fits"):
        to_toolpath(LayerStack(planar_layers(thread, PLAIN.model_copy(update={"skirts": 0}))), PLAIN)


# Travels over curved layers, against an oracle that shares nothing with the planner: points densely strewn over the
# beads, compared with points densely strewn over the travels.


def curved_bead(line: np.ndarray, z: np.ndarray, lean: np.ndarray, role: Role) -> Bead:
    axes = np.column_stack([lean, np.ones(len(line))])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    n = len(line)
    return Bead(np.column_stack([line, z]), axes, np.full(n, 0.4), np.full(n, 0.3), role)


def hills(seed: int) -> LayerStack:
    """A plane layer, then walls and lines in random order over a bump, a ridge or a pit."""
    random = np.random.default_rng(seed)
    peak, sharp = random.uniform(-3, 5), random.uniform(0.05, 0.3)
    middle = random.uniform(-6, 6, 2)

    def surface(xy: np.ndarray) -> np.ndarray:
        return np.asarray(4 + peak * np.exp(-sharp * ((xy - middle) ** 2).sum(axis=1)))

    flat = [
        flat_bead(np.array([[-12.0, y], [12.0, y]]), 0.3, 0.4, 0.3, Role.SOLID_INFILL) for y in np.arange(-12, 12, 2)
    ]

    def lean(xy: np.ndarray) -> np.ndarray:
        """What a surface normal (lean, 1) has for x and y."""
        return np.asarray(2 * sharp * (surface(xy) - 4)[:, None] * (xy - middle))

    def bead(start: np.ndarray, turn: float, long: float) -> Bead:
        line = start + np.linspace(0, long, 60)[:, None] * np.array([np.cos(turn), np.sin(turn)])
        return curved_bead(line, surface(line), lean(line), Role.NONPLANAR_INFILL)

    spokes = [bead(middle, turn, 4.0) for turn in np.linspace(0, 6, 12)]
    pieces = [bead(random.uniform(-10, 10, 2), random.uniform(0, 6.28), random.uniform(0.3, 3)) for _ in range(40)]
    turns = np.linspace(0, 2 * np.pi, 200)
    ring = 11 * np.column_stack([np.cos(turns), np.sin(turns)])
    ring[-1] = ring[0]
    wall = curved_bead(ring, surface(ring), lean(ring), Role.NONPLANAR_OUTER_WALL)
    return LayerStack((Layer("planar", 0.3, 0.3, tuple(flat)), Layer("nonplanar", 12.0, 0.3, (wall, *spokes, *pieces))))


BELOW = 0.06
"""mm. Printed points this near, seen from above, are under the tip; on the steepest slope here, 67 degrees, they may
stand about 0.1 mm higher than a tip that just left or is about to reach the surface."""


def strewn(a: np.ndarray, b: np.ndarray, step: float) -> np.ndarray:
    count = int(np.ceil(np.linalg.norm(b - a) / step)) + 1
    return a + np.linspace(0, 1, count + 1)[:, None] * (b - a)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.2, 0.4, 1.0]))
def test_no_travel_ploughs_through_what_is_printed(seed: int, lift: float) -> None:
    path = to_toolpath(hills(seed), PLAIN.model_copy(update={"retract_lift": lift}))
    printed = np.empty((0, 3))
    for row in range(1, len(path)):
        way = strewn(path.points[row - 1], path.points[row], 0.05)
        if path.extrudes[row]:
            printed = np.concatenate([printed, way])
            continue
        near = printed[
            (printed[:, :2] >= way[:, :2].min(axis=0) - 0.2).all(axis=1)
            & (printed[:, :2] <= way[:, :2].max(axis=0) + 0.2).all(axis=1)
        ]
        if len(near):
            apart = np.linalg.norm(way[:, None, :2] - near[None, :, :2], axis=2)
            above = np.where(apart < BELOW, way[:, None, 2] - near[None, :, 2], np.inf)
            assert above.min() > -0.14, (row, Role(int(path.role[row])), above.min())


def test_a_crossing_rises_over_a_ridge_and_turns_the_tool_up_there() -> None:
    left = curved_bead(
        np.array([[-8.0, 0.0], [-6.0, 0.0]]), np.array([1.0, 1.0]), np.full((2, 2), -0.4), Role.NONPLANAR_INFILL
    )
    right = curved_bead(
        np.array([[6.0, 0.0], [8.0, 0.0]]), np.array([1.0, 1.0]), np.full((2, 2), 0.4), Role.NONPLANAR_INFILL
    )
    ridge = flat_bead(np.array([[0.0, -5.0], [0.0, 5.0]]), 7.0, 0.4, 0.3, Role.SOLID_INFILL)
    path = to_toolpath(
        LayerStack((Layer("planar", 7.0, 0.3, (ridge,)), Layer("nonplanar", 1.0, 0.3, (left, right)))), PLAIN
    )
    ends = np.flatnonzero(np.diff(path.role == Role.NONPLANAR_INFILL))
    first, last = ends[1], ends[2]  # the last row of the one slope, the last travel to the other
    assert path.points[first, 0] * path.points[last, 0] < 0
    way = slice(first, last + 1)
    assert path.points[way, 2].max() == pytest.approx(7.0 + PLAIN.retract_lift)
    turns = np.flatnonzero(np.abs(np.diff(path.tool_axes[way], axis=0)).max(axis=1) > 1e-9)
    assert len(turns) == 1
    assert (path.points[way][turns, 2] >= 7.0).all()
    assert (path.points[way][turns + 1, 2] >= 7.0).all()


def test_reversing_and_restarting_keep_each_piece_its_section() -> None:
    points = np.array([[0.0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0], [0, 0, 0]])
    axes = np.tile([0.0, 0, 1], (5, 1))
    bead = Bead(points, axes, np.array([1.0, 1, 2, 3, 4]), np.ones(5), Role.OUTER_WALL)

    def sections(bead: Bead) -> dict[tuple[float, ...], float]:
        ends = zip(bead.points[:-1], bead.points[1:], bead.width[1:], strict=True)
        return {tuple(np.round((a + b) / 2, 6)): float(width) for a, b, width in ends}

    assert sections(reversed_bead(bead)) == sections(bead)
    for corner in points[:-1]:
        turned = started_at(bead, corner)
        assert turned.closed
        assert (turned.points[0] == corner).all()
        assert sections(turned) == sections(bead)
    split = started_at(bead, np.array([4.0, 1.5, 0]))
    assert split.closed
    assert split.points[0].tolist() == [4, 1.5, 0]
    assert split.width.tolist() == [2, 2, 3, 4, 1, 2]
