"""Pressure that moves keep up: against the differential equation, and against trying other feeds."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_motion.lead import kept_lead
from trunnion_motion.timelaw import TimeLaw

K = 0.05
FINE = 2000


def law(rows):
    """Rows of entry, peak, leave in mm/s, and mm/s² of ramps and mm of length."""
    entry, peak, leave, ramp, length = np.array(rows, dtype=float).T
    up, down = (peak - entry) / ramp, (peak - leave) / ramp
    flat = (length - (peak**2 - entry**2 + peak**2 - leave**2) / (2 * ramp)) / peak
    assert (flat > -1e-12).all()
    whole = np.zeros(len(entry), dtype=np.int64)
    return TimeLaw(up + flat + down, length, entry, peak, leave, ramp, peak, whole)


def flows(fed, of, start, helped):
    """(n, FINE) mm/s out of the nozzle and wanted for 0.05 mm to a mm, by small steps from `start` mm of pressure."""
    x, out, wanted = start, [], []
    for i in range(len(fed)):
        step = of.duration[i] / FINE
        t = (np.arange(FINE) + 0.5) * step
        a, v0, v, v1 = of.acceleration[i], of.entry[i], of.peak[i], of.leave[i]
        rising, falling = v0 + a * t, v1 + a * (of.duration[i] - t)
        speed = np.minimum(np.minimum(rising, falling), v)
        change = np.where(rising < np.minimum(falling, v), a, np.where(falling < v, -a, 0.0))
        push = fed[i] / of.length[i] * (speed + (K * change if helped[i] else 0.0))
        row = np.empty(FINE)
        for j in range(FINE):
            x += step * (push[j] - x / K)
            row[j] = x / K
        out.append(row)
        wanted.append(0.05 * speed)
    return np.array(out), np.array(wanted)


def solve(of, helped=False, limits=None):
    """Feeds, pressure before the first row, and what the firmware adds."""
    n = len(of.duration)
    nominal = 0.05 * of.length
    low, high = (-np.inf, np.inf) if limits is None else limits
    every, helped = np.ones(n, dtype=bool), np.full(n, helped)
    before, after, own = kept_lead(nominal, of, every, (every, every), (np.full(n, low), np.full(n, high)), K, helped)
    return nominal + after - before - own, before[0], own


STEADY = law([[30, 30, 30, 1000, 5]] * 3)
RAMPS = law([[10, 15, 15, 1000, 0.0625], [15, 20, 20, 1000, 0.0875], [20, 20, 20, 1000, 2], [20, 20, 10, 1000, 0.15]])
BUMPS = law([[5, 40, 5, 2000, 1.0]] * 6)


@pytest.mark.parametrize("helped", [False, True])
def test_at_a_steady_speed_nothing_is_asked_of_the_words(helped):
    fed, start, own = solve(STEADY, helped)
    assert_allclose(fed, 0.05 * STEADY.length, rtol=1e-4)
    assert start == pytest.approx(K * 0.05 * 30, rel=1e-4)
    assert_allclose(own, 0.0)


def test_pieces_of_ramps_keep_the_flow_within_a_twentieth():
    fed, start, _ = solve(RAMPS)
    out, wanted = flows(fed, RAMPS, start, np.zeros(4, dtype=bool))
    assert (np.abs(out[:3] / wanted[:3] - 1) < 0.1).all()
    assert_allclose(out[:3].mean(axis=1), wanted[:3].mean(axis=1), rtol=0.03)


def test_firmware_that_follows_ramps_leaves_nothing_to_do_where_beads_are_alike():
    fed, start, own = solve(RAMPS, True)
    assert_allclose(fed, 0.05 * RAMPS.length, rtol=1e-3)
    out, wanted = flows(fed, RAMPS, start, np.ones(4, dtype=bool))
    assert_allclose(out, wanted, rtol=0.01)
    assert own.sum() == pytest.approx(0.0, abs=1e-6)


def test_moves_that_speed_up_and_brake_keep_their_volume():
    """Pressure after their slow ends alone would starve them."""
    fed, start, _ = solve(BUMPS)
    out, wanted = flows(fed, BUMPS, start, np.zeros(6, dtype=bool))
    assert_allclose(out.mean(axis=1), wanted.mean(axis=1), rtol=0.01)
    slow = K * 0.05 * 5
    starved = flows(0.05 * BUMPS.length, BUMPS, slow, np.zeros(6, dtype=bool))[0]
    assert starved[0].mean() < 0.9 * wanted[0].mean()


def test_no_other_feed_of_a_row_is_better():
    fed, start, _ = solve(RAMPS)

    def off(feeds):
        out, wanted = flows(feeds, RAMPS, start, np.zeros(4, dtype=bool))
        mean = wanted.mean(axis=1)
        weight = RAMPS.duration / mean
        return float(((np.abs(out - wanted).mean(axis=1) + np.abs((out - wanted).mean(axis=1))) * weight).sum())

    least = off(fed)
    for row in range(4):
        for change in (-0.1, 0.1):
            assert off(fed + change * fed * (np.arange(4) == row)) > 0.98 * least


def test_limits_hold():
    low, high = 0.0031, 0.06
    fed, _, _ = solve(RAMPS, limits=(low, high))
    assert fed.min() >= low - 1e-12
    assert fed.max() <= high + 1e-12
