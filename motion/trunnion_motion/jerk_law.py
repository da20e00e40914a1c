"""Turn a smooth sampled joint path into a short time under every joint's speed, acceleration and jerk.

With x the squared path speed, accelerations at the middles of the intervals are linear in x, and two neighbours may
differ by jerk times the time between them, h / sqrt(x). The bound is convex in x, so its tangent at the last x is a
safe linear bound: each round is one linear programme whose answer keeps the true limits, and no round is worse than
the one before (sequential convex programming of Debrouwere et al. 2013, "Time-optimal path following for robots with
convex-concave constraints", IEEE T-RO). The rounds start from the acceleration-limited law of `topp`.
"""

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import linprog
from scipy.sparse import csr_array, diags_array, vstack
from trunnion_core.arrays import FloatArray

from trunnion_motion.topp import PathLaw, law_of_derivatives

ROUNDS = 12
ENOUGH = 1e-4
"""Relative gain in time below which another round is not worth it."""


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
    Raises ValueError unless the path grows and has six samples.
    """
    if len(path) < 6 or not (np.diff(path) > 0).all():
        raise ValueError(f"path: {len(path)} samples, should be at least 6 and strictly growing")
    spline = make_interp_spline(path, joints, k=5)
    s = path[0] + (path[-1] - path[0]) * 0.5 * (1 - np.cos(np.linspace(0, np.pi, samples)))
    window = np.full(samples, tip_max)
    quick = law_of_derivatives(s, spline(s, 1), spline(s, 2), speed, acceleration, window)
    squared = _rounds(s, spline, quick, acceleration, jerk)
    path_speed = np.sqrt(squared)
    time = np.concatenate([[0.0], np.cumsum(2 * np.diff(s) / (path_speed[1:] + path_speed[:-1]))])
    return s, PathLaw(time, path_speed, quick.limit)


def joint_motion(s: FloatArray, law: PathLaw, path: FloatArray, joints: FloatArray, time: FloatArray) -> FloatArray:
    """(m, k) joints at times (m,) of a law over path coordinates `s`, on the spline through `path`, `joints`."""
    x = law.path_speed**2
    piece = np.clip(np.searchsorted(law.time, time, side="right") - 1, 0, len(s) - 2)
    u = (x[piece + 1] - x[piece]) / (2 * (s[piece + 1] - s[piece]))
    since = time - law.time[piece]
    where = s[piece] + law.path_speed[piece] * since + 0.5 * u * since**2
    order = 5 if len(path) >= 6 else 3
    spline = make_interp_spline(path, joints, k=order)
    return np.asarray(spline(np.clip(where, path[0], path[-1])))


def _rounds(
    s: FloatArray, spline: CubicSpline, quick: PathLaw, acceleration: FloatArray, jerk: FloatArray
) -> FloatArray:
    h = np.diff(s)
    n = len(s)
    middle = 0.5 * (s[1:] + s[:-1])
    first, second = spline(middle, 1), spline(middle, 2)
    rows = np.arange(n - 1)
    bands, bend_rows, bend_rates, bend_joint = [], [], [], []
    for j in range(first.shape[1]):
        ahead, behind = 0.5 * first[:, j] / h + 0.5 * second[:, j], -0.5 * first[:, j] / h + 0.5 * second[:, j]
        at_middle = csr_array(
            (np.concatenate([ahead, behind]), (np.tile(rows, 2), np.concatenate([rows + 1, rows]))), shape=(n - 1, n)
        )
        bands.append(at_middle / acceleration[j])
        if np.isfinite(jerk[j]):
            bend_rows.append(at_middle[1:] - at_middle[:-1])
            bend_rates.append(jerk[j] * 0.5 * (h[1:] + h[:-1]))
            bend_joint.append(j)
    band = vstack(bands)

    ceiling = np.minimum(quick.limit**2, 4 * quick.path_speed.max() ** 2)
    ceiling[0] = ceiling[-1] = 0.0
    for end, length in ((1, h[0]), (-2, h[-1])):
        ceiling[end] = min(ceiling[end], _from_rest(spline(s[0 if end > 0 else -1], 1), jerk, length))
    reference = np.maximum(quick.path_speed**2, 1e-9 * quick.path_speed.max() ** 2)
    weight = reference**-1.5
    weight[1:-1] *= 0.5 * (h[1:] + h[:-1])
    weight[[0, -1]] = 0.0
    scale = quick.path_speed.max() ** 2
    best = np.inf
    answer = reference
    for _ in range(ROUNDS):
        left, right = [band * scale, -band * scale], [np.ones(2 * band.shape[0])]
        inner = reference[1:-1]
        for rate, row in zip(bend_rates, bend_rows, strict=True):
            bound = rate * inner**-0.5
            tangent = diags_array(0.5 * scale / inner) @ csr_array(
                (np.ones(n - 2), (np.arange(n - 2), np.arange(1, n - 1))), shape=(n - 2, n)
            )
            scaled = diags_array(scale / bound) @ row
            left += [scaled + tangent, tangent - scaled]
            right.append(np.full(2 * (n - 2), 1.5))
        found = linprog(
            -weight / weight.max(),
            A_ub=vstack(left, format="csr"),
            b_ub=np.concatenate(right),
            bounds=np.column_stack([np.zeros(n), ceiling / scale]),
            method="highs",
        )
        if found.x is None:
            break
        answer = np.maximum(found.x * scale, 0.0)
        v = np.sqrt(answer)
        total = float(np.sum(2 * h / np.maximum(v[1:] + v[:-1], 1e-300)))
        if best - total < ENOUGH * total:
            break
        best = total
        reference = np.maximum(answer, 1e-9 * scale)
    return answer


def _from_rest(first: FloatArray, jerk: FloatArray, length: float) -> float:
    """Squared path speed after `length` of constant jerk from rest."""
    with np.errstate(divide="ignore"):
        path_jerk = float(np.min(np.where(first != 0, jerk / np.abs(first), np.inf)))
    if not np.isfinite(path_jerk):
        return np.inf
    return path_jerk**2 / 4 * (6 * length / path_jerk) ** (4 / 3)
