"""The deposited surface on cases whose answer is known from geometry."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from trunnion_core.bead import bead_area, bead_spacing
from trunnion_core.mesh import Mesh
from trunnion_sim.report import SurfaceReport
from trunnion_sim.surface.compare import compare, heights, model_top
from trunnion_sim.surface.compare_kernel import distance_to_field
from trunnion_sim.surface.deposit import Deposit, Field, Pieces, lay_down
from trunnion_sim.surface.deposit_kernel import MOST_RELAXED, RELAX

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


def across(deposit: Deposit, x: float = LENGTH / 2 + 0.013) -> tuple[Array, Array]:
    """Y every 0.005 mm, and the surface there, on a cut at x."""
    ys = np.arange(-1.0, ACROSS + 1.0, 0.005)
    return ys, heights(deposit.field, np.column_stack([np.full(len(ys), x), ys]))


def middle(deposit: Deposit) -> Array:
    """Heights away from every border, (rows along y, columns along x)."""
    ys, xs = np.arange(2.0, ACROSS - 2.0, 0.02), np.arange(1.0, LENGTH - 1.0, 0.037)
    points = np.stack(np.meshgrid(xs, ys), axis=-1)
    return heights(deposit.field, points.reshape(-1, 2)).reshape(points.shape[:2])


def wedge(slope: float, base: float) -> Mesh:
    """A block whose top is the plane z = base + slope y."""
    low = [[0, 0, 0], [LENGTH, 0, 0], [LENGTH, ACROSS, 0], [0, ACROSS, 0]]
    high = [[x, y, base + slope * y] for x, y, _ in low]
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for a in range(4):
        b = (a + 1) % 4
        faces += [[a, b, b + 4], [a, b + 4, a + 4]]
    return Mesh(np.array(low + high, dtype=np.float64), np.array(faces, dtype=np.int64))


def skin(slope: float, base: float, cell: float, flow: float = 1.0, low: float = 0.0) -> SurfaceReport:
    """Three conformal layers on a smooth ramp, up to the plane z = base + slope y, the last with `flow`.

    Compared with that plane; the layers lie `low` mm below it.
    """
    normal = math.hypot(1, slope)
    count = int((ACROSS + 6 + slope * base) * normal / PITCH)
    first = -3.0 * normal  # well before the foot
    layers = [
        layer(count, slope, base / normal - low - k * H, first + 0.1 * k, flow=flow if k == 0 else 1.0)
        for k in (2, 1, 0)
    ]
    pieces = together(*layers)
    ground = base - (low + 3 * H) * normal
    corner = np.array([2.0, 2.0])
    deposit = lay_down(
        pieces,
        len(pieces.row),
        -corner,
        corner + np.array([LENGTH, ACROSS]),
        cell,
        FLAT,
        BORE,
        lambda x, y: 0 * x + np.maximum(ground + slope * y, 0),
    )
    report = compare(deposit.field, wedge(slope, base), 60.0, H)
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


@pytest.mark.parametrize("cell", [W / 12, W / 24])
def test_a_flat_plate_has_the_groove_floor_of_round_beads(cell: float) -> None:
    deposit = laid(layer(30, 0.0, H, 0.1), cell)
    assert groove_floor() == pytest.approx(0.0121, abs=1e-4)
    assert float(np.mean(H - middle(deposit))) == pytest.approx(groove_floor(), rel=0.03)
    assert deposit.bulged.sum() < 5e-4 * deposit.balance.fed
    assert np.nanmedian(deposit.gap) == pytest.approx(H, abs=1e-5)


@pytest.mark.parametrize("length", [1, 7, 100])
def test_stretches_one_after_the_other_are_the_same_as_all_at_once(length: int) -> None:
    plates = together(*(layer(12, 0.0, (k + 1) * H, 0.1 + 0.05 * k) for k in range(3)))
    low, high = np.array([-2.0, -2.0]), np.array([LENGTH + 2.0, ACROSS + 2.0])
    whole = laid(plates, 0.05)
    stretches = (plates.cut(at, at + length) for at in range(0, len(plates.row), length))
    apart = lay_down(stretches, len(plates.row), low, high, 0.05, FLAT, BORE)
    np.testing.assert_array_equal(apart.field.top, whole.field.top)
    for name in ("gap", "laid", "unsupported", "bulged", "depth", "depth_point"):
        np.testing.assert_array_equal(getattr(apart, name), getattr(whole, name))


@pytest.mark.parametrize("pitch", [0.36, 0.39])
def test_wider_pitch_leaves_deeper_grooves_as_predicted(pitch: float) -> None:
    deposit = laid(layer(25, 0.0, H, 0.1, pitch=pitch), W / 24)
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
    assert np.mean(np.abs(report.deviation)) == pytest.approx(groove_floor(), rel=0.04)
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


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.364, 0.75])
def test_a_skin_over_skins_has_the_groove_floor_too_and_the_same_on_a_finer_grid(slope: float) -> None:
    coarse, fine = (skin(slope, 7.0, cell) for cell in (W / 12, W / 24))
    # one way the depth of the grooves; the other way the nearest spot, which is nearer
    for report in (coarse, fine):
        assert np.mean(np.abs(report.deviation)) == pytest.approx(groove_floor(), rel=0.04)
    assert coarse.chamfer / fine.chamfer == pytest.approx(1, abs=0.03)
    assert coarse.overfill_fraction < 1e-3


@pytest.mark.parametrize("slope", [0.1, 0.364])
def test_planar_stairs_have_the_chamfer_of_square_stairs_less_what_the_grooves_take(slope: float) -> None:
    coarse, fine = (stairs(slope, 1.0, cell).chamfer for cell in (W / 12, W / 24))
    # a quarter of the layer across the slope one way; back, the riser is often nearer than the tread
    square = H / 4 * (math.cos(math.atan(slope)) + 1 / (1 + slope))
    assert 0.9 * square < fine < 1.1 * square
    assert coarse / fine == pytest.approx(1, abs=0.03)


def test_a_planted_error_of_height_moves_the_figure_by_that_much() -> None:
    exact, low = skin(0.2, 3.0, W / 12), skin(0.2, 3.0, W / 12, low=0.1)
    # with the skin 0.1 mm low every distance grows by that, both ways; back, the nearest spot is no groove any more
    assert 0.18 < low.chamfer - exact.chamfer < 0.2
    # but along the rim, where the side of the wedge is nearer than its top
    rim = 2 * (LENGTH + ACROSS) * 0.1**2 / 2 / (LENGTH * ACROSS)
    assert np.mean(low.deviation) - np.mean(exact.deviation) == pytest.approx(-0.1 + rim, abs=1e-3)


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
    middles = np.column_stack([np.full(24, LENGTH / 2), 0.1 + PITCH * np.arange(3, 27)])
    found = heights(tops.field, middles)
    assert found == pytest.approx(H + error[3:27], abs=0.02)
    assert np.std(found) == pytest.approx(np.std(error[3:27]), rel=0.25)


@pytest.mark.parametrize("cell", [W / 12, W / 24])
def test_three_solid_layers_over_air_have_grooves_and_no_holes(cell: float) -> None:
    """A cylinder's top over sparse infill read 7.5 mm deep where slits of crossed layers lay above each other."""
    h = 0.2  # beads in the air are threads 0.30 mm thick, 0.36 mm apart
    area, pitch = float(bead_area(np.array(W), np.array(h))), bead_spacing(W, h)
    at = np.arange(0.1, LENGTH, pitch)
    n = len(at)
    one, far = np.zeros(n), np.full(n, LENGTH)
    layers = []
    for k in range(3):
        start, end = (at, one), (at, far)
        if k % 2:
            start, end = start[::-1], end[::-1]
        z = np.full(n, 5 + (k + 1) * h)
        layers.append((np.column_stack([*start, z]), np.column_stack([*end, z])))
    start, end = (np.concatenate(part) for part in zip(*layers, strict=True))
    m = len(start)
    axes = np.tile([0.0, 0.0, 1.0], (m, 1))
    lines = Pieces(np.arange(m), start, end, axes, np.full(m, area * LENGTH), np.ones(m, dtype=bool))
    found = middle_of(laid(lines, cell))
    assert 0 < float(np.mean(5 + 3 * h - found)) < 0.05
    assert float(found.min()) > 5 + 3 * h - 0.3


