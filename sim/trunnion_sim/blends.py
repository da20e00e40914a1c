"""Turn rows into LinuxCNC's time law: one move of its planner for every line, whatever the rows of the judge are.

Rows that name the tip are moves of the world's axes, and a long turn that the judge cuts into pieces is one move; its
law is dealt out over the pieces.
"""

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_sim.blend_kernel import Law, linuxcnc
from trunnion_sim.motion import Motion
from trunnion_sim.tip_rows import world_steps

TOLERANCE = 0.01
"""mm: the P of G64 that Trunnion's programs for LinuxCNC set."""
SERVO_PERIOD = 1e-3
"""s: SERVO_PERIOD of the configurations that LinuxCNC is shipped with."""
NO_WORD = 1e-7
"""mm: smaller than the last decimal of any word."""


def blended(
    motion: Motion,
    profile: MachineProfile,
    delta: FloatArray,
    feed: FloatArray,
    stops: BoolArray,
    speed: FloatArray,
    acceleration: FloatArray,
) -> Law:
    """Length, asked speed, entry, cruise, exit, acceleration and duration (n,) of every row.

    delta (n, k + 1) mm and degrees, the filament last; feed (n,) as `Motion` has it; stops (n,) where the machine
    stands before the row; speed and acceleration (k + 1,) limits of the axes.
    """
    if motion.of_tip.size:
        world = world_steps(profile, motion.start, motion.joints)
        named = np.where(np.abs(world) < NO_WORD, 0.0, world)
        for place, letter in enumerate("XYZ"):
            column = profile.letters.index(letter)
            delta[:, column] = np.where(motion.of_tip, named[:, place], delta[:, column])
    first = _first_rows(motion)
    pieces = np.diff(np.append(first, len(motion)))
    linear = np.array([not joint.rotary for joint in profile.joints] + [False])
    per_move = feed[first] / np.where(motion.inverse[first], pieces, 1)
    law = linuxcnc(
        np.add.reduceat(delta, first) if len(first) else delta,
        linear,
        per_move,
        motion.inverse[first],
        stops[first],
        speed,
        acceleration,
        TOLERANCE,
        SERVO_PERIOD,
    )
    return law if len(first) == len(motion) else _dealt(law, pieces)


def _first_rows(motion: Motion) -> IntArray:
    """(m,) rows that begin a move: all but the further pieces of a line that names the tip."""
    begins = np.ones(len(motion), np.bool_)
    if motion.of_tip.size:
        begins[1:] = (np.diff(motion.line) != 0) | ~motion.of_tip[1:] | ~motion.of_tip[:-1]
    return np.flatnonzero(begins)


def _dealt(law: Law, pieces: IntArray) -> Law:
    """The moves' law on the even pieces (m,) of which each consists."""
    length, asked, entry, cruise, leave, acceleration, duration = (np.repeat(values, pieces) for values in law)
    count = np.repeat(pieces, pieces)
    piece = np.arange(len(count)) - np.repeat(np.cumsum(pieces) - pieces, pieces)

    def state(share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Speed and time at shares of the moves' lengths."""
        rising = np.sqrt(entry**2 + 2 * acceleration * share * length)
        falling = np.sqrt(leave**2 + 2 * acceleration * (1 - share) * length)
        v = np.minimum(np.minimum(rising, falling), cruise)
        flat = np.maximum(share * length - (cruise**2 - entry**2) / (2 * acceleration), 0.0)
        up = (np.where(flat > 0, cruise, v) - entry) / acceleration + flat / np.where(cruise > 0, cruise, 1.0)
        return v, np.where(falling < cruise, duration - (v - leave) / acceleration, up)

    v0, begin = state(piece / count)
    v1, end = state((piece + 1) / count)
    top = np.maximum(np.minimum(cruise, np.sqrt(0.5 * (v0**2 + v1**2) + acceleration * length / count)), v0)
    return length / count, asked, v0, np.maximum(top, v1), v1, acceleration, end - begin
