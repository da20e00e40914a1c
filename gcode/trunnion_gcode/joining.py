"""Moves that a firmware would join become one before they are written: the F of the last would hold for all of it.

Marlin (2.1, `Planner::_populate_block`) drops a move of fewer than MIN_STEPS_PER_SEGMENT motor steps on every axis
without moving its planned position, so the next move makes both, at its own F. Here they share one F that is meant for
both. At the end of a bead or a travel there is no next move of its kind: what is left over goes to the one before. The
end of the program is kept in any case, so that its words hold all of the filament.
"""

import numba
import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.profile import MachineProfile

DOUBT = 1
"""Steps by which a firmware's single precision may count otherwise than this."""


def step_places(place: FloatArray, filament: FloatArray, profile: MachineProfile) -> FloatArray:
    """(m, k + 1) whole motor steps at which joints `place` (m, k; mm or degrees) and `filament` (m,) mm stand."""
    return np.asarray(np.rint(np.column_stack([place, filament]) * profile.steps_per_shown))


def ends_kept(places: FloatArray, run: IntArray, least: int) -> BoolArray:
    """(m,) which moves keep their end, so that every one but the last has `least` steps and DOUBT more on some motor.

    places (m + 1, c) steps at the start and after each move; run (m,) rises where the move before is of another kind.
    """
    return np.asarray(_kept(places, run, float(least + DOUBT)))


@numba.njit(cache=True)
def _kept(places: FloatArray, run: IntArray, least: float) -> BoolArray:
    m = len(run)
    kept = np.ones(m, np.bool_)
    before, made = 0, 0  # places where the last kept move begins and ends
    for i in range(m):
        if np.abs(places[i + 1] - places[made]).max() >= least:
            before, made = made, i + 1
            continue
        ends = i == m - 1 or run[i + 1] != run[i]
        follows = made > 0 and run[made - 1] == run[i]
        if ends and follows and np.abs(places[i + 1] - places[before]).max() >= least:
            kept[made - 1] = False
            made = i + 1
        elif i < m - 1:
            kept[i] = False
    return kept
