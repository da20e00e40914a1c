"""Poses to one continuous joint path: the exact choice of branch and winding along the whole path.

A state of a row is one solution of inverse with one winding of each rotary inside its limits; at the pole, where rotary
1 is free, the solutions are that joint's angles in the rows before and after the free stretch, and at rest. A dynamic
program finds the cheapest sequence of states, where a step costs

    time x (2 while extruding) + 0.001 x turning time of the rotaries + 3 for a rewind   (s)

and 0.001 for each travel within a free stretch that is begun with rotary 1 already at an angle that only the rows after
the stretch need.
`time` is the least in which every joint at its top speed, and the tip at the wanted speed, can make the step. A step is
a *rewind* where it turns the tool through much more than the way between the two tool axes: the tool then leaves the
part's surface in between, so it belongs into a travel with the nozzle lifted. A row that extrudes may be one only where
no state of it is reached otherwise; such rewinds are *forced*. (Makhanov and Munlin 2006 choose rotation angles by
shortest path in the same spirit.)
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray, freeze
from trunnion_core.profile import MachineProfile
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.reach import LIMIT_SLACK, outside_limits, unreachable

EXTRUDING_WEIGHT = 2.0
"""What a second costs while plastic flows, in seconds of travel: a slow row in a bead is a blob."""

TURNING_WEIGHT = 1e-3
"""Cost of a second of turning that costs no time: of equal ways the one that turns least."""

EARLY_COST = 1e-3
"""s a travel. Over planar layers the platter keeps still and turns shortly before it must, not at the first chance."""

REWIND_COST = 3.0
"""s. Retract, leave, return and prime, besides the motion itself."""

STRAY = 0.01
"""rad that the tool may sweep in a step beyond three times the angle between the two tool axes before it is a jump."""

MOST_WINDINGS = 128
"""Windings kept as states. With more, the path is first sought without limits: there the nearest winding is enough."""

FIRST_SOURCES = 1 << 16
"""States whose source is remembered before more room is taken."""

SPARE_ANGLES = 16
"""Angles of the free rotary tried at the pole where those of its neighbours bring a linear joint past its limit."""

ANGLES_APART = np.radians(0.1)
"""rad. Of two angles closer than this one is enough at the pole; the difference takes no time worth speaking of."""

POLE_ANGLE = 1e-8
"""rad to the pole below which rotary 1 is free without any tolerance: rounding of a tool axis meant to be vertical."""


@dataclass(frozen=True, eq=False)
class PathChoice:
    """Joints for every row of a path, and where they cannot be continuous."""

    joints: FloatArray
    """(n, k) mm and rad, windings inside the limits."""
    tool_axes: FloatArray
    """(n, 3) unit, `part`: as asked, or as leant within the tolerance."""
    rewinds: IntArray
    """Rows whose motion is a jump of the joints: to be done with the nozzle lifted."""
    forced: IntArray
    """Those of them that extrude."""

    def __post_init__(self) -> None:
        freeze(self.joints, self.tool_axes, self.rewinds, self.forced)


def choose(
    chain: JointChain,
    profile: MachineProfile,
    points: FloatArray,
    tool_axes: FloatArray,
    *,
    travel: BoolArray,
    axis_tolerance: float = 0.0,
    start: FloatArray | None = None,
    speed: FloatArray | None = None,
) -> PathChoice:
    """The cheapest joint path through all poses, as the module says; exact over its states.

    points (n, 3) mm and tool_axes (n, 3) unit in `part`; travel (n,) marks rows whose motion extrudes nothing;
    axis_tolerance in rad is how far the tool may lean from tool_axes near the pole; start (k,) is where the joints
    stand before row 0, if that matters; speed (n,) mm/s of the tip, if known, says which turns cost no time. Raises
    UnreachableError for the first row that no state reaches, naming the joint that gave up.
    """
    n, k = len(points), len(profile.joints)
    if n == 0:
        none = np.empty(0, dtype=np.int64)
        return PathChoice(np.empty((0, k)), np.empty((0, 3)), none, none.copy())
    if not chain.rotary.size:
        return _without_rotaries(chain, profile, points, tool_axes)
    travel = np.require(travel, dtype=np.bool_, requirements=["C", "W"])
    joints, jump = _dynamic_program(chain, profile, points, tool_axes, travel, axis_tolerance, start, speed)
    used = np.array(tool_axes, dtype=np.float64)
    if axis_tolerance > 0:
        from trunnion_kinematics.pole import straighten

        joints = straighten(chain, profile, points, used, joints, ~travel & ~jump, axis_tolerance)
        _, leant = chain.forward(joints)
        turned = np.linalg.norm(leant - used, axis=1) > POLE_ANGLE
        used[turned] = leant[turned]
    rewinds = np.flatnonzero(jump)
    return PathChoice(joints, used, rewinds, rewinds[~travel[rewinds]])


def _without_rotaries(
    chain: JointChain, profile: MachineProfile, points: FloatArray, tool_axes: FloatArray
) -> PathChoice:
    joints = chain.inverse(points, tool_axes)[0]
    wrong = np.flatnonzero(outside_limits(profile, joints).any(axis=1))
    if wrong.size:
        raise unreachable(chain, profile, int(wrong[0]), points, tool_axes)
    none = np.empty(0, dtype=np.int64)
    return PathChoice(joints, np.array(tool_axes, dtype=np.float64), none, none.copy())


def _dynamic_program(
    chain: JointChain,
    profile: MachineProfile,
    points: FloatArray,
    tool_axes: FloatArray,
    travel: BoolArray,
    axis_tolerance: float,
    start: FloatArray | None,
    speed: FloatArray | None,
) -> tuple[FloatArray, BoolArray]:
    """Joints (n, k) and jumps (n,), by the cheapest way of three: windings free, exact windings, spare angles."""
    from trunnion_kinematics.choice_kernels import choice_kernel

    points, tool_axes = np.array(points, dtype=np.float64), np.array(tool_axes, dtype=np.float64)
    w2 = chain.rotary_axes[1]
    sine = chain.pole_sine(tool_axes)
    sine2 = float(np.linalg.norm(np.cross(w2, chain.tool_axis)))
    step = np.zeros(len(points))
    step[1:] = np.linalg.norm(np.diff(tool_axes, axis=0), axis=1)
    sweep_limit = 6 * np.arcsin(np.clip(step / 2, 0, 1)) + STRAY + 2 * axis_tolerance
    floor = np.zeros(len(points))
    if speed is not None:
        floor[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1) / speed[1:]
    at = np.full(len(profile.joints), np.nan) if start is None else np.array(start, dtype=np.float64)
    low, high = profile.array("min")[chain.rotary], profile.array("max")[chain.rotary]
    turns = (high - low) / (2 * np.pi)
    exact = np.where(np.isfinite(turns), np.minimum(np.floor(turns + 1e-9) + 1, MOST_WINDINGS), 0).astype(np.int64)
    middle = np.where(np.isfinite(turns), np.clip(0.0, low + MOST_WINDINGS * np.pi, high - MOST_WINDINGS * np.pi), 0.0)
    window = (
        np.where(turns > MOST_WINDINGS, np.maximum(low, middle - MOST_WINDINGS * np.pi), low),
        np.where(turns > MOST_WINDINGS, np.minimum(high, middle + MOST_WINDINGS * np.pi), high),
    )
    costs = np.array([EXTRUDING_WEIGHT, TURNING_WEIGHT, REWIND_COST])
    rest = 0.0 if start is None else float(at[chain.rotary[0]])
    free = _free_rows(chain, tool_axes, axis_tolerance)
    for spare in (0, SPARE_ANGLES):
        offset, run, anchors, early = _anchors(chain, points, tool_axes, free, rest, spare)
        candidates, usable = _candidates(chain, profile, points, tool_axes, offset, run, anchors)
        for windings in _windings_to_try(exact, turns):
            joints, jump = np.empty((len(points), len(at))), np.zeros(len(points), dtype=np.bool_)
            states = int(np.maximum(windings, 1).prod())
            short = states * int(np.diff(offset).max()) <= np.iinfo(np.int16).max
            pointer = np.empty(FIRST_SOURCES, dtype="int16" if short else "int32")
            failed = choice_kernel(
                chain.constants[1],
                candidates,
                usable,
                offset,
                run,
                early,
                windings,
                *window,
                profile.array("speed"),
                sine,
                sine2,
                sweep_limit,
                travel,
                floor,
                at,
                costs,
                pointer,
                joints,
                jump,
            )
            if failed < 0 and _shift_into_limits(chain.rotary, joints, windings, low, high, start is None):
                return joints, jump
        if failed >= 0 and not free[failed]:
            break
    raise unreachable(chain, profile, max(failed, 0), points, tool_axes)


def _windings_to_try(exact: IntArray, turns: FloatArray) -> list[IntArray]:
    """Joints of very many windings are first taken without limits: a path that stays inside them is then the best."""
    loose = np.where(turns > MOST_WINDINGS, 0, exact)
    return [loose] if (loose == exact).all() else [loose, exact]


def _shift_into_limits(
    rotary: IntArray, joints: FloatArray, windings: IntArray, low: FloatArray, high: FloatArray, may_shift: bool
) -> bool:
    """Whether rotaries whose windings were left free stay within limits, if need be after whole turns."""
    from trunnion_kinematics.winding_kernels import TURN

    for r in np.flatnonzero(windings == 0):
        angle = joints[:, rotary[r]]
        fewest = np.ceil((low[r] - LIMIT_SLACK - angle.min()) / TURN)
        most = np.floor((high[r] + LIMIT_SLACK - angle.max()) / TURN)
        if fewest > most or (not may_shift and not fewest <= 0 <= most):
            return False
        if may_shift:
            angle += TURN * np.clip(0, fewest, most)
    return True


def _free_rows(chain: JointChain, tool_axes: FloatArray, axis_tolerance: float) -> BoolArray:
    """(n,) whether any angle of rotary 1 keeps the tool within the tolerance, which is so close to the pole only."""
    w1, w2 = chain.rotary_axes
    along = tool_axes @ w1
    across = chain.pole_sine(tool_axes)
    tolerance = max(axis_tolerance, POLE_ANGLE)
    apart, to_tool = np.arccos(np.clip(w1 @ w2, -1, 1)), np.arccos(np.clip(w2 @ chain.tool_axis, -1, 1))
    tilt = np.arctan2(across, along)
    nearest, farthest = np.abs(tilt - apart), np.minimum(tilt + apart, 2 * np.pi - tilt - apart)
    return np.asarray((np.abs(nearest - to_tool) <= tolerance) & (np.abs(farthest - to_tool) <= tolerance))


def _anchors(
    chain: JointChain, points: FloatArray, tool_axes: FloatArray, free: BoolArray, rest: float, spare: int
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Where each row's candidates lie (n + 1,), the row's run of free rows or -1 (n,), angles of each run and their
    price a travel, (r, a).

    The angles of rotary 1 worth having in a run of free rows: those of the rows on either side, in both branches, and
    that at rest.
    """
    n = len(points)
    first = np.flatnonzero(free & ~np.append(False, free[:-1]))
    last = np.flatnonzero(free & ~np.append(free[1:], False))
    run = np.where(free, np.cumsum(np.isin(np.arange(n), first)) - 1, -1)
    angles = np.full((len(first), 5 + spare), np.nan)
    for column, rows in ((0, first - 1), (2, last + 1)):
        there = (rows >= 0) & (rows < n)
        solved = chain.inverse(points[rows[there]], tool_axes[rows[there]])[:, :, chain.rotary[0]]
        angles[there, column : column + 2] = solved.T
    angles[:, 4] = np.pi - (np.pi - rest) % (2 * np.pi)
    known = angles[:, [0, 1, 4]]
    angles[:, 5:] = rest + np.linspace(-np.pi, np.pi, spare, endpoint=False)
    wanted = [0, 1, 4, 2, 3, *range(5, 5 + spare)]
    for place, column in enumerate(wanted):
        apart = np.mod(angles[:, wanted[:place]] - angles[:, [column]] + np.pi, 2 * np.pi) - np.pi
        angles[(np.abs(apart) < ANGLES_APART).any(axis=1), column] = np.nan
    angles.sort(axis=1)
    count = np.full(n, 2)
    count[free] = np.isfinite(angles).sum(axis=1)[run[free]]
    apart = np.abs(angles[:, :, None] - known[:, None, :])
    early = np.where((apart < 10 * POLE_ANGLE).any(axis=2), 0.0, EARLY_COST)
    return np.append(0, np.cumsum(count)), run, angles, early


def _candidates(
    chain: JointChain,
    profile: MachineProfile,
    points: FloatArray,
    tool_axes: FloatArray,
    offset: IntArray,
    run: IntArray,
    anchors: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    from trunnion_kinematics.choice_kernels import candidates_kernel

    candidates = np.empty((offset[-1], len(chain.letters)))
    usable = np.empty(offset[-1], dtype=np.bool_)
    limits = profile.array("min"), profile.array("max")
    candidates_kernel(*chain.constants, points, tool_axes, offset, run, anchors, *limits, candidates, usable)
    return candidates, usable
