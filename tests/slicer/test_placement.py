"""Parts come to the middle of the bed, or are refused with axis and amount."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.errors import PlacementError
from trunnion_core.mesh import Mesh
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_slicer.placement import place

SQUARE = load_profile("generic_3axis")
ROUND = load_profile("generic_ab_cradle")
AS_IN_FILE = PrintSettings(center=False)


def box(low, high):
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return Mesh(low + corners * (high - low), np.array(faces))


@pytest.mark.parametrize("profile", [SQUARE, ROUND], ids=lambda profile: profile.bed.shape)
def test_the_part_comes_to_the_middle_and_rests_on_the_bed(profile):
    mesh = box([300, -40, -7], [320, -10, 5])
    placed, shift = place(mesh, profile, PrintSettings())
    assert_allclose(placed.bounds, [[-10, -15, 0], [10, 15, 12]])
    assert_allclose(placed.vertices, mesh.vertices + shift)


def test_without_centring_nothing_moves():
    mesh = box([30, -40, 0], [50, -10, 5])
    placed, shift = place(mesh, SQUARE, AS_IN_FILE)
    assert_allclose(placed.vertices, mesh.vertices, rtol=0, atol=0)
    assert not shift.any()


def test_a_vertex_that_no_face_uses_does_not_count():
    mesh = box([0, 0, 0], [10, 10, 10])
    stray = Mesh(np.vstack([mesh.vertices, [[9e9, 0, -5]]]), mesh.faces)
    placed, _ = place(stray, ROUND, PrintSettings())
    assert_allclose(placed.bounds, [[-5, -5, 0], [5, 5, 10]])


@pytest.mark.parametrize(
    ("mesh", "profile", "settings", "sentence"),
    [
        (box([0, 0, 0], [232.5, 10, 10]), SQUARE, PrintSettings(), r"X: 12\.500 mm too large, 232\.500 mm on a bed"),
        (box([0, 0, 0], [10, 232.5, 10]), SQUARE, PrintSettings(), r"Y: 12\.500 mm too large"),
        (box([0, 0, 0], [10, 10, 251]), SQUARE, PrintSettings(), r"Z: 1\.000 mm too tall"),
        (box([0, 0, -2], [10, 10, 20]), SQUARE, AS_IN_FILE, r"Z: 2\.000 mm below the bed"),
        (box([105, 0, 0], [115, 10, 20]), SQUARE, AS_IN_FILE, r"X: 5\.000 mm over the edge"),
        (box([0, -115, 0], [10, 0, 20]), SQUARE, AS_IN_FILE, r"Y: 5\.000 mm over the edge"),
        (box([0, 0, 0], [160, 160, 20]), ROUND, PrintSettings(), r"13\.137 mm over the edge of the round bed"),
        (box([90, 0, 0], [110, 1, 20]), ROUND, AS_IN_FILE, r"over the edge of the round bed at \(110\.000, 1\.000\)"),
    ],
)
def test_what_sticks_out_is_named_with_axis_and_amount(mesh, profile, settings, sentence):
    with pytest.raises(PlacementError, match=sentence):
        place(mesh, profile, settings)


def test_a_part_as_large_as_the_bed_fits_and_all_problems_come_at_once():
    place(box([0, 0, 0], [220, 220, 250]), SQUARE, PrintSettings())
    with pytest.raises(PlacementError, match=r"Z: .* X: .* Y: "):
        place(box([0, 0, 0], [221, 222, 253]), SQUARE, PrintSettings())
