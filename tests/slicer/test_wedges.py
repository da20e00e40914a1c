"""The two branches of a sharp turn share the room between them: no place is filled twice, no plastic is lost."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiPolygon, Point

from trunnion_core.bead import bead_area
from trunnion_core.layers import Bead
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.infill import fill
from trunnion_slicer.planar import planar_layers
from trunnion_slicer.wedges import laid_length, shared

S = 0.336


def wedge(degrees: float, length: float) -> np.ndarray:
    """Out along one branch and back along the other, which leaves at an angle."""
    angle = np.radians(degrees)
    return length * np.array([[1.0, 0.0], [0.0, 0.0], [np.cos(angle), np.sin(angle)]])


@pytest.mark.parametrize("degrees", [3.0, 8.0, 15.0, 24.0])
def test_both_branches_get_the_room_that_is_there(degrees: float) -> None:
    """Room for g + S at a gap of g: over the wedge's length L, where g = S at its mouth, 3/4 of two whole beads."""
    line = wedge(degrees, 20.0)
    points, share = shared(line, S)
    mouth = S / (2 * np.sin(np.radians(degrees / 2)))
    assert laid_length(points, share) == pytest.approx(40.0 - mouth / 2, abs=S / 2)
    assert share.min() == pytest.approx(0.5, abs=0.15)
    assert share.max() == 1.0
    far = np.linalg.norm(points[1:], axis=1) > mouth + S
    assert (share[1:][far] == 1.0).all()


@pytest.mark.parametrize("degrees", [27.0, 60.0, 90.0, 180.0])
def test_ordinary_corners_stay_as_they_are(degrees: float) -> None:
    line = wedge(degrees, 20.0)
    points, share = shared(line, S)
    assert (points == line).all()
    assert (share == 1.0).all()


def test_a_square_zigzag_stays_as_it_is() -> None:
    (line,) = fill("rectilinear", MultiPolygon([shapely.box(0, 0, 20, 20)]), S, 0.0)
    points, share = shared(line, S)
    assert len(points) == len(line)
    assert (share == 1.0).all()


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=3, max_size=12, unique=True),
    st.floats(0.2, 2.0),
)
def test_any_line_keeps_its_way(corners: list[tuple[int, int]], spacing: float) -> None:
    line = np.array(corners) / 10.0
    points, share = shared(line, spacing)
    assert len(points) == len(share)
    assert LineString(points).length == pytest.approx(LineString(line).length, abs=1e-9)
    assert ((share >= 0.5) & (share <= 1.0)).all()
    assert (points[0] == line[0]).all()
    assert (points[-1] == line[-1]).all()


def test_the_first_and_last_lines_of_a_disc_do_not_lie_twice() -> None:
    """Turns along the flat ends of a disc ran over the next line for millimetres: two whole beads in one place."""
    line = fill("rectilinear", MultiPolygon([Point(0, 0).buffer(9.3, 64)]), S, 0.0)[0]
    line = line[line[:, 1] < -8.6]
    points, share = shared(line, S)
    assert twice(line, np.ones(len(line))) > 0.3
    assert twice(points, share) < 0.6 * twice(line, np.ones(len(line)))


def twice(points: np.ndarray, share: np.ndarray) -> float:
    """mm² under one bead that lie under an earlier piece of it too."""
    pieces = [
        LineString(points[i : i + 2]).buffer(S / 2 * share[i + 1], cap_style="flat") for i in range(len(points) - 1)
    ]
    return float(sum(piece.area for piece in pieces) - shapely.union_all(pieces).area)


def test_a_disc_of_wedges_holds_its_volume() -> None:
    ring = 10 * np.column_stack([np.cos(a := np.linspace(0, 2 * np.pi, 97)[:-1]), np.sin(a)])
    n = len(ring)
    here, following = np.arange(n), (np.arange(n) + 1) % n
    vertices = np.vstack([np.column_stack([ring, np.full(n, z)]) for z in (0.0, 3.0)] + [[[0, 0, 0], [0, 0, 3.0]]])
    triples = [
        (here, following, following + n),
        (here, following + n, here + n),
        (following, here, np.full(n, 2 * n)),
        (here + n, following + n, np.full(n, 2 * n + 1)),
    ]
    disc = Mesh(vertices, np.concatenate([np.stack(triple, axis=1) for triple in triples]).astype(np.int64))
    layers = planar_layers(disc, PrintSettings(layer_height=0.3, fill_density=100, skirts=0))
    area = n / 2 * 100 * np.sin(2 * np.pi / n)
    assert sum(volume(bead) for layer in layers for bead in layer.beads) == pytest.approx(area * 3.0, rel=0.01)
    fills = [bead for bead in layers[3].beads if bead.role == Role.SOLID_INFILL]
    assert fills
    assert any(np.ptp(bead.width) > 0.1 for bead in fills)


def volume(bead: Bead) -> float:
    length = np.linalg.norm(np.diff(bead.points, axis=0), axis=1)
    return float((bead_area(bead.width, bead.height)[1:] * length).sum())
