"""The map of planar beads and the gap over stairs, against what geometry says."""

import numpy as np
import pytest
from manifold3d import Manifold

from trunnion_core.arrays import FloatArray
from trunnion_core.bead import bead_area, bead_spacing, bead_width
from trunnion_core.layers import Bead, Layer
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.beads import flat_bead
from trunnion_slicer.nonplanar.plan import plan_nonplanar
from trunnion_slicer.nonplanar.stairs import groove_depth
from trunnion_slicer.nonplanar.tops import bead_tops

W, H = 0.4, 0.3
PITCH = bead_spacing(W, H)


def plate(count: int, z: float) -> Layer:
    """Straight lines along X, 10 mm long."""
    lines = [np.array([[0.0, y], [10.0, y]]) for y in PITCH * np.arange(count)]
    return Layer("planar", z, H, tuple(flat_bead(line, z, W, H, Role.SOLID_INFILL) for line in lines))


def section(heights: FloatArray) -> FloatArray:
    return heights[heights.shape[0] // 2]


def test_a_plate_of_stadiums_has_their_grooves() -> None:
    low, high = np.array([0.0, PITCH, 0.0]), np.array([10.0, 20 * PITCH, 1.0])
    tops = bead_tops([plate(22, H)], low, high, 0.05, 0.0)
    u = np.linspace(0, PITCH / 2, 100001)
    x = np.clip(u - (W - H) / 2, 0, H / 2)
    ideal = np.mean(H / 2 - np.sqrt((H / 2) ** 2 - x**2))
    assert H - section(tops.height).mean() == pytest.approx(ideal, rel=0.05)
    assert tops.height.max() == pytest.approx(H)


def test_grooves_settle_where_every_layer_leaves_what_it_fills() -> None:
    depth = groove_depth(W, H)
    deep = H + depth
    wide = float(bead_width(np.array(PITCH * H), np.array(deep)))
    u = np.linspace(0, PITCH / 2, 100001)
    x = np.clip(u - (wide - deep) / 2, 0, deep / 2)
    assert np.mean(deep / 2 - np.sqrt((deep / 2) ** 2 - x**2)) == pytest.approx(depth, rel=1e-3)
    assert groove_depth(W, 0.2) < depth / 2


def test_layers_outside_the_heights_asked_for_do_not_count() -> None:
    low, high = np.array([0.0, 0.0, 0.5]), np.array([10.0, 5.0, 1.0])
    tops = bead_tops([plate(20, 0.3), plate(20, 0.6), plate(20, 1.2)], low, high, W, 0.0)
    assert tops.height.max() == pytest.approx(0.6)
    assert tops.centres.shape == (tops.height.size, 2)


def test_a_lone_bead_is_round_at_its_edge() -> None:
    tops = bead_tops([plate(1, H)], np.array([0.0, -1.0, 0.0]), np.array([10.0, 1.0, 1.0]), 0.06, 0.0)
    y = tops.low[1] + tops.cell * np.arange(tops.height.shape[1])
    profile = section(tops.height)
    at_edge = np.interp(W / 2 - 0.05, y, profile)
    assert at_edge == pytest.approx(H / 2 + np.sqrt(0.15**2 - 0.1**2), abs=0.01)
    assert (profile[np.abs(y) > W / 2 + 1e-9] == 0).all()


@pytest.mark.parametrize("rim", [2.0, 2.1, 2.2])
def test_a_wall_at_the_border_has_the_plastic_of_its_place(rim: float) -> None:
    """Nothing beside the border is room to fill, also where cells of the map lie on it (walls were 30 % too fat)."""
    roof = Manifold.cube([20, 12, 9]).trim_by_plane(
        [0, np.sin(np.pi / 6), -np.cos(np.pi / 6)], -rim * np.cos(np.pi / 6)
    )
    found = roof.to_mesh64()
    plan = plan_nonplanar(
        Mesh(found.vert_properties[:, :3].copy(), found.tri_verts.astype(np.int64)),
        PrintSettings(layer_height=H, extrusion_width=W, fill_density=100, skirts=0, nonplanar_layers=1),
    )
    assert plan is not None
    y = np.linspace(0, 2, 4001)
    top = np.zeros_like(y)
    for layer in plan.planar.layers:
        for bead in layer.beads:
            for row, middle in crossings(bead, 10.0):
                inside = np.clip(bead.width[row] / 2 - np.abs(y - middle), 0, H / 2)
                round_top = layer.z - H / 2 + np.sqrt((H / 2) ** 2 - (H / 2 - inside) ** 2)
                top = np.where(np.abs(y - middle) < bead.width[row] / 2, np.maximum(top, round_top), top)
    (wall,) = [
        (bead, row)
        for bead in plan.layers[0].beads
        for row, middle in crossings(bead, 10.0)
        if bead.role == Role.NONPLANAR_OUTER_WALL and middle < 1
    ]
    bead, row = wall
    own = PITCH * np.cos(np.pi / 6)
    room = (rim + y * np.tan(np.pi / 6) - top)[y < own].sum() * (y[1] - y[0])
    assert float(bead_area(bead.width, bead.height)[row]) == pytest.approx(room, rel=0.15)


def crossings(bead: Bead, x: float) -> list[tuple[int, float]]:
    """Rows of a bead whose pieces cross the plane at x, and where in Y."""
    a, b = bead.points[:-1], bead.points[1:]
    rows = np.flatnonzero((a[:, 0] < x) != (b[:, 0] < x))
    share = (x - a[rows, 0]) / (b[rows, 0] - a[rows, 0])
    return [(int(row) + 1, float(at)) for row, at in zip(rows, a[rows, 1] + share * (b - a)[rows, 1], strict=True)]
