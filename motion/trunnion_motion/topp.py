"""Turn a smooth sampled joint path into the least time under every joint's speed and acceleration.

With x the squared path speed and u the path acceleration, a joint's acceleration is q' u + q'' x and everything is
linear. One pass backwards finds, at each sample, the fastest x from which the path can still be finished; one pass
forwards takes the largest u that stays below (reachability analysis, Pham & Pham 2018, "A new approach to time-optimal
path parameterization based on reachability analysis", IEEE T-RO). The accelerations are held at both ends of every
interval. Each step is a linear programme in two unknowns, solved directly by a finite Newton iteration.
"""

from dataclasses import dataclass

import numba
import numpy as np

from trunnion_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PathLaw:
    """A time law along a sampled path, at rest at both ends; between samples the path acceleration is constant."""

    time: FloatArray
    """(n,) s at the samples."""
    path_speed: FloatArray
    """(n,) path units per s at the samples."""
    limit: FloatArray
    """(n,) the largest path speed at each sample that joint speeds, joint accelerations and window allow there, however
    slow it is elsewhere: where this is below what the flow needs, the axes starve the hot end."""

    @property
    def total(self) -> float:
        """s in all."""
        return float(self.time[-1]) if len(self.time) else 0.0


def toppra_law(
    path: FloatArray,
    joints: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    *,
    tip_max: FloatArray | float = np.inf,
) -> PathLaw:
    """The least time along a smooth path through samples, from rest to rest.

    `path` (n,) strictly growing: the path coordinate of the samples, normally mm of tip travel over the part.
    `joints` (n, k) mm or rad there; between samples they follow the cubic not-a-knot spline through them. `speed` and
    `acceleration` (k,). `tip_max` (n,) or one number: largest path speed, such as wanted tip speed and the hot end's
    greatest flow give. No law can promise a least speed; where the axes hold the flow below its minimum
    `flow_window` says so. Raises ValueError unless the path grows and has at least four samples.
    """
    n = len(path)
    if n < 4 or not (np.diff(path) > 0).all():
        raise ValueError(f"path: {n} samples, should be at least 4 and strictly growing")
    first, second = spline_derivatives(path, joints)
    window = np.broadcast_to(np.asarray(tip_max, dtype=np.float64), (n,))
    return law_of_derivatives(path, first, second, speed, acceleration, window)


def law_of_derivatives(
    path: FloatArray,
    first: FloatArray,
    second: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    tip_max: FloatArray,
) -> PathLaw:
    """`toppra_law` where the joints' derivatives by the path, `first` and `second` (n, k), are known already."""
    time, path_speed, limit = _passes(
        np.ascontiguousarray(path),
        np.ascontiguousarray(first),
        np.ascontiguousarray(second),
        np.ascontiguousarray(speed),
        np.ascontiguousarray(acceleration),
        np.ascontiguousarray(tip_max),
    )
    return PathLaw(time, path_speed, limit)


