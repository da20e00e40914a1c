"""How long Marlin's G28 takes: joint after joint, fast to the endstop, back off, and slowly to it again.

`GcodeSuite::G28` homes X, Y, Z, then the rotaries; `homeaxis` makes three moves of each, which end at the endstop
without slowing down or, backing off, as any move does; every one begins from rest and waits for company in vain. Speeds
and ways back are those of Marlin's example configurations, as no profile gives them.
"""

import math

import numpy as np

from trunnion_core.profile import Joint, MachineProfile
from trunnion_sim.limits import Limits
from trunnion_sim.motion import Motion

HOMING_SPEED = 50.0
"""mm/s and degrees/s, or half of what the joint can where that is less."""
BACK = {"X": 5.0, "Y": 5.0}
BACK_OF_OTHERS = 2.0
"""mm and degrees: HOMING_BUMP_MM."""
SLOWER = {"X": 2.0, "Y": 2.0}
SLOWER_OF_OTHERS = 4.0
"""HOMING_BUMP_DIVISOR."""


def homing_order(profile: MachineProfile, named: set[str]) -> list[int]:
    """Columns of the joints that G28 homes, in its order; all where none is `named`."""
    first = [letter for letter in "XYZ" if letter in profile.letters]
    letters = first + [letter for letter in profile.letters if letter not in first]
    return [profile.letters.index(letter) for letter in letters if letter in named or not named & set(letters)]


def homing_times(motion: Motion, profile: MachineProfile, limits: Limits, wait: float) -> dict[int, float]:
    """s that every homing row takes; `wait` s are lost before each of a joint's moves."""
    times = {}
    for command in motion.commands:
        if command.name != "G28" or command.row >= len(motion):
            continue
        row = command.row
        way = np.abs(motion.joints[row] - motion.before[row]) * profile.to_shown
        which = int(limits.which[row])
        named = {letter for letter, _ in command.words}
        times[row] = sum(
            _of_joint(profile.joints[column], float(way[column]), column, limits, which) + 3 * wait
            for column in homing_order(profile, named)
        )
    return times


def speed_of(joint: Joint, most: float) -> float:
    """Fast homing speed of a joint that can go `most`, mm/s or degrees/s."""
    return min(HOMING_SPEED, 0.5 * most)


def _of_joint(joint: Joint, way: float, column: int, limits: Limits, which: int) -> float:
    fast = speed_of(joint, float(limits.speed[which, column]))
    slow = fast / SLOWER.get(joint.letter, SLOWER_OF_OTHERS)
    back = BACK.get(joint.letter, BACK_OF_OTHERS)
    push = min(float(limits.acceleration[which, column]), float(limits.path[which, 1]))
    return _against(way, fast, push) + _and_stop(back, fast, push) + _against(back, slow, push)


def _against(way: float, speed: float, push: float) -> float:
    """From rest to an endstop."""
    ramp = speed * speed / (2 * push)
    return math.sqrt(2 * way / push) if way < ramp else way / speed + speed / (2 * push)


def _and_stop(way: float, speed: float, push: float) -> float:
    """From rest to rest."""
    return 2 * math.sqrt(way / push) if way * push < speed * speed else way / speed + speed / push
