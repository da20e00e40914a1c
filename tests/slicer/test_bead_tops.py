"""The map of planar beads and the gap over stairs, against what geometry says."""

import numpy as np
import pytest

from trunnion_core.arrays import FloatArray
from trunnion_core.bead import bead_spacing, bead_width
from trunnion_core.layers import Layer
from trunnion_core.roles import Role
from trunnion_slicer.beads import flat_bead
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
