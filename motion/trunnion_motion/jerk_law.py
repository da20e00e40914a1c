"""Turn a smooth sampled joint path into a short time under every joint's speed, acceleration and jerk.

With x the squared path speed, accelerations at the middles of the intervals are linear in x, and two neighbours may
differ by jerk times the time between them, h / sqrt(x). The bound is convex in x, so its tangent at the last x is a
safe linear bound: each round is one linear programme whose answer keeps the true limits, and no round is worse than
the one before (sequential convex programming of Debrouwere et al. 2013, "Time-optimal path following for robots with
convex-concave constraints", IEEE T-RO). The rounds start from the acceleration-limited law of `topp`.
"""

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array, diags_array, vstack

from trunnion_core.arrays import FloatArray
from trunnion_motion.topp import PathLaw, law_of_derivatives

ROUNDS = 12
ENOUGH = 1e-4
"""Relative gain in time below which another round is not worth it."""
SLOWEST = 1e-9
"""Least squared path speed, as a share of the greatest, about which the jerk bound is made linear."""
_JERK_MARGIN = 0.997
"""Share of the jerk limits that is used: the rest is what the time between two middles is misjudged by."""
_FINER = 10
"""Places in every interval at which limits are looked up."""
_PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where in an interval the linear programme holds the acceleration limits; in between they may bulge over."""


def jerk_law(
    path: FloatArray,
    joints: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
    *,
    tip_max: float = np.inf,
    samples: int = 400,
) -> tuple[FloatArray, PathLaw]:
    """Path coordinates (samples,) and the law at them: from rest to rest, no joint over its limits.

    `path` (n,) strictly growing and `joints` (n, k) as in `toppra_law`, joined by a quintic spline; n at least 6.
    `jerk` (k,) mm/s³ or rad/s³, inf where there is no limit. The path is sampled anew, closer towards its ends, where
    jerk reigns. Costs one linear programme of `samples` unknowns a round: for moves and short paths, not whole prints.
    What accelerations bulge over their limits between the places where the programme holds them is taken out by
    slowing the whole motion down, by less than 0.1 % from 400 samples on. Raises ValueError unless the path grows and
    has six samples.
    """
    if len(path) < 6 or not (np.diff(path) > 0).all():
        raise ValueError(f"path: {len(path)} samples, should be at least 6 and strictly growing")
    spline = make_interp_spline(path, joints, k=5)
    s = path[0] + (path[-1] - path[0]) * 0.5 * (1 - np.cos(np.linspace(0, np.pi, samples)))
    fine = (s[:-1, None] + np.diff(s)[:, None] * np.linspace(0, 1, _FINER)).ravel()
    with np.errstate(divide="ignore"):
        allowed = np.min(speed / np.abs(spline(fine, 1)), axis=1).reshape(-1, _FINER).min(axis=1)
    window = np.minimum(tip_max, np.minimum(np.append(allowed, np.inf), np.append(np.inf, allowed)))
    quick = law_of_derivatives(s, spline(s, 1), spline(s, 2), speed, acceleration, window)
    squared = _rounds(s, spline, quick, acceleration, jerk)
    path_speed = np.sqrt(squared)
    spent = 2 * np.diff(s) / (path_speed[1:] + path_speed[:-1])
    spent[[0, -1]] *= 1.5  # at constant jerk from rest s grows as the cube of time
    slower = _excess(s, spline, squared, speed, acceleration)
    time = np.concatenate([[0.0], np.cumsum(spent)]) * slower
    return s, PathLaw(time, path_speed / slower, quick.limit)


def joint_motion(s: FloatArray, law: PathLaw, path: FloatArray, joints: FloatArray, time: FloatArray) -> FloatArray:
    """(m, k) joints at times (m,) of a law over path coordinates `s`, on the spline through `path`, `joints`."""
    x = law.path_speed**2
    piece = np.clip(np.searchsorted(law.time, time, side="right") - 1, 0, len(s) - 2)
    u = (x[piece + 1] - x[piece]) / (2 * (s[piece + 1] - s[piece]))
    since = time - law.time[piece]
    where = s[piece] + law.path_speed[piece] * since + 0.5 * u * since**2
    first, last = piece == 0, piece == len(s) - 2
    h, spent = np.diff(s), np.diff(law.time)
    where[first] = s[0] + h[0] * (since[first] / spent[0]) ** 3
    where[last] = s[-1] - h[-1] * (1 - since[last] / spent[-1]) ** 3
    spline = make_interp_spline(path, joints, k=5)
    return np.asarray(spline(np.clip(where, path[0], path[-1])))


def _rounds(s: FloatArray, spline: BSpline, quick: PathLaw, acceleration: FloatArray, jerk: FloatArray) -> FloatArray:
    """(n,) squared path speeds: linear programmes, each inside the true limits, until one gains next to nothing."""
    n, h = len(s), np.diff(s)
    scale = quick.path_speed.max() ** 2
    band, bends = _bands(s, spline, acceleration, jerk)
    band = band * scale
    ceiling = np.minimum(quick.limit**2, 4 * scale)
    ceiling[0] = ceiling[-1] = 0.0
    for end, length in ((0, h[0]), (n - 1, h[-1])):
        inner = min(max(end, 1), n - 2)
        ceiling[inner] = min(ceiling[inner], _from_rest(spline(s[end], 1), jerk, length))
    reference = np.maximum(quick.path_speed**2, SLOWEST * scale)
    weight = reference**-1.5
    weight[1:-1] *= 0.5 * (h[1:] + h[:-1])
    weight[[0, -1]] = 0.0
    inside = csr_array((np.ones(n - 2), (np.arange(n - 2), np.arange(1, n - 1))), shape=(n - 2, n))

    best, answer = np.inf, reference
    for _ in range(ROUNDS):
        x = reference[1:-1]
        tangent = diags_array(0.5 * scale / x) @ inside
        left, right = [band, -band], [np.ones(2 * band.shape[0])]
        for bend in bends:
            scaled = diags_array(scale * np.sqrt(x)) @ bend
            left += [tangent + scaled, tangent - scaled]
            right.append(np.full(2 * (n - 2), 1.5))
        found = milp(
            -weight / weight.max(),
            constraints=LinearConstraint(csr_array(vstack(left)), -np.inf, np.concatenate(right)),
            bounds=Bounds(np.zeros(n), ceiling / scale),
        )
        if found.x is None:
            raise ArithmeticError(f"jerk_law: the linear programme failed: {found.message}")
        answer = np.maximum(found.x * scale, 0.0)
        v = np.sqrt(answer)
        total = float(np.sum(2 * h / np.maximum(v[1:] + v[:-1], np.finfo(float).tiny)))
        if best - total < ENOUGH * total:
            break
        best, reference = total, np.maximum(answer, SLOWEST * scale)
    return np.asarray(answer)


def _bands(
    s: FloatArray, spline: BSpline, acceleration: FloatArray, jerk: FloatArray
) -> tuple[csr_array, list[csr_array]]:
    """Matrices on x: accelerations over their limits at the _PLACES of every interval (5 (n - 1) k, n), and for each
    joint with a jerk limit, how its acceleration changes from interval to interval per its limit and mm (n - 2, n).
    """
    n, h = len(s), np.diff(s)
    rows = np.arange(n - 1)
    both = (np.tile(rows, 2), np.concatenate([rows + 1, rows]))
    places = {share: s[:-1] + share * h for share in _PLACES}
    first = {share: spline(place, 1) for share, place in places.items()}
    second = {share: spline(place, 2) for share, place in places.items()}
    spread = 0.5 * (h[1:] + h[:-1]) * _end_share(s)
    bands, bends = [], []
    for j in range(len(acceleration)):
        at = {}
        for share in places:
            ahead = 0.5 * first[share][:, j] / h + share * second[share][:, j]
            behind = -0.5 * first[share][:, j] / h + (1 - share) * second[share][:, j]
            at[share] = csr_array((np.concatenate([ahead, behind]), both), shape=(n - 1, n))
            bands.append(at[share] / acceleration[j])
        if np.isfinite(jerk[j]):
            bends.append(diags_array(1.0 / (_JERK_MARGIN * jerk[j] * spread)) @ (at[0.5][1:] - at[0.5][:-1]))
    return csr_array(vstack(bands)), bends


def _end_share(s: FloatArray) -> FloatArray:
    """(n - 2,) how much shorter than h / sqrt(x) the time between two intervals' middles is in a start from rest.

    There x grows as s^(4/3), within one interval by a factor, and the speed at the node misjudges the time.
    """
    share = np.ones(len(s) - 2)
    for way in (s - s[0], (s[-1] - s)[::-1]):
        x = way ** (4 / 3)
        time = way ** (1 / 3) * 3
        exact = 0.5 * (time[2:] - time[:-2])
        guess = 0.5 * (way[2:] - way[:-2]) / np.sqrt(x[1:-1])
        share = np.minimum(share, exact / guess)[::-1]
    return share


def _excess(s: FloatArray, spline: BSpline, squared: FloatArray, speed: FloatArray, acceleration: FloatArray) -> float:
    """The factor on time, 1 or more, that takes joints back to their limits everywhere between the samples."""
    share, h = np.linspace(0, 1, _FINER + 1), np.diff(s)
    where = s[:-1, None] + share * h[:, None]
    x = squared[:-1, None] + share * np.diff(squared)[:, None]
    u = (np.diff(squared) / (2 * h))[:, None, None]
    first, second = spline(where, 1), spline(where, 2)
    fast = (np.abs(first) / speed).max(axis=2) * np.sqrt(x)
    hard = (np.abs(first * u + second * x[..., None]) / acceleration).max()
    return float(max(1.0, fast.max(), np.sqrt(hard)))


def _from_rest(first: FloatArray, jerk: FloatArray, length: float) -> float:
    """Squared path speed after `length` of constant jerk from rest."""
    with np.errstate(divide="ignore"):
        path_jerk = float(np.min(np.where(first != 0, jerk / np.abs(first), np.inf)))
    if not np.isfinite(path_jerk):
        return np.inf
    return float(path_jerk**2 / 4 * (6 * length / path_jerk) ** (4 / 3))
