"""The deposited surface on cases whose answer is known from geometry."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from trunnion_core.bead import bead_area, bead_spacing
from trunnion_core.mesh import Mesh
from trunnion_sim.report import SurfaceReport
from trunnion_sim.surface.compare import compare, model_top
from trunnion_sim.surface.compare_kernel import distance_to_field
from trunnion_sim.surface.deposit import Deposit, Field, Pieces, lay_down

H, W = 0.3, 0.4
AREA = float(bead_area(np.array(W), np.array(H)))
PITCH = bead_spacing(W, H)
FLAT, BORE = 0.8, 0.4
LENGTH, ACROSS = 8.0, 10.0
Array = NDArray[np.float64]


def groove_floor(pitch: float = PITCH, width: float = W) -> float:
    """Mean depth of the grooves between stadium beads, by integration of the round edges."""
    u = np.linspace(0, pitch / 2, 200001)
    x = np.clip(u - (width - H) / 2, 0, H / 2)
    return float(np.mean(H / 2 - np.sqrt((H / 2) ** 2 - x**2)))


def layer(n: int, slope: float, offset: float, first: float, *, flow: float = 1.0, pitch: float = PITCH) -> Pieces:
    """n lines along x on a plane rising in y, `offset` mm along its normal above its foot line, tool on the normal."""
    angle = math.atan(slope)
    normal = np.array([0.0, -math.sin(angle), math.cos(angle)])
    up = np.array([0.0, math.cos(angle), math.sin(angle)])
    at = normal * offset + (first + pitch * np.arange(n))[:, None] * up
    starts, ends = at.copy(), at + np.array([LENGTH, 0.0, 0.0])
    odd = np.arange(n) % 2 == 1
    starts[odd], ends[odd] = ends[odd], starts[odd].copy()
    volume = np.full(n, AREA * LENGTH * flow)
    return Pieces(np.arange(n), starts, ends, np.tile(normal, (n, 1)), volume, np.ones(n, dtype=bool))


def together(*parts: Pieces) -> Pieces:
    def joined(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    n = len(joined("row"))
    return Pieces(
        np.arange(n), joined("start"), joined("end"), joined("tool_axes"), joined("volume"), np.ones(n, dtype=bool)
    )


def laid(pieces: Pieces, cell: float) -> Deposit:
    low, high = np.array([-2.0, -2.0]), np.array([LENGTH + 2.0, ACROSS + 2.0])
    return lay_down(pieces, len(pieces.row), low, high, cell, FLAT, BORE)


def middle(deposit: Deposit) -> Array:
    """Heights away from every border."""
    field = deposit.field
    ys = field.y + field.cell * np.arange(field.top.shape[0])
    xs = field.x + field.cell * np.arange(field.top.shape[1])
    return field.top[np.ix_((ys > 2) & (ys < ACROSS - 2), (xs > 1) & (xs < LENGTH - 1))].astype(float)


def wedge(slope: float, base: float) -> Mesh:
    """A block whose top is the plane z = base + slope y."""
    low = [[0, 0, 0], [LENGTH, 0, 0], [LENGTH, ACROSS, 0], [0, ACROSS, 0]]
    high = [[x, y, base + slope * y] for x, y, _ in low]
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for a in range(4):
        b = (a + 1) % 4
        faces += [[a, b, b + 4], [a, b + 4, a + 4]]
    return Mesh(np.array(low + high, dtype=np.float64), np.array(faces, dtype=np.int64))


def skin(slope: float, base: float, cell: float, flow: float = 1.0) -> SurfaceReport:
    """Conformal layers stacked up to the plane z = base + slope y, the last with `flow`, compared with it."""
    count = int((ACROSS + 4) * math.hypot(1, slope) / PITCH)
    height = base * math.cos(math.atan(slope))
    layers = [
        layer(count, slope, height - k * H, -2.0 + 0.1 * k, flow=flow if k == 0 else 1.0) for k in range(5, -1, -1)
    ]
    report = compare(laid(together(*layers), cell).field, wedge(slope, base), 60.0, H)
    assert report is not None
    return report


def stairs(slope: float, base: float, cell: float) -> SurfaceReport:
    """Planar layers cut at their middle, compared with the slope."""
    layers = []
    for k in range(math.ceil((base + slope * ACROSS) / H)):
        edge = max(0.0, ((k + 0.5) * H - base) / slope) + W / 2
        count = int((ACROSS - W / 2 - edge) / PITCH + 1e-9) + 1
        if count > 0:
            layers.append(layer(count, 0.0, (k + 1) * H, edge))
    report = compare(laid(together(*layers), cell).field, wedge(slope, base), 60.0, H)
    assert report is not None
    return report


@pytest.mark.parametrize("cell", [0.05, 0.025])
def test_a_flat_plate_has_the_groove_floor_of_round_beads(cell: float) -> None:
    deposit = laid(layer(30, 0.0, H, 0.1), cell)
    assert groove_floor() == pytest.approx(0.0121, abs=1e-4)
    assert float(np.mean(H - middle(deposit))) == pytest.approx(groove_floor(), rel=0.08)
    assert deposit.crowded.sum() < 1e-3 * AREA * LENGTH
    assert np.nanmedian(deposit.gap) == pytest.approx(H, abs=5e-4)


@pytest.mark.parametrize("length", [1, 7, 100])
def test_stretches_one_after_the_other_are_the_same_as_all_at_once(length: int) -> None:
    plates = together(*(layer(12, 0.0, (k + 1) * H, 0.1 + 0.05 * k) for k in range(3)))
    low, high = np.array([-2.0, -2.0]), np.array([LENGTH + 2.0, ACROSS + 2.0])
    whole = laid(plates, 0.05)
    stretches = (plates.cut(at, at + length) for at in range(0, len(plates.row), length))
    apart = lay_down(stretches, len(plates.row), low, high, 0.05, FLAT, BORE)
    np.testing.assert_array_equal(apart.field.top, whole.field.top)
    for name in ("gap", "laid", "unsupported", "crowded", "bulged", "depth", "depth_point", "taken"):
        np.testing.assert_array_equal(getattr(apart, name), getattr(whole, name))


@pytest.mark.parametrize("pitch", [0.36, 0.39])
def test_wider_pitch_leaves_deeper_grooves_as_predicted(pitch: float) -> None:
    deposit = laid(layer(25, 0.0, H, 0.1, pitch=pitch), 0.025)
    assert float(np.mean(H - middle(deposit))) == pytest.approx(groove_floor(pitch), rel=0.03)


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.364, 0.7])
def test_a_conformal_skin_on_a_smooth_ramp_has_the_groove_floor(slope: float) -> None:
    base = 3.0
    rise = H * math.hypot(1, slope)
    lines = layer(int(14 * math.hypot(1, slope) / PITCH), slope, base * math.cos(math.atan(slope)), -2.0)
    low, high = np.array([-2.0, -2.0]), np.array([LENGTH + 2.0, ACROSS + 2.0])
    deposit = lay_down(
        lines,
        len(lines.row),
        low,
        high,
        W / 12,
        FLAT,
        BORE,
        lambda x, y: 0 * x + np.maximum(base - rise + slope * y, 0),
    )
    report = compare(deposit.field, wedge(slope, base), 60.0, H)
    assert report is not None
    assert np.mean(np.abs(report.deviation)) == pytest.approx(groove_floor(), rel=0.08)
    assert report.chamfer == pytest.approx(2 * groove_floor(), rel=0.08)
    assert report.overfill_fraction < 0.01


def over_ripples(period: float) -> Deposit:
    """One layer of constant flow over a ground that rises and falls by 0.05 mm along the lines."""
    lines = layer(30, 0.0, 2 * H, 0.1)
    low, high = np.array([-2.0, -2.0]), np.array([LENGTH + 2.0, ACROSS + 2.0])
    return lay_down(
        lines, 30, low, high, 0.025, FLAT, BORE, lambda x, y: 0 * y + H + 0.05 * np.sin(2 * np.pi * x / period)
    )


def test_plastic_is_carried_as_far_as_the_bore_and_no_farther() -> None:
    narrow, wide = over_ripples(BORE / 2), over_ripples(4.0)
    # As over flat ground; what little is pressed aside narrows the grooves.
    assert 0.65 * groove_floor() < float(np.mean(2 * H - middle(narrow))) < 1.1 * groove_floor()
    assert middle(narrow).max() < 2 * H + 0.01
    # Over ripples longer than the bore the bead has too much plastic on their backs.
    assert middle(wide).max() > 2 * H + 0.015


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.364])
def test_a_skin_over_skins_also_fills_the_grooves_below(slope: float) -> None:
    report = skin(slope, 3.0, W / 12)
    assert 2 * groove_floor() < report.chamfer < 3.2 * groove_floor()
    assert report.overfill_fraction < 0.01


@pytest.mark.parametrize("slope", [0.05, 0.1, 0.2])
def test_planar_stairs_have_a_quarter_of_the_layer_both_ways(slope: float) -> None:
    report = stairs(slope, 1.0, W / 12)
    # a quarter of the layer across the slope one way and about as much back, the round edges take a little off
    expected = 2 * H / 4 * math.cos(math.atan(slope))
    assert 0.88 * expected < report.chamfer < 1.05 * expected


@pytest.mark.parametrize("case", ["skin", "stairs"])
def test_halving_the_grid_changes_chamfer_by_less_than_three_percent(case: str) -> None:
    coarse, fine = (
        (skin(0.2, 3.0, cell) if case == "skin" else stairs(0.2, 1.0, cell)).chamfer for cell in (W / 12, W / 24)
    )
    assert abs(coarse / fine - 1) < 0.03


def test_a_planted_error_of_height_moves_the_figure_by_that_much() -> None:
    exact = skin(0.2, 3.0, W / 12)
    low = compare_shifted(0.1)
    # with the skin 0.1 mm low every distance grows by that, both ways
    assert low.chamfer - exact.chamfer == pytest.approx(0.2, abs=0.015)
    assert np.mean(low.deviation) - np.mean(exact.deviation) == pytest.approx(-0.1, abs=0.005)


def compare_shifted(by: float) -> SurfaceReport:
    """The conformal skin against a model that stands `by` mm higher, measured across the slope."""
    count = int((ACROSS + 4) * math.hypot(1, 0.2) / PITCH)
    height = 3.0 * math.cos(math.atan(0.2))
    layers = [layer(count, 0.2, height - by - k * H, -2.0 + 0.1 * k) for k in range(5, -1, -1)]
    report = compare(laid(together(*layers), W / 12).field, wedge(0.2, 3.0), 60.0, H)
    assert report is not None
    return report


def test_random_errors_of_height_add_up_as_predicted() -> None:
    rng = np.random.default_rng(5)
    pieces = layer(30, 0.0, H, 0.1)
    error = rng.normal(0.0, 0.03, 30)
    moved = Pieces(
        pieces.row,
        pieces.start + np.outer(error, [0, 0, 1]),
        pieces.end + np.outer(error, [0, 0, 1]),
        pieces.tool_axes,
        pieces.volume,
        pieces.present,
    )
    tops = laid(moved, 0.025)
    field = tops.field
    rows = np.round((0.1 + PITCH * np.arange(3, 27) - field.y) / field.cell).astype(int)
    column = int((LENGTH / 2 - field.x) / field.cell)
    assert field.top[rows, column] == pytest.approx(H + error[3:27], abs=0.02)
    assert np.std(field.top[rows, column]) == pytest.approx(np.std(error[3:27]), rel=0.25)


def test_too_much_plastic_is_kept_and_stands_above_the_nozzle() -> None:
    exact = laid(layer(30, 0.0, H, 0.1), 0.025)
    much = laid(layer(30, 0.0, H, 0.1, flow=1.2), 0.025)
    assert exact.bulged.sum() == pytest.approx(0.0, abs=1e-3)
    assert much.bulged.sum() > 0.05 * 30 * AREA * LENGTH
    gained = float(np.mean(middle(much)) - np.mean(middle(exact)))
    # a fifth of a layer more plastic: what fills the grooves on top and below is not seen
    assert 0.2 * H - 3 * groove_floor() < gained < 0.2 * H


def test_a_lone_bead_keeps_its_volume() -> None:
    pieces = layer(1, 0.0, H, 5.003)
    deposit = laid(pieces, 0.0125)
    under = float(deposit.field.top.sum()) * deposit.field.cell**2
    # the field fills the pores under both round edges
    pores = (1 - math.pi / 4) * (H / 2) ** 2 * 2 * LENGTH
    assert under - pores == pytest.approx(AREA * LENGTH, rel=0.02)


def test_a_squeezed_bead_is_wider() -> None:
    def width_at(gap: float) -> float:
        deposit = laid(layer(1, 0.0, gap, 5.0), 0.0125)
        column = deposit.field.top[:, deposit.field.top.shape[1] // 2]
        return float(np.count_nonzero(column) * deposit.field.cell)

    for gap in (0.15, 0.2, 0.25):
        expected = (AREA - math.pi / 4 * gap**2) / gap + gap
        assert width_at(gap) == pytest.approx(expected, abs=0.03)


def test_a_bead_against_a_neighbour_widens_on_its_free_side() -> None:
    lines = layer(2, 0.0, H, 5.0, pitch=0.2)
    both = laid(lines, 0.0125)
    column = both.field.top[:, both.field.top.shape[1] // 2]
    ys = both.field.y + both.field.cell * np.flatnonzero(column)
    assert ys.max() > 5.2 + W / 2 + 0.02
    assert ys.min() == pytest.approx(5.0 - W / 2, abs=0.03)


def test_conformal_beads_on_a_lying_cylinder_follow_its_wall() -> None:
    radius, base = 12.0, -6.0
    angles = np.arange(-0.5, 0.5, PITCH / radius)
    layers = []
    for k in range(4, -1, -1):
        r = radius - k * H
        normal = np.column_stack([np.zeros(len(angles)), np.sin(angles), np.cos(angles)])
        at = normal * r + [0.0, ACROSS / 2, base]
        ends = at + np.array([LENGTH, 0.0, 0.0])
        n = len(angles)
        volume = np.full(n, AREA * LENGTH * (r - H / 2) / radius)
        layers.append(Pieces(np.arange(n), at, ends, normal, volume, np.ones(n, dtype=bool)))
    turn = np.linspace(-0.6, 0.6, 241)
    ring = np.column_stack([ACROSS / 2 + radius * np.sin(turn), base + radius * np.cos(turn)])
    near = np.column_stack([np.zeros(len(ring)), ring])
    vertices = np.concatenate([near, near + np.array([LENGTH, 0.0, 0.0])])
    i, m = np.arange(len(ring) - 1), len(ring)
    faces = np.concatenate([np.column_stack([i, i + m, i + 1]), np.column_stack([i + 1, i + m, i + m + 1])])
    report = compare(laid(together(*layers), W / 12).field, Mesh(vertices, faces), 20.0, H)
    assert report is not None
    assert 2 * groove_floor() < report.chamfer < 3.2 * groove_floor()


def test_a_travel_that_dips_into_the_print_is_measured() -> None:
    plate = layer(20, 0.0, H, 0.1)
    travel = Pieces(
        np.array([20]),
        np.array([[4.0, -1.0, 0.2]]),
        np.array([[4.0, 9.0, 0.2]]),
        np.array([[0.0, 0.0, 1.0]]),
        np.zeros(1),
        np.ones(1, dtype=bool),
    )
    assert laid(together(plate, travel), 0.05).depth[20] == pytest.approx(0.1, abs=0.005)


def test_topmost_facets_are_found_through_a_stack() -> None:
    under, over = wedge(0.0, 1.0), wedge(0.5, 2.0)
    both = Mesh(
        np.concatenate([under.vertices, over.vertices]), np.concatenate([under.faces, over.faces + len(under.vertices)])
    )
    xy = np.random.default_rng(1).random((500, 2)) * [LENGTH, ACROSS]
    z, face = model_top(both, xy)
    assert z == pytest.approx(2.0 + 0.5 * xy[:, 1])
    assert (face >= len(under.faces)).all()
    outside, none = model_top(both, np.array([[-1.0, 0.0]]))
    assert np.isnan(outside[0])
    assert none[0] == -1


def test_distance_to_a_field_is_that_to_its_plane() -> None:
    cell = 0.1
    ys, xs = np.mgrid[0:60, 0:60] * cell
    field = Field(0.0, 0.0, cell, (0.3 * xs + 0.2 * ys).astype(np.float32))
    points = np.random.default_rng(2).random((200, 3)) * [2, 2, 1] + [2, 2, 1]
    vertical = np.abs(points[:, 2] - 0.3 * points[:, 0] - 0.2 * points[:, 1])
    expected = vertical / math.sqrt(1 + 0.3**2 + 0.2**2)
    assert distance_to_field(field.top, 0.0, 0.0, cell, points, vertical) == pytest.approx(expected, abs=1e-5)
