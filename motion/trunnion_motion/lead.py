"""Turn the time law of beads into the pressure that their moves can keep up, for plastic that lags behind its drive.

Filament that is in but not yet out, x, is under pressure, and flow follows it: K dx/dt = K p - x, where a move pushes p
in step with its speed. What can be chosen is how much each move pushes, or, which is the same, the pressure at its end.
Where moves are cut at their ramps, K times the wanted flow is right there. Where one move speeds up and brakes, it is
not: pressure that follows the slow ends alone would starve what lies between. So feeds are chosen such that the sum of
what flow is off, in each row as a whole and at places along it, is least over all of the time (squares, reweighted by
what they came to, so that little goes far wrong rather than all a bit), while no move feeds more or less than it may: a
banded system, solved by the alternating direction method of multipliers (Boyd and others, Foundations and Trends in
Machine Learning 3, 2010, section 5).
"""

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_motion.timelaw import TimeLaw

PLACES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Of a row's time, where flow is compared."""
WEIGHTS = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0
"""Simpson's."""
SMALL = 0.06
"""Of a row's mean flow: less than this is off by nothing worth a blob elsewhere."""
MEAN = 4.0
"""Weight of the mean flow of a row beside that at its places: a bead keeps its volume first."""
REWEIGHTED, ROUNDS = 8, 25
"""Weights, and rounds of the method of multipliers under each: more changes no word."""
STIFF = 0.1
"""Weight of a limit beside the flow of its row: how far a round goes."""
BOUND = 1e5
"""Weight of what has to be so: how pressure follows from what is fed, and where there is none."""


