"""What dataclasses refuse at their door, and the one rule of the bead."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trunnion_core.arrays import check_array, check_unit_rows, freeze
from trunnion_core.bead import bead_area, bead_spacing, bead_width
from trunnion_core.mesh import Mesh

SIZES = st.floats(0.02, 3.0)


@given(SIZES, SIZES)
def test_the_width_of_a_bead_is_the_inverse_of_its_area(width, height):
    area = bead_area(np.array([width]), np.array([height]))
    assert bead_width(area, np.array([height])) == pytest.approx(np.array([width]), rel=1e-9)


@given(SIZES, SIZES)
def test_a_wider_bead_holds_more_and_never_more_than_its_rectangle(width, height):
    area, wider = bead_area(np.array([width, width * 1.1]), np.array([height, height]))
    assert 0 < area < wider
    assert area < width * height


def test_beads_at_their_spacing_fill_the_layer():
    assert bead_spacing(0.4, 0.3) == pytest.approx(0.4 - 0.3 * (1 - np.pi / 4))
    assert bead_spacing(0.4, 0.3) * 0.3 == pytest.approx(float(bead_area(np.array(0.4), np.array(0.3))))


def test_arrays_are_checked_for_shape_and_numbers():
    check_array("a", np.zeros((4, 3)), (None, 3))
    with pytest.raises(ValueError, match=r"a: shape \(4, 2\), should be \(None, 3\)"):
        check_array("a", np.zeros((4, 2)), (None, 3))
    with pytest.raises(ValueError, match="a: row 1"):
        check_array("a", np.array([0.0, np.nan]), (2,))
    check_array("a", np.array([0.0, np.nan]), (2,), finite=False)
    with pytest.raises(ValueError, match=r"row 1 has length 1\.1, should be 1"):
        check_unit_rows("n", np.array([[0, 0, 1], [0, 0, 1.1]]), 2)


def test_a_frozen_array_cannot_be_written():
    array = np.zeros(3)
    freeze(array)
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1


def test_a_mesh_refuses_faces_on_vertices_that_are_not_there():
    with pytest.raises(ValueError, match="rows up to 3, but there are 3 vertices"):
        Mesh(np.eye(3), np.array([[0, 1, 3]]))
    with pytest.raises(ValueError, match="vertices: row 0"):
        Mesh(np.full((3, 3), np.inf), np.array([[0, 1, 2]]))


def test_the_bounds_of_a_mesh_are_those_of_its_faces():
    mesh = Mesh(np.vstack([np.eye(3), [[9, 9, 9]]]), np.array([[0, 1, 2]]))
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 1]]
