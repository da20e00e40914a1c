"""What the firmware believes of its axes: position, modes, offsets, limits (Marlin 2.1 `motion.cpp`, `G0_G1.cpp`).

Positions are native, in mm and degrees with the filament last; G92 shifts what a person reads and writes, not them.
Native positions are joints, or with tip control (G43.4) the tip over the part and the angles. Soft limits hold for
native positions: with tip control the joints behind them may go anywhere.
"""

import math
from collections.abc import Sequence

import numpy as np

from trunnion_core.profile import MachineProfile
from trunnion_sim.tip_control import tip_control_of

REACH = 1e-4
"""mm that a place may be past an end and still be reached (`fslop`)."""
STARTING_FEED = 25.0
"""mm/s before the first F word."""
LONGEST_EXTRUSION = 200.0
"""mm of filament in one move (EXTRUDE_MAXLENGTH)."""


class Motion:
    """State that moves are read with."""

    def __init__(self, profile: MachineProfile) -> None:
        joints = profile.joints
        self.letters = profile.letters
        k = len(joints)
        first = [letter for letter in "XYZ" if letter in profile.letters]
        self.order = [*first, *(letter for letter in profile.letters if letter not in first)]
        """Letters as the firmware counts its axes: X, Y, Z, then the others; reports follow it."""
        self.columns = {letter: i for i, letter in enumerate((*profile.letters, "E"))}
        self.linear = [not joint.rotary for joint in joints] + [True]
        self.low = [joint.shown(joint.min) for joint in joints] + [-math.inf]
        self.high = [joint.shown(joint.max) for joint in joints] + [math.inf]
        self.home = [joint.shown(joint.home) for joint in joints]
        self.position = [0.0] * (k + 1)
        """Where the last move in the queue ends."""
        self.shift = [0.0] * (k + 1)
        """Added to native positions to get logical ones."""
        self.homed = [False] * (k + 1)
        self.relative = [False] * (k + 1)
        self.unit = 1.0
        self.feed = STARTING_FEED
        self.feed_factor = 1.0
        self.kept_feed_factor = 1.0
        self.flow_factor = 1.0
        self.soft_limits = True
        self.tip = tip_control_of(profile)
        """None where the firmware has no tip control for the machine."""
        self.tip_controlled = False

    @property
    def joints(self) -> list[float]:
        """Where the joints stand when the last move in the queue has ended, and the filament."""
        if self.tip is None or not self.tip_controlled:
            return self.position.copy()
        joints, _ = self.tip.joints(np.array(self.position[:-1]))
        return [*joints.tolist(), self.position[-1]]

    def stand_at(self, joints: Sequence[float]) -> None:
        """The queue ends at these joints and this filament."""
        self.position = list(joints)
        if self.tip is not None and self.tip_controlled:
            self.position[:-1] = self.tip.native(np.array(self.position[:-1])).tolist()

    def out_of_reach(self, goal: Sequence[float]) -> bool:
        """Whether tip control drops a move: only its X and Y are looked at, and no joint ever."""
        ends = ((goal[i], self.low[i], self.high[i]) for i in (self.columns["X"], self.columns["Y"]))
        return any(not low - REACH <= value <= high + REACH for value, low, high in ends)

    def logical(self) -> list[float]:
        """What M114 shows."""
        return [p + s for p, s in zip(self.position, self.shift, strict=True)]

    def target(self, words: dict[str, float | None]) -> list[float]:
        """Native goal of a move, not yet limited; remembers its F."""
        goal = self.position.copy()
        for letter, number in words.items():
            column = self.columns.get(letter)
            if column is None or number is None:
                continue
            if self.unit != 1.0 and self.linear[column]:
                number *= self.unit
            goal[column] = goal[column] + number if self.relative[column] else number - self.shift[column]
        feed = words.get("F")
        if feed is not None and feed > 0:
            self.feed = feed * self.unit / 60.0
        return goal

    def limit(self, goal: list[float]) -> None:
        """Cut a goal to the limits of the joints that know where they are."""
        if not self.soft_limits:
            return
        for i, known in enumerate(self.homed):
            if known:
                value = goal[i]
                if value < self.low[i]:
                    goal[i] = self.low[i]
                elif value > self.high[i]:
                    goal[i] = self.high[i]

    def name_here(self, words: dict[str, float | None]) -> bool:
        """G92: call the present place so; returns whether the filament was named."""
        named_filament = False
        for letter, column in self.columns.items():
            number = words.get(letter)
            if number is None:
                continue
            if self.linear[column]:
                number *= self.unit
            if letter == "E":
                self.position[column] = number
                named_filament = True
            else:
                self.shift[column] = number - self.position[column]
        return named_filament
