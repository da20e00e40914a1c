"""Turn rows that name the tip into rows of joints, as a controller with tip control does.

X, Y and Z of such a row are the tip over the part, in the coordinates that the linear joints have with all rotaries at
zero; the rotary words are joints. With those known the tip is linear in the linear joints, so each row is one 3x3
system, made from four forward maps. Between rows joints run straight. The controllers follow the tip's straight line in
small pieces, so a row whose joints would take the tip off its line is cut; rows of programs that keep to a chord
tolerance stay whole.
"""

from collections.abc import Sequence

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_sim.chain import forward
from trunnion_sim.tip_control import TipControl

SHORTEST = 1e-3
"""mm: F is read over the turn of rotaries where the tip moves no farther."""
MOST_OFF = 0.05
"""mm that the tip may leave its line between the ends of a row that feeds and stays whole."""
MOST_OFF_IN_AIR = 0.5
"""The same where nothing is fed: travels are planned to less."""
FOLLOWED = 0.01
"""mm that it may between the ends of a piece."""
MOST_PIECES = 2000
LONGEST_ROW = 65535
"""Pieces that Marlin cuts a move into at most."""


def joints_of_tips(
    profile: MachineProfile, words: FloatArray, named: BoolArray, told: Sequence[tuple[int, TipControl]] = ()
) -> FloatArray:
    """(n, k) joints, mm or rad, for `words` (n, k) of which rows `named` (n,) hold the tip under the linear letters.

    From the rows in `told` on, the firmware believes in another geometry than the profile's, and so moves other joints.
    A row that no linear joint can reach, since their directions do not span space there, stays as it is named.
    """
    rows = np.flatnonzero(named)
    if not rows.size:
        return words
    linear = [column for column, joint in enumerate(profile.joints) if not joint.rotary]
    world = np.stack([words[rows, profile.letters.index(letter)] for letter in "XYZ"], axis=1)
    still = words[rows].copy()
    still[:, linear] = 0.0
    origin, _ = forward(profile, still)
    directions = np.empty((len(rows), 3, 3))
    for place, column in enumerate(linear):
        pushed = still.copy()
        pushed[:, column] = 1.0
        directions[:, :, place] = forward(profile, pushed)[0] - origin
    joints = words.copy()
    gap = world - profile.origin + profile.tip - origin
    joints[rows[:, None], linear] = np.linalg.solve(directions, gap[:, :, None])[:, :, 0]
    ends = [row for row, _ in told[1:]] + [len(words)]
    for (row, control), end in zip(told, ends, strict=False):
        believed = np.flatnonzero(named[row:end]) + row
        joints[believed] = control.many(words[believed] * profile.to_shown) / profile.to_shown
    return joints


def world_steps(profile: MachineProfile, start: FloatArray, joints: FloatArray) -> FloatArray:
    """(n, 3) mm that the tip moves over the part in every row from `start` (k,) through `joints` (n, k)."""
    points, _ = forward(profile, np.concatenate([start[None], joints]))
    return np.diff(points, axis=0)


def pieces_of_tips(
    profile: MachineProfile, start: FloatArray, joints: FloatArray, named: BoolArray, fed: BoolArray
) -> IntArray:
    """(n,) pieces that rows have to be cut into so that straight joints keep the tip within FOLLOWED of its line.

    `start` (k,) and `joints` (n, k) mm or rad; `fed` (n,) says where plastic flows. Only rows `named` (n,) that turn a
    rotary are cut. The controllers cut them finer still, 200 times a second.
    """
    count = np.ones(len(joints), np.int64)
    before = np.concatenate([start[None], joints[:-1]])
    turns = np.abs(joints - before)[:, list(profile.rotary)].max(axis=1, initial=0.0) > 0
    rows = np.flatnonzero(named & turns)
    if not rows.size:
        return count
    begin, _ = forward(profile, before[rows])
    end, _ = forward(profile, joints[rows])
    off = np.zeros(len(rows))
    for share in (0.25, 0.5, 0.75):
        there, _ = forward(profile, before[rows] + share * (joints[rows] - before[rows]))
        off = np.maximum(off, np.linalg.norm(there - begin - share * (end - begin), axis=1))
    cut = off > np.where(fed[rows], MOST_OFF, MOST_OFF_IN_AIR)
    count[rows[cut]] = np.minimum(np.ceil(np.sqrt(off[cut] / FOLLOWED)), MOST_PIECES).astype(np.int64)
    return count


def pieces_in_time(
    profile: MachineProfile,
    start: FloatArray,
    joints: FloatArray,
    filament: FloatArray,
    named: BoolArray,
    feed: FloatArray,
    per_second: FloatArray,
    least: int,
) -> IntArray:
    """(n,) pieces that Marlin's fork cuts turning moves into, where each has less than `least` steps; else 1.

    There are `per_second` (n,) in every second at `feed` (n,) mm/s or degrees/s. Longer pieces are blocks of their own,
    and make no difference to the row as a whole (`line_to_destination_kinematic`).
    """
    before = np.concatenate([start[None], joints[:-1]])
    change = (joints - before) * profile.to_shown
    rotary = list(profile.rotary)
    turned = np.linalg.norm(change[:, rotary], axis=1)
    straight = np.linalg.norm(world_steps(profile, start, joints), axis=1)
    length = np.where(straight > SHORTEST, straight, turned)
    count = np.clip(per_second * length / np.maximum(feed, SHORTEST), 1, LONGEST_ROW).astype(np.int64)
    most = np.abs(np.column_stack([change, filament]) * profile.steps_per_shown).max(axis=1)
    return np.where(named & (turned > 0) & (most < least * count), count, 1)


def cut_words(
    profile: MachineProfile, start: FloatArray, joints: FloatArray, words: FloatArray, count: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Row, piece from 1, and words (m, k) of every piece of rows cut into `count` (n,): even steps of the words."""
    rows = np.repeat(np.arange(len(count)), count)
    piece = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count) + 1
    cut = np.flatnonzero(count > 1)
    begin = words.copy()
    previous = np.concatenate([start[None], joints[:-1]])[cut]
    begin[cut] = previous
    points, _ = forward(profile, previous)
    for place, letter in enumerate("XYZ"):
        begin[cut, profile.letters.index(letter)] = (points + profile.origin - profile.tip)[:, place]
    share = (piece / count[rows])[:, None]
    return rows, piece, np.where(share < 1, begin[rows] + share * (words[rows] - begin[rows]), words[rows])
