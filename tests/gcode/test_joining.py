"""Moves that Marlin would join: every kept move has enough steps, and what is kept is what a plain reading says."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_gcode.joining import DOUBT, ends_kept

LEAST = 6
STEPS = st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9), st.booleans()), min_size=1, max_size=60)


def kept_of(moves: list[tuple[int, int, bool]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    steps = np.array([move[:2] for move in moves], dtype=np.float64)
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    run = np.cumsum([move[2] for move in moves])
    return ends_kept(places, run, LEAST), places, run


@settings(deadline=None)
@given(STEPS)
def test_no_move_but_the_last_is_too_short_for_marlin(moves: list[tuple[int, int, bool]]) -> None:
    kept, places, _ = kept_of(moves)
    ends = np.append(0, np.flatnonzero(kept) + 1)
    longest = np.abs(np.diff(places[ends], axis=0)).max(axis=1)
    assert kept[-1]
    assert (longest[:-1] >= LEAST + DOUBT).all()


def test_the_end_of_a_bead_goes_to_its_own_bead() -> None:
    kept, _, _ = kept_of([(100, 0, False), (50, 0, True), (0, 3, False), (80, 0, True), (0, 80, False)])
    assert kept.tolist() == [True, False, True, True, True]


def test_a_bead_of_few_steps_goes_to_what_follows() -> None:
    kept, _, _ = kept_of([(100, 0, False), (3, 0, True), (80, 0, True)])
    assert kept.tolist() == [True, False, True]


def test_long_moves_stay() -> None:
    kept, _, _ = kept_of([(7, 0, False), (0, -7, True), (-9, 2, False)])
    assert kept.all()