def middle_of(deposit: Deposit) -> Array:
    grid = np.stack(np.meshgrid(np.arange(1, LENGTH - 1, 0.021), np.arange(1, LENGTH - 1, 0.021)), axis=-1)
    return heights(deposit.field, grid.reshape(-1, 2))


def test_too_much_plastic_is_kept_and_stands_above_the_nozzle() -> None:
    exact = laid(layer(30, 0.0, H, 0.1), 0.025)
    much = laid(layer(30, 0.0, H, 0.1, flow=1.2), 0.025)
    assert exact.bulged.sum() < 5e-4 * exact.balance.fed
    assert much.bulged.sum() > 0.05 * 30 * AREA * LENGTH
    gained = float(np.mean(middle(much)) - np.mean(middle(exact)))
    # a fifth of a layer more plastic, grooves as before or narrower
    assert 0.2 * H - 0.5 * groove_floor() < gained < 0.2 * H + groove_floor()


@pytest.mark.parametrize("flow", [0.8, 0.9, 1.0, 1.1, 1.2, 1.5])
def test_no_plastic_vanishes(flow: float) -> None:
    balance = laid(layer(30, 0.0, H, 0.1, flow=flow), W / 12).balance
    assert balance.fed == pytest.approx(30 * AREA * LENGTH * flow)
    waits = MOST_RELAXED * AREA * flow * RELAX  # in the nozzle when all is over, at most
    assert -1e-3 * balance.fed < balance.fed - balance.kept < 1e-3 * balance.fed + (waits if flow > 1 else 0.0)
    assert balance.kept + balance.beyond + balance.not_laid == pytest.approx(balance.fed, rel=1e-9)


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
        ys, column = across(deposit)
        return float(np.count_nonzero(column > gap / 2) * (ys[1] - ys[0]))

    for gap in (0.15, 0.2, 0.25):
        expected = (AREA - math.pi / 4 * gap**2) / gap + gap
        assert width_at(gap) == pytest.approx(expected, abs=0.03)


def test_a_bead_against_a_neighbour_widens_on_its_free_side() -> None:
    lines = layer(2, 0.0, H, 5.0, pitch=0.2)
    both = laid(lines, 0.0125)
    ys, column = across(both)
    ys = ys[column > H / 4]
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
    pieces = together(*layers)
    low, high = np.array([-2.0, -2.0]), np.array([LENGTH + 2.0, ACROSS + 2.0])

    def ground(x: Array, y: Array) -> Array:
        return np.asarray(0 * x + base + np.sqrt((radius - 5 * H) ** 2 - (y - ACROSS / 2) ** 2))

    deposit = lay_down(pieces, len(pieces.row), low, high, W / 12, FLAT, BORE, ground)
    report = compare(deposit.field, Mesh(vertices, faces), 20.0, H)
    assert report is not None
    assert 1.8 * groove_floor() < report.chamfer < 2.4 * groove_floor()


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