def kept_lead(
    nominal: FloatArray,
    law: TimeLaw,
    beads: BoolArray,
    free: tuple[BoolArray, BoolArray],
    limits: tuple[FloatArray, FloatArray],
    seconds: float,
    helped: BoolArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n,) mm by which the drive has to be ahead of `nominal` before, and after, every row of beads; 0 elsewhere.

    `nominal` (n,) mm of filament that the beads need, all rows with a duration. `free` marks the rows before and after
    which there may be pressure although no bead lies there, since a prime makes it or a retraction takes it away.
    `limits` are the least and the most mm of filament that each row may feed. In rows that are `helped` (n,) the
    firmware itself adds `seconds` times the acceleration of the filament: the third answer is (n,) mm of it.
    """
    n = len(nominal)
    lasts = np.where(beads, law.duration, 1.0)
    length = np.where(beads & (law.length > 0), law.length, 1.0)
    amount = np.where(beads, nominal, 1.0)
    places = lasts[:, None] * PLACES
    speed, into = _pushed(places, lasts, length, law, seconds, helped)
    # In units of the row's mean flow and its own need: flow is decay x + into fed, x the pressure at the row's start.
    mean = amount / lasts
    decay = np.exp(-places / seconds)
    by_pressure, by_feed = decay / (seconds * mean[:, None]), into * lasts[:, None] / seconds
    wanted = speed * (lasts / length)[:, None]
    # And, last, of the row as a whole: what is there and is pushed, less what stays.
    added = np.where(helped, seconds * (law.leave - law.entry) / length, 0.0)
    by_pressure = np.column_stack([by_pressure, (1.0 - decay[:, -1]) / amount])
    by_feed = np.column_stack([by_feed, 1.0 + added - into[:, -1]])
    wanted = np.column_stack([wanted, np.ones(n)])
    weight = np.where(beads[:, None], np.append(WEIGHTS, MEAN) * lasts[:, None], 0.0)
    none = np.ones(n + 1, dtype=np.bool_)
    none[:-1] &= ~(beads & free[0])
    none[1:] &= ~(beads & free[1])
    none[1:-1] &= ~(beads[:-1] & beads[1:])
    # Pressure at the end, less what it follows from, over the pressure at the row's mean flow: nothing.
    scale = 1.0 / (seconds * mean)
    follows = np.column_stack([-decay[:, -1] * scale, -into[:, -1] * lasts / seconds, scale])
    bound = np.where(beads, BOUND * lasts, 0.0)
    low, high = limits[0] / amount, limits[1] / amount
    allowed, each = np.clip(np.ones(n), low, high), weight
    pressure, fed = np.zeros(n + 1), np.ones(n)
    for _ in range(REWEIGHTED):
        stiff = STIFF * each.sum(axis=1) + np.where(beads, 0.0, 1.0)
        system = np.zeros((3, 2 * n + 1))
        system[2, 0::2] = np.where(none, 1.0, 0.0) * BOUND
        system[2, 0:-1:2] += (each * by_pressure**2).sum(axis=1) + bound * follows[:, 0] ** 2
        system[2, 2::2] += bound * follows[:, 2] ** 2
        system[2, 1::2] = (each * by_feed**2).sum(axis=1) + bound * follows[:, 1] ** 2 + stiff
        system[1, 1::2] = (each * by_pressure * by_feed).sum(axis=1) + bound * follows[:, 0] * follows[:, 1]
        system[1, 2::2] = bound * follows[:, 1] * follows[:, 2]
        system[0, 2::2] = bound * follows[:, 0] * follows[:, 2]
        factor = cholesky_banded(system)
        right, price = np.zeros(2 * n + 1), np.zeros(n)
        right[0:-1:2] = (each * by_pressure * wanted).sum(axis=1)
        feeding = (each * by_feed * wanted).sum(axis=1)
        for _ in range(ROUNDS):
            right[1::2] = feeding + stiff * (allowed - price)
            answer = cho_solve_banded((factor, False), right)
            pressure, fed = answer[0::2], answer[1::2]
            allowed = np.clip(fed + price, low, high)
            price += fed - allowed
        flow = by_pressure * pressure[:-1, None] + by_feed * fed[:, None]
        each = weight / np.maximum(np.abs(flow - wanted), SMALL)
    own = np.where(beads, added * allowed * amount, 0.0)
    gained = np.where(beads, allowed * amount - nominal + own, 0.0)
    room = amount * np.minimum(np.minimum(allowed - low, high - allowed), 1.0)
    before, after = _along(pressure, gained, np.where(beads, room, 0.0), beads)
    return before, after, own


def _along(
    pressure: FloatArray, gained: FloatArray, room: FloatArray, beads: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Lead before and after every row, from pressures at the rows' ends and what the rows push beyond their need.

    What a run of beads would lay too much or too little in all is spread over it, where there is `room` for more or
    less, so that its lead ends at the pressure.
    """
    starts = np.diff(beads.astype(np.int64), prepend=0) > 0
    run = np.cumsum(starts)
    of_run = [np.bincount(run, weights=np.where(beads, values, 0.0)) for values in (gained, np.diff(pressure), room)]
    missing = np.divide(of_run[1] - of_run[0], of_run[2], out=np.zeros(len(of_run[0])), where=of_run[2] > 0)
    gained = gained + missing[run] * room
    first = np.maximum.accumulate(np.where(starts, np.arange(len(beads)), 0))
    total = np.cumsum(gained)
    base = pressure[:-1][first] - (total - gained)[first]
    return np.where(beads, base + total - gained, 0.0), np.where(beads, base + total, 0.0)


def _pushed(
    places: FloatArray, lasts: FloatArray, length: FloatArray, law: TimeLaw, seconds: float, helped: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """(n, p) speed at `places` (n, p) s of each row, and pressure there when the row pushes 1 mm in all, from none."""
    ramp = np.where(law.acceleration > 0, law.acceleration, 1.0)
    up = np.minimum((law.peak - law.entry) / ramp, lasts)
    down = np.minimum((law.peak - law.leave) / ramp, lasts - up)
    speed = np.broadcast_to(law.entry[:, None], places.shape)
    x = np.zeros(places.shape)
    before = np.zeros(len(lasts))
    for change, takes in ((ramp, up), (np.zeros(len(ramp)), lasts - up - down), (-ramp, down)):
        time = np.clip(places - before[:, None], 0.0, takes[:, None])
        gone = -np.expm1(-time / seconds)
        push = speed + (np.where(helped, seconds, 0.0) * change)[:, None]
        x = x * (1.0 - gone) + seconds * ((push - seconds * change[:, None]) * gone + change[:, None] * time)
        speed = speed + change[:, None] * time
        before = before + takes
    return speed, x / length[:, None]
