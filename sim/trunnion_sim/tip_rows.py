"""Turn rows that name the tip into rows of joints, as a controller with tip control does.

X, Y and Z of such a row are the tip over the part, in the coordinates that the linear joints have with all rotaries at
zero; the rotary words are joints. With those known the tip is linear in the linear joints, so each row is one 3x3
system, made from four forward maps. Between rows the joints are taken to run straight: the controllers follow the tip's
straight line in small pieces, and programs that keep to a chord tolerance differ from that by no more.
"""

import numpy as np
from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.profile import MachineProfile

from trunnion_sim.chain import forward


def joints_of_tips(profile: MachineProfile, words: FloatArray, named: BoolArray) -> FloatArray:
    """(n, k) joints, mm or rad, for `words` (n, k) of which rows `named` (n,) hold the tip under the linear letters.

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
    return joints


def world_steps(profile: MachineProfile, start: FloatArray, joints: FloatArray) -> FloatArray:
    """(n, 3) mm that the tip moves over the part in every row from `start` (k,) through `joints` (n, k)."""
    points, _ = forward(profile, np.concatenate([start[None], joints]))
    return np.diff(points, axis=0)
