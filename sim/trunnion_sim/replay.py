"""Replay motions under the firmware's own rules: when each row happens, how fast, and where the joints are at any time.

Each row is a block with a trapezoid of speed: from its entry speed up to a cruise speed and down to its exit speed,
over the length that the firmware reads F along. Joints and filament run linearly in that length.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_sim import blends, duet_kernel, motion_kernel, replay_kernel, toolhead_kernel
from trunnion_sim.advance import drive_limit
from trunnion_sim.homing import homing_times
from trunnion_sim.limits import Limits
from trunnion_sim.merging import blocks_of, laws_of_rows
from trunnion_sim.motion import Motion
from trunnion_sim.rules import Rules
from trunnion_sim.tip_rows import world_steps

STILL = 1e-9
"""mm or degrees: smaller changes of joints are none."""
GRBL_DEVIATION = 0.01
"""mm: grblHAL's own setting $11, where the profile gives no junction deviation."""
NO_WORD = 1e-7
"""mm: smaller than the last decimal of any word."""
WITHOUT_F = 25.0
"""mm/s before the first F, as Klipper has it."""


@dataclass(frozen=True, eq=False)
class Replay:
    """The time law of every row. Lengths and speeds along the firmware's own metric: mm, or degrees, or filament."""

    length: FloatArray
    """(n,) over which F is read."""
    asked: FloatArray
    """(n,) speed that F asks for."""
    entry: FloatArray
    """(n,)."""
    cruise: FloatArray
    """(n,) highest speed reached."""
    exit: FloatArray
    """(n,)."""
    acceleration: FloatArray
    """(n,)."""
    begin: FloatArray
    """(n,) s, when the row starts."""
    duration: FloatArray
    """(n,) s."""
    joined: BoolArray
    """(n,) whether the firmware makes one move of the row and others, or never makes it, for lack of motor steps."""

    @property
    def end(self) -> FloatArray:
        """(n,) s, when the row ends."""
        return self.begin + self.duration

    @property
    def time(self) -> float:
        """s of the whole program."""
        return float(self.begin[-1] + self.duration[-1]) if len(self.begin) else 0.0

    def at(self, times: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Row, fraction of its way (0 to 1) and speed along the metric at `times`, (m,) each; at rest between rows."""
        row = np.clip(np.searchsorted(self.begin, times, side="right") - 1, 0, max(0, len(self.begin) - 1))
        t = np.clip(times - self.begin[row], 0.0, self.duration[row])
        v0, v, v1 = self.entry[row], self.cruise[row], self.exit[row]
        a, d = self.acceleration[row], self.length[row]
        up, down = (v - v0) / a, (v - v1) / a
        flat = self.duration[row] - up - down
        s_up = np.minimum(t, up)
        s_flat = np.clip(t - up, 0.0, flat)
        s_down = np.clip(t - up - flat, 0.0, down)
        way = v0 * s_up + a / 2 * s_up**2 + v * s_flat + v * s_down - a / 2 * s_down**2
        speed = np.where(t < up, v0 + a * s_up, v - a * s_down)
        resting = (times > self.begin[row] + self.duration[row]) | (d <= 0)
        fraction = np.divide(way, d, out=np.ones_like(way), where=d > 0)
        return row, np.clip(np.where(resting, 1.0, fraction), 0.0, 1.0), np.where(resting, 0.0, speed)


def replay(motion: Motion, profile: MachineProfile, rules: Rules, limits: Limits) -> Replay:
    """Plan every row as the firmware does. Linear in the rows: about a million rows a second."""
    n = len(motion)
    delta = np.empty((n, len(profile.joints) + 1))
    np.subtract(motion.joints, motion.before, out=delta[:, :-1])
    delta[:, :-1] *= profile.to_shown
    delta[:, -1] = motion.filament
    homing = motion.kind == motion_kernel.HOME
    waits = motion.dwell != 0
    stops = homing | waits
    stops[1:] |= homing[:-1]
    joined = np.zeros(n, np.bool_)
    length, asked, entry, cruise, leave, acceleration, duration = _law(
        motion, profile, rules, limits, delta, homing, stops, joined
    )
    if rules.homes_in_turn:
        times = homing_times(motion, profile, limits, rules.first_move_delay)
        rows = np.array(list(times), np.int64)
        duration[rows] = list(times.values())
        for speed in (entry, cruise, leave):
            speed[rows] = np.divide(length[rows], duration[rows], out=np.zeros(len(rows)), where=duration[rows] > 0)
    before = np.where(np.isnan(motion.dwell), 0.0, motion.dwell)
    before += _first_moves(length, stops, homing) * rules.first_move_delay
    begin = np.cumsum(before + duration) - duration
    return Replay(length, asked, entry, cruise, leave, acceleration, begin, duration, joined)


def _first_moves(length: FloatArray, stops: BoolArray, homing: BoolArray) -> BoolArray:
    """(n,) rows that begin a run of fewer than three moves from one standstill to the next."""
    run = np.cumsum(stops)
    moving = (length > 0) & ~homing
    count = np.bincount(run, weights=moving, minlength=1)
    first = np.zeros(len(length), np.bool_)
    rows = np.flatnonzero(moving)
    first[rows[np.diff(run[rows], prepend=-1) > 0]] = True
    return np.asarray(first & (count[run] < 3))


def _in_steps(delta: FloatArray, start: FloatArray, profile: MachineProfile, steps: FloatArray) -> FloatArray:
    """Changes of position between whole step counts of the motors."""
    seen = delta.copy()
    first = np.append(start * profile.to_shown, 0.0)
    for column in range(len(steps)):
        counts = np.rint((first[column] + np.cumsum(delta[:, column])) * steps[column])
        seen[:, column] = np.diff(counts, prepend=np.rint(first[column] * steps[column])) / steps[column]
    return seen


def _law(
    motion: Motion,
    profile: MachineProfile,
    rules: Rules,
    limits: Limits,
    delta: FloatArray,
    homing: BoolArray,
    stops: BoolArray,
    joined: BoolArray,
) -> toolhead_kernel.Law:
    """Every row as the firmware's planner drives it; of firmwares without M201 and the like, the first limits hold.

    Marks in `joined` the rows that share a move.
    """
    deviation = profile.planner.junction_deviation
    linear = np.array([not joint.rotary for joint in profile.joints])
    first = limits.speed[0], limits.acceleration[0]
    feed = np.where(motion.feed > 0, motion.feed, WITHOUT_F)
    if rules.corners == "klipper":
        toolhead = _klipper_toolhead(profile)
        law = toolhead_kernel.klipper(
            delta,
            np.append(linear, False),
            profile.letters.index("Z") if "Z" in profile.letters else -1,
            feed,
            stops,
            *first,
            limits.corner[0],
            *toolhead,
        )
    elif rules.corners == "grbl":
        across = GRBL_DEVIATION if deviation is None else deviation
        blocks = max(rules.least_blocks, profile.planner.blocks)
        law = toolhead_kernel.grbl(delta, feed, motion.inverse, stops, *first, across, blocks)
    elif rules.corners == "linuxcnc":
        law = blends.blended(motion, profile, delta, feed, stops, *first)
    elif rules.corners == "per_axis":
        law = duet_kernel.duet(
            delta,
            np.append(linear, False),
            np.array([letter in "XY" for letter in (*profile.letters, "E")]),
            feed,
            motion.inverse,
            stops,
            limits.which,
            limits.speed,
            limits.acceleration,
            limits.corner,
            limits.path,
            limits.slowest,
            max(rules.least_blocks, profile.planner.blocks),
            drive_limit(motion, profile, rules, limits),
        )
    else:
        return _marlin(motion, profile, rules, limits, delta, homing, stops, joined)
    return _homed(law, delta, homing, limits.speed[0])


def _klipper_toolhead(profile: MachineProfile) -> tuple[float, float, float]:
    """max_velocity, max_accel and square_corner_velocity that stand for the joints' own limits in X and Y."""
    straight = [joint for joint in profile.joints if not joint.rotary]
    plane = [joint for joint in straight if joint.letter != "Z"]
    accel = profile.planner.acceleration
    return (
        max(joint.speed for joint in straight),
        min(joint.acceleration for joint in plane) if accel is None else accel,
        min(joint.corner_speed for joint in plane),
    )


def _homed(law: toolhead_kernel.Law, delta: FloatArray, homing: BoolArray, speed: FloatArray) -> toolhead_kernel.Law:
    """Homing rows at every joint's full speed."""
    length, asked, entry, cruise, leave, acceleration, duration = law
    needed = (np.abs(delta[:, :-1]) / speed[:-1]).max(axis=1)
    duration[homing] = needed[homing]
    constant = np.divide(length, needed, out=np.zeros(len(length)), where=needed > 0)
    for value in (entry, cruise, leave):
        value[homing] = constant[homing]
    return length, asked, entry, cruise, leave, acceleration, duration


def _marlin(
    motion: Motion,
    profile: MachineProfile,
    rules: Rules,
    limits: Limits,
    delta: FloatArray,
    homing: BoolArray,
    stops: BoolArray,
    joined: BoolArray,
) -> toolhead_kernel.Law:
    deviation = profile.planner.junction_deviation
    steps = profile.steps_per_shown
    seen = _in_steps(delta, motion.start, profile, steps) if rules.least_steps else delta
    named = _named(motion, profile, delta) if motion.of_tip.size else seen
    rows = [delta, seen, named]
    feed, inverse, which, counts, blocks = motion.feed, motion.inverse, limits.which, delta, None
    if rules.least_steps:
        counts = seen * steps
        blocks = blocks_of(counts, homing, rules.least_steps - 0.5)
        joined[:] = blocks.shared
    last_named, drive = named, drive_limit(motion, profile, rules, limits)
    if blocks is not None and blocks.merged:
        rows, counts = [blocks.sums(values) for values in rows], blocks.sums(counts)
        last_named = named[blocks.last]
        feed, inverse, which = feed[blocks.last], inverse[blocks.last], which[blocks.last]
        homing, stops = blocks.any(homing), blocks.any(stops)
    length = _metric(last_named if rules.tip_words == "G43.4" else rows[0], profile, rules.shortest_linear)
    if blocks is not None:
        few = np.ones(len(counts), np.bool_)
        for column in range(counts.shape[1] - 1):
            few &= np.abs(counts[:, column]) < rules.least_steps - 0.5
        length = np.where(few, np.abs(rows[0][:, -1]), length)
        del counts
    law: toolhead_kernel.Law = replay_kernel.plan(
        rows[0],
        length,
        np.array([not joint.rotary for joint in profile.joints]),
        feed,
        inverse,
        homing,
        stops,
        which,
        limits.speed,
        limits.acceleration,
        limits.corner,
        limits.path,
        0.0 if deviation is None else deviation,
        max(rules.least_blocks, profile.planner.blocks - rules.unseen_blocks),
        rules.slowest,
        limits.slowest,
        rules.tip_words == "G43.4",
        rows[1],
        rows[2] if rules.tip_words == "never" else last_named,
        drive if blocks is None or not blocks.merged else drive[blocks.last],
    )
    if blocks is not None and blocks.merged:
        return laws_of_rows(law, blocks, _metric(delta, profile, 0.0))
    return law


def _metric(delta: FloatArray, profile: MachineProfile, shortest: float) -> FloatArray:
    """(n,) what F is read over: mm of linear joints where that is more than `shortest`, else degrees, else filament."""
    straight, turned = np.zeros(len(delta)), np.zeros(len(delta))
    for column, joint in enumerate(profile.joints):  # whole copies of all columns would not fit beside each other
        moved = delta[:, column] ** 2
        moved[np.abs(delta[:, column]) <= STILL] = 0.0
        total = turned if joint.rotary else straight
        total += moved
    rest = np.where(turned > 0, np.sqrt(turned), np.abs(delta[:, -1]))
    straight = np.sqrt(straight)
    return np.asarray(np.where(straight > shortest, straight, rest))


def _tip_steps(motion: Motion, profile: MachineProfile) -> FloatArray:
    """(n, 3) mm that rows move the tip over the part, motion smaller than any word taken for none."""
    steps = world_steps(profile, motion.start, motion.joints)
    return np.where(np.abs(steps) < NO_WORD, 0.0, steps)


def _named(motion: Motion, profile: MachineProfile, delta: FloatArray) -> FloatArray:
    """(n, k + 1) what rows change in the words that they name: the tip instead of the linear joints."""
    named = delta.copy()
    steps = _tip_steps(motion, profile)
    for place, letter in enumerate("XYZ"):
        column = profile.letters.index(letter)
        named[:, column] = np.where(motion.of_tip, steps[:, place], delta[:, column])
    return named


def samples(motion: Motion, rows: IntArray, fractions: FloatArray) -> FloatArray:
    """(m, k) joints at fractions of rows: linear between the ends, as the firmware moves them."""
    before = np.where((rows > 0)[:, None], motion.joints[np.maximum(rows - 1, 0)], motion.start)
    return np.asarray(before + fractions[:, None] * (motion.joints[rows] - before))


def pieces(
    motion: Motion, profile: MachineProfile, turn: float, only: BoolArray | None = None
) -> tuple[IntArray, FloatArray]:
    """Rows and fractions that cut every row so that no rotary turns by more than `turn` rad; each row's end is one.

    Between two such points the tip of a printer leaves its chord by at most R turn² / 8.
    """
    rotary = list(profile.rotary)
    turned = np.abs(motion.joints - motion.before)[:, rotary].max(axis=1, initial=0.0)
    count = np.clip(np.ceil(turned / turn), 1, 720).astype(np.int64)
    if only is not None:
        count[~only] = 0
    rows = np.repeat(np.arange(len(motion)), count)
    first = np.cumsum(count) - count
    step = np.arange(len(rows)) - np.repeat(first, count) + 1
    return rows, step / count[rows]
