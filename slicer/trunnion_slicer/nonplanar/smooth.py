"""Faceted tool axes become even ones: the least bending of tilt and heading that cones about the normals allow.

A machine with a platter, or with a head that turns, moves one rotary by the tool's tilt from the vertical and the
other by its heading, and near the vertical a small turn of the tool is a large one of the heading. So it is these two
angles along the path whose integral of squared second derivatives is least. The tilt has a sign: a tool that comes
near the vertical may go straight over it and lean the other way with the heading as it was, where the cones allow it,
instead of turning half round. (Least change of the rotaries' rates within admissible orientations: Castagnetti, Duc
and Ray 2008, The domain of admissible orientation concept; Fleisig and Spence 2001 on angular acceleration.)

Paths are not alone. The axes wanted (`field`) agree between neighbouring lines, and a soft spring holds every row to
them; near the vertical it hardly holds the heading. The cones are springs too, towards the normals, which rounds of
banded linear solves stiffen on rows that are outside and slacken inside; a step along great circles makes it exact.
"""

import numpy as np
from scipy.linalg import solveh_banded

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_slicer.nonplanar.bending import banded, bending, spans, unrolled

ROUNDS = 30
"""Rounds of springs made stiffer or slacker; after that many what is left to do moves an axis by hundredths of its
cone."""
REACH = 1.0
"""mm. The wanted axes are so soft a spring that what they ask for is evened out over this way on both sides; the
heading over REACH / sqrt(sine of the tilt)."""
INSIDE = 0.98
"""Share of the cone that is aimed at, so that the last step has next to nothing to do."""
FIRST, SOFTEST, STIFFEST = 0.3, 0.03, 1e5
"""What the springs towards the normals start with, and their bounds, as factors on the soft ones."""
DAMPING = 1e-11
"""Share of the stiffest bending by which every step is held back: the heading of an upright tool has no spring."""


def smoothed(
    points: FloatArray, normals: FloatArray, wanted: FloatArray, starts: IntArray, tolerance: float
) -> FloatArray:
    """Axes (n, 3) unit near the wanted ones whose tilt and heading change evenly along paths.

    points (n, 3) mm; path i is rows starts[i] : starts[i + 1]; one that ends where it starts is closed. No axis is
    more than `tolerance` rad from its normal (n, 3 unit). With a tolerance of 0, or fewer than three rows, the
    normals are returned as they are. Costs 2 * ROUNDS banded solves of all rows, some 10 us a row in all.
    """
    if tolerance <= 0 or len(points) < 3:
        return normals
    all_rows = unrolled(points, starts)
    rows, starts = all_rows.rows, all_rows.starts
    axes = _even(points[rows], normals[rows], wanted[rows], starts, tolerance)
    merged = all_rows.merged(axes)
    return into_cone(merged / np.linalg.norm(merged, axis=1, keepdims=True), normals, tolerance)


def into_cone(axes: FloatArray, centres: FloatArray, tolerance: float) -> FloatArray:
    """Axes moved along great circles to within `tolerance` rad of their centres; both (n, 3) unit."""
    cosine = np.clip((axes * centres).sum(axis=1, keepdims=True), -1.0, 1.0)
    side = axes - cosine * centres
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300)
    on_edge = np.cos(tolerance) * centres + np.sin(tolerance) * side
    return np.where(cosine < np.cos(tolerance), on_edge, axes)


def headings(axes: FloatArray, starts: IntArray, zone: float) -> FloatArray:
    """(n,) rad of a signed polar form of axes (n, 3) unit, continuous along paths; the tilt's sign is as it falls.

    Between two rows the heading goes on, or turns half round while the tilt changes its sign, whichever is less; for
    rows within `zone` rad of the vertical, where the tilt is small enough to be changed, only the heading counts,
    and theirs lies between those before and behind. A path that is all there takes the direction it mostly leans in.
    """
    n = len(axes)
    path = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    x, y = axes[:, 0], axes[:, 1]
    tilt = np.arctan2(np.hypot(x, y), axes[:, 2])
    twice = [np.bincount(path, value, len(starts) - 1) for value in (2 * x * y, x * x - y * y)]
    leaning = 0.5 * np.arctan2(*twice)[path]
    out = np.flatnonzero(tilt > zone)
    if not out.size:
        return np.asarray(leaning)
    there, lean = np.arctan2(y, x)[out], tilt[out]
    turn = np.abs(np.mod(np.diff(there) + np.pi, 2 * np.pi) - np.pi)
    beside = np.diff(out) == 1
    go_on = turn + np.where(beside, np.abs(np.diff(lean)), 0.0)
    go_over = np.pi - turn + np.where(beside, lean[1:] + lean[:-1], 0.0)
    over = np.append(0, np.cumsum((go_over < go_on) & (path[out[1:]] == path[out[:-1]]))) % 2
    there = np.unwrap(there + np.pi * over)

    row = np.arange(n)
    behind = np.searchsorted(out, row)
    before, behind = np.maximum(behind - 1, 0), np.minimum(behind, len(out) - 1)
    has_before = (out[before] <= row) & (path[out[before]] == path)
    has_behind = (out[behind] >= row) & (path[out[behind]] == path)
    between = np.interp(row, out, there)
    one_side = np.where(has_before, there[before], np.where(has_behind, there[behind], leaning))
    return np.where(has_before & has_behind, between, one_side)


def _even(
    points: FloatArray, normals: FloatArray, wanted: FloatArray, starts: IntArray, tolerance: float
) -> FloatArray:
    """Axes (n, 3) unit of least bending of tilt and heading, next to `tolerance` from the normals."""
    band = bending(points, starts)
    soft = REACH**-4 * spans(points, starts)
    springs = FIRST * soft
    to_normal, to_wanted = (np.arctan2(axes[:, 1], axes[:, 0]) for axes in (normals, wanted))
    arm, wanted_arm = ((axes[:, :2] ** 2).sum(axis=1) for axes in (normals, wanted))
    heading = headings(normals, starts, tolerance)
    axes = normals
    for _ in range(ROUNDS):
        pull, hold = springs * arm, soft * wanted_arm
        force = pull * _nearest_half_turn(to_normal, heading) + hold * _nearest_half_turn(to_wanted, heading)
        heading = heading + _solved(band, pull + hold, force - banded(band, heading))
        along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        tilt, middle = (np.arctan2((side[:, :2] * along).sum(axis=1), side[:, 2]) for side in (wanted, normals))
        tilt = tilt + _solved(band, springs + soft, springs * (middle - tilt) - banded(band, tilt))
        axes = np.column_stack([np.sin(tilt)[:, None] * along, np.cos(tilt)])
        off = np.linalg.norm(axes - normals, axis=1)
        springs = np.clip(springs * np.clip(off / (INSIDE * tolerance), 0.3, 3.0), SOFTEST * soft, STIFFEST * soft)
    return axes


def _nearest_half_turn(target: FloatArray, heading: FloatArray) -> FloatArray:
    """(n,) rad from a heading to the target, or to its opposite where that is nearer: the tilt is then negative."""
    return np.asarray(np.mod(target - heading + np.pi / 2, np.pi) - np.pi / 2)


def _solved(band: FloatArray, springs: FloatArray, force: FloatArray) -> FloatArray:
    total = band.copy()
    total[2] += springs + DAMPING * band[2].max()
    return np.asarray(solveh_banded(total, force, overwrite_ab=True, overwrite_b=True, check_finite=False))
