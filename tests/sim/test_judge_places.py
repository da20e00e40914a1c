"""How much of a bead's place was another bead's before: cases whose answer is plain geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from trunnion_sim.surface.deposit import Pieces
from trunnion_sim.surface.places import TAKEN, shared

H, PITCH, LONG = 0.3, 0.3356, 12.0
Array = NDArray[np.float64]


def lines(y: list[float], z: list[float] | None = None, slope: float = 0.0, turn: float = 0.0) -> Pieces:
    """Lines at y (mm along the slope) and z, every one a bead of its own, the tool on the slope's normal."""
    n, size = len(y), np.hypot(1, slope)
    up, normal = np.array([0, 1, slope]) / size, np.array([0, -slope, 1]) / size
    at = np.outer(y, up) + np.outer(z or [H] * n, normal)
    along = np.array([LONG / 2, 0, 0])
    start, end = at - along, at + along
    c, s = np.cos(turn), np.sin(turn)
    about = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    axes = np.tile(normal, (n, 1))
    return Pieces(np.arange(n), start @ about, end @ about, axes @ about, np.ones(n), np.ones(n, dtype=bool))


def shares(pieces: Pieces, cell: float = 0.4 / 6) -> Array:
    rows = int(pieces.row.max()) + 1
    corner = np.array([10.0, 10.0])
    return shared([pieces], np.full(rows, PITCH), np.full(rows, H), -corner, corner, cell)


@pytest.mark.parametrize("slope", [0.0, 0.5])
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.2])
def test_lines_side_by_side_share_nothing_but_what_cells_round(turn: float, slope: float) -> None:
    assert shares(lines([k * PITCH for k in range(20)], slope=slope, turn=turn)).max() < 0.06


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 1.3), st.floats(0.0, 3.1))
def test_the_share_is_what_two_places_have_in_common(apart: float, turn: float) -> None:
    first, second = shares(lines([0.0, apart * PITCH], turn=turn))
    assert first == 0
    assert second == pytest.approx(max(0.0, 1 - apart), abs=0.06)


@pytest.mark.parametrize(("above", "share"), [(H, 0.0), (H / 2, 0.0), (1.1 * TAKEN * H, 0.0), (0.9 * TAKEN * H, 1.0)])
@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_a_bead_on_top_of_another_has_a_place_of_its_own(above: float, share: float, slope: float) -> None:
    aside = above * slope / PITCH  # of a place, seen from above
    assert shares(lines([0.0, 0.0], [H, H + above], slope))[1] == pytest.approx(share * (1 - aside), abs=0.07)


def test_a_bead_shares_with_one_that_stands_above_it() -> None:
    assert shares(lines([0.0, 0.0], [2 * H, H]))[1] == pytest.approx(1, abs=0.07)


def way(points: list[tuple[float, float]]) -> Pieces:
    at = np.array([(x, y, H) for x, y in points])
    n = len(at) - 1
    return Pieces(np.arange(n), at[:-1], at[1:], np.tile([0.0, 0.0, 1.0], (n, 1)), np.ones(n), np.ones(n, dtype=bool))


def test_a_bead_does_not_meet_itself_unless_it_comes_back() -> None:
    turns = way([(-6, 0), (6, 0), (6, PITCH), (-6, PITCH), (-6, 2 * PITCH), (6, 2 * PITCH)])
    assert shares(turns)[[0, 2, 4]].max() < 0.06
    fine = way([(x, 0.0) for x in np.linspace(-6, 6, 2000)])
    assert shares(fine).max() == 0
    back = shares(way([(-6, 0), (6, 0), (-6, 0)]))
    assert back[0] == 0
    assert back[1] == pytest.approx(1, abs=0.07)


def test_stretches_one_after_the_other_are_the_same_as_all_at_once() -> None:
    whole = way([(-6, 0), (6, 0), (6, PITCH), (-6, PITCH), (-6, 1.5 * PITCH), (6, 1.5 * PITCH)])
    corner, rows = np.array([10.0, 10.0]), len(whole.row)
    apart = shared(
        (whole.cut(k, k + 1) for k in range(rows)), np.full(rows, PITCH), np.full(rows, H), -corner, corner, 0.05
    )
    np.testing.assert_array_equal(apart, shares(whole, 0.05))


def test_too_much_plastic_takes_nobodys_place() -> None:
    plate = lines([k * PITCH for k in range(20)])
    much = Pieces(plate.row, plate.start, plate.end, plate.tool_axes, 9 * plate.volume, plate.present)
    np.testing.assert_array_equal(shares(much), shares(plate))
