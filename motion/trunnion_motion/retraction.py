"""Turn runs of travel into retract, travel, prime. Filament only moves while the joints stand still.

A run of travel rows is preceded by a retraction and followed by a prime of the same length. The program's first run
has neither, since the nozzle has printed nothing yet; the last one stays retracted. Links are left alone.
"""

import numpy as np

from trunnion_core.roles import Role
from trunnion_motion.rows import Rows, inserted, standing


def with_retractions(rows: Rows, length: float) -> Rows:
    """The rows with RETRACT and PRIME rows of `length` mm of filament around every run of travel; 0 adds none."""
    if length <= 0 or not len(rows):
        return rows
    travel = rows.role == Role.TRAVEL
    starts = np.flatnonzero(travel & ~np.concatenate([[False], travel[:-1]]))
    ends = np.flatnonzero(travel & ~np.concatenate([travel[1:], [False]])) + 1
    if starts.size and starts[0] == 0:
        starts, ends = starts[1:], ends[1:]
    ends = ends[ends < len(rows)]
    retract = standing(rows, starts - 1, Role.RETRACT, -length)
    prime = standing(rows, ends - 1, Role.PRIME, length)
    with_prime = inserted(rows, ends, prime)
    return inserted(with_prime, starts + np.searchsorted(ends, starts, side="right"), retract)
