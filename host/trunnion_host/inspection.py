"""What the host asks the printer about itself: its steps per unit once, where it stands now and then and at the end.

An answer that differs from what the program says is `doubted` and asked for again while nothing else is sent, so that
a damaged answer stops no print. Axes that differ twice in the same way are the `reason` to stop: firmware drops a move
that it cannot reach with an ok like any other. Filament that differs is a warning, since what was not laid down cannot
be undone.
"""

import re
from collections.abc import Mapping
from enum import Enum

from trunnion_host.position import LETTERS, Position

TOLERANCE = 0.015
"""mm or degrees: reports have two decimals, firmware counts in single precision."""
STEPS_TOLERANCE = 0.01
"""Share by which calibrated steps may differ from the profile's."""
PATIENCE = 5
"""Questions without an answer after which a doubt is dropped."""
REPORTED = re.compile(rf"\b([{LETTERS}]):\s*(-?\d+(?:\.\d+)?)")
STEPS = re.compile(r"\bM92((?: [A-Z]\d+(?:\.\d+)?)+)")
WORD = re.compile(r"([A-Z])(\d+(?:\.\d+)?)")


class Question(Enum):
    """What goes over the wire."""

    WHERE = "M114"
    STEPS = "M503"


class Inspection:
    """`follow` every command that goes out, `hear` every report; `next` says what to ask before the next command.

    `steps` is a letter to the motor steps per mm or degree that the profile has; empty for firmware without M503.
    """

    def __init__(self, steps: Mapping[str, float] | None = None) -> None:
        self.reason = ""
        self.warnings: list[str] = []
        self.doubted = False
        self.due = False
        self._steps = dict(steps or {})
        self._want_steps = bool(self._steps)
        self._position = Position()
        self._expected = Position()
        self._differed: dict[str, float] = {}
        self._open = 0
        self._answered = False
        self._unanswered = 0
        self._followed = 0
        self._asked_after = -1

    @property
    def waiting(self) -> bool:
        """Whether nothing more may be sent until an answer came."""
        return self.doubted and self._open > 0

    @property
    def current(self) -> bool:
        """Whether the printer was asked after the last command, and no doubt is left."""
        return self._asked_after == self._followed and not self.doubted

    def next(self, at_end: bool) -> Question | None:
        """What to ask before the next command."""
        if self._want_steps:
            return Question.STEPS
        if (self.due or self.doubted or (at_end and not self.current)) and not self.waiting:
            return Question.WHERE
        return None

    def ask(self, question: Question, number: int) -> None:
        """The question goes out as line `number`, after every command followed so far."""
        if question is Question.STEPS:
            self._want_steps = False
            return
        self.due = False
        self._open = number
        self._asked_after = self._followed
        self._expected = self._position.copy()
        self._answered = False

    def follow(self, command: str) -> None:
        """A command of the program goes out."""
        self._followed += 1
        self._position.follow(command)

    def taken(self, number: int) -> None:
        """Every line up to `number` was taken, so an open question up to there is closed, answered or not."""
        if not 0 < self._open <= number:
            return
        self._open = 0
        if not self._answered:
            self._unanswered += 1
            self.doubted &= self._unanswered < PATIENCE

    def hear_position(self, text: str) -> None:
        """A position that the printer sent, whether it was asked for or came by itself."""
        if not self._open:
            return
        self._answered = True
        self._unanswered = 0
        said = {letter: float(value) for letter, value in REPORTED.findall(text.partition("Count")[0])}
        expected = self._expected
        off = {letter: value - expected.values[letter] for letter, value in said.items() if letter in expected.known}
        off = {letter: value for letter, value in off.items() if abs(value) > TOLERANCE}
        if off and not (self.doubted and _alike(off, self._differed)):
            self.doubted, self._differed = True, off
            return
        self.doubted = False
        self._judge(off, said)
        for letter, value in said.items():
            if letter not in expected.known or letter == "E":  # rounding in the count of filament does not add up
                self._position.learn(letter, value, expected)

    def hear(self, text: str) -> None:
        """A line of M503's answer, perhaps the one with the steps per unit."""
        found = STEPS.search(text) if self._steps else None
        if not found:
            return
        said = {letter: float(value) for letter, value in WORD.findall(found[1])}
        off = [x for x, steps in self._steps.items() if x in said and abs(said[x] - steps) > STEPS_TOLERANCE * steps]
        if off:
            has = ", ".join(f"{x} {said[x]:g}" for x in off)
            wanted = ", ".join(f"{x} {self._steps[x]:g}" for x in off)
            self.warnings.append(
                f"the printer's steps per unit are {has} where the profile has {wanted}: one of them is wrong (M92)"
            )
        self._steps.clear()

    def _judge(self, off: Mapping[str, float], said: Mapping[str, float]) -> None:
        """The difference was confirmed."""
        axes = [letter for letter in off if letter != "E"]
        if axes:
            stands = " ".join(f"{letter}{said[letter]:.2f}" for letter in axes)
            wanted = " ".join(f"{letter}{said[letter] - off[letter]:.2f}" for letter in axes)
            self.reason = f"the printer stands at {stands} where the program has it at {wanted}: it left out a move"
        elif off:
            less = "less" if off["E"] < 0 else "more"
            self.warnings.append(
                f"the printer counts {abs(off['E']):.2f} mm {less} filament than the program: it left out a move, or "
                "fed by itself"
            )


def _alike(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Whether two differences are the same one."""
    return one.keys() == other.keys() and all(abs(one[x] - other[x]) < TOLERANCE for x in one)
