"""Words that creep become words that wait, and then go on at once: one pass over the rows."""

import numba

from trunnion_core.arrays import FloatArray, IntArray


@numba.njit(cache=True)
def waiting(words: IntArray, start: IntArray, least: FloatArray, unit: FloatArray) -> IntArray:
    """(n, k) ticks of `words`, each row as the one before unless it lies at least `least` (n,) units away from that.

    start (k,) ticks before the first row; unit (k,) the size of a tick.
    """
    out = words.copy()
    last = start.copy()
    for i in range(len(out)):
        square = (((out[i] - last) * unit) ** 2).sum()
        if square < least[i] ** 2:
            out[i] = last
        else:
            last = out[i].copy()
    return out