def spline_derivatives(path: FloatArray, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second derivatives (n, k) at the samples of the cubic spline through them, n at least 4.

    The same spline as scipy's CubicSpline with not-a-knot ends, several times faster.
    """
    first, second = np.empty(joints.shape), np.empty(joints.shape)
    _spline(np.ascontiguousarray(path), np.ascontiguousarray(joints), first, second)
    return first, second


@numba.njit(cache=True, error_model="numpy")
def _spline(path: FloatArray, joints: FloatArray, first: FloatArray, second: FloatArray) -> None:
    """Second derivatives by one tridiagonal elimination for all joints (Press et al., Numerical Recipes, 3.3)."""
    n, k = joints.shape
    upper = np.empty(n)
    for i in range(1, n - 1):
        a, b = path[i] - path[i - 1], path[i + 1] - path[i]
        lower, diagonal, above = a, 2.0 * (a + b), b
        if i == 1:
            diagonal += a + a * a / b
            above -= a * a / b
            lower = 0.0
        if i == n - 2:
            diagonal += b + b * b / a
            lower -= b * b / a
            above = 0.0
        pivot = diagonal - (lower * upper[i - 1] if i > 1 else 0.0)
        upper[i] = above / pivot
        for j in range(k):
            bend = 6.0 * ((joints[i + 1, j] - joints[i, j]) / b - (joints[i, j] - joints[i - 1, j]) / a)
            second[i, j] = (bend - (lower * second[i - 1, j] if i > 1 else 0.0)) / pivot
    for i in range(n - 3, 0, -1):
        for j in range(k):
            second[i, j] -= upper[i] * second[i + 1, j]
    start = (path[1] - path[0]) / (path[2] - path[1])
    end = (path[n - 1] - path[n - 2]) / (path[n - 2] - path[n - 3])
    for j in range(k):
        second[0, j] = second[1, j] - start * (second[2, j] - second[1, j])
        second[n - 1, j] = second[n - 2, j] + end * (second[n - 2, j] - second[n - 3, j])
    for i in range(n - 1):
        h = path[i + 1] - path[i]
        for j in range(k):
            first[i, j] = (joints[i + 1, j] - joints[i, j]) / h - h * (2.0 * second[i, j] + second[i + 1, j]) / 6.0
    h = path[n - 1] - path[n - 2]
    for j in range(k):
        chord = (joints[n - 1, j] - joints[n - 2, j]) / h
        first[n - 1, j] = chord + h * (second[n - 2, j] + 2.0 * second[n - 1, j]) / 6.0


@numba.njit(cache=True, error_model="numpy")
def _passes(
    path: FloatArray,
    first: FloatArray,
    second: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    tip_max: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    n, k = first.shape
    ceiling = np.empty(n)
    for i in range(n):
        top = tip_max[i] * tip_max[i]
        for j in range(k):
            rate = abs(first[i, j])
            if rate > 0.0:
                v = speed[j] / rate
                top = min(top, v * v)
        ceiling[i] = top
    # Between samples x is straight: where that would pass over a joint's limit in the middle, the higher end gives way,
    # and both where the joint is fastest inside the interval.
    for i in range(n - 1):
        step = path[i + 1] - path[i]
        for j in range(k):
            a, b = second[i, j], second[i + 1, j]
            inside = a * b < 0.0
            rate = abs(first[i, j] + step * (0.5 * a * a / (a - b) if inside else (3.0 * a + b) / 8.0))
            if rate <= 0.0:
                continue
            top = (speed[j] / rate) ** 2
            low = min(ceiling[i], ceiling[i + 1])
            high = top if inside or low > top else 2.0 * top - low
            ceiling[i] = min(ceiling[i], high)
            ceiling[i + 1] = min(ceiling[i + 1], high)

    # Every constraint is a band  -limit <= g u + h x <= limit  with x at the start of the interval.
    g = np.empty(2 * k)
    h = np.empty(2 * k)
    reach = np.empty(n)
    reach[n - 1] = 0.0
    for i in range(n - 2, -1, -1):
        step = path[i + 1] - path[i]
        _bands(first, second, i, step, g, h)
        reach[i] = _largest_start(g, h, acceleration, step, ceiling[i], reach[i + 1])
        ceiling[i] = _largest_start(g, h, acceleration, step, ceiling[i], np.inf)

    x = np.empty(n)
    x[0] = 0.0
    time = np.zeros(n)
    for i in range(n - 1):
        step = path[i + 1] - path[i]
        _bands(first, second, i, step, g, h)
        u = (reach[i + 1] - x[i]) / (2.0 * step)
        for c in range(2 * k):
            bound = acceleration[c % k]
            if g[c] > 0.0:
                u = min(u, (bound - h[c] * x[i]) / g[c])
            elif g[c] < 0.0:
                u = min(u, (-bound - h[c] * x[i]) / g[c])
        x[i + 1] = min(max(x[i] + 2.0 * step * u, 0.0), reach[i + 1])
        total = np.sqrt(x[i]) + np.sqrt(x[i + 1])
        time[i + 1] = time[i] + (2.0 * step / total if total > 0.0 else np.inf)
    return time, np.sqrt(x), np.sqrt(ceiling)


@numba.njit(cache=True, error_model="numpy", inline="always")
def _bands(first: FloatArray, second: FloatArray, i: int, step: float, g: FloatArray, h: FloatArray) -> None:
    """Accelerations at the start and, with x + 2 step u put in, at the end of interval i."""
    k = first.shape[1]
    for j in range(k):
        g[j] = first[i, j]
        h[j] = second[i, j]
        g[k + j] = first[i + 1, j] + 2.0 * step * second[i + 1, j]
        h[k + j] = second[i + 1, j]


@numba.njit(cache=True, error_model="numpy")
def _largest_start(
    g: FloatArray, h: FloatArray, acceleration: FloatArray, step: float, ceiling: float, target: float
) -> float:
    """Largest x in [0, ceiling] for which some u keeps every band and brings x + 2 step u into [0, target].

    The room between the lowest upper and the highest lower bound of u is concave in x: Newton from the right ends
    at its last zero after finitely many lines. x = 0, u = 0 is always allowed.
    """
    k = len(acceleration)
    x = ceiling
    for c in range(2 * k):
        if g[c] == 0.0 and h[c] != 0.0:
            x = min(x, acceleration[c % k] / abs(h[c]))
    if x == np.inf:
        x = 1e18
    for _ in range(64):
        low = -x / (2.0 * step)
        low_slope = -1.0 / (2.0 * step)
        high = (target - x) / (2.0 * step)
        high_slope = low_slope
        for c in range(2 * k):
            if g[c] == 0.0:
                continue
            bound = acceleration[c % k] / abs(g[c])
            slope = -h[c] / g[c]
            middle = slope * x
            if middle + bound < high:
                high = middle + bound
                high_slope = slope
            if middle - bound > low:
                low = middle - bound
                low_slope = slope
        room = high - low
        if room >= -1e-12 * (abs(high) + abs(low)):
            return x
        slope = high_slope - low_slope
        if slope >= 0.0:
            return 0.0
        x = max(x - room / slope, 0.0)
    return x
