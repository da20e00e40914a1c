"""Commands become the position that the printer should report: to be held against what M114 says.

Only what is certain is claimed. After homing, a tool change, or a command that may move the machine by itself, a letter
is unknown until it is programmed absolutely or the printer has said it once.
"""

import re
from dataclasses import dataclass, field

LETTERS = "XYZABCUVWE"
WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")
MOVES = frozenset({"G0", "G1", "G2", "G3", "G00", "G01", "G02", "G03"})
HARMLESS = re.compile(
    r"G(4|17|21|93|94)|M([01]|17|18|73|84|10[4-9]|11[034578]|140|15[45]|190|20[1345]|22[01]|302|400|413|503|566|572|593|"
    r"862\.\d|900)"
)
"""Commands that leave the machine where it is."""


@dataclass
class Position:
    """Where the program has the machine after the commands followed so far.

    `values` go on being counted for letters outside `known`, so that one report makes them known. `epoch` counts, for
    every letter, how often it was set afresh.
    """

    values: dict[str, float] = field(default_factory=lambda: dict.fromkeys(LETTERS, 0.0))
    epoch: dict[str, int] = field(default_factory=lambda: dict.fromkeys(LETTERS, 0))
    known: set[str] = field(default_factory=set)
    relative: bool = False
    relative_e: bool = False
    metric: bool = True

    def follow(self, command: str) -> None:
        """Take one command of the program, without comment."""
        name = command.partition(" ")[0]
        if name in MOVES:
            self._move(command)
        elif name == "G92":
            words = [(letter, value) for letter, value in WORD.findall(command[3:]) if letter in LETTERS]
            for letter, value in words:
                self._set(letter, float(value))
            if not words:
                self._forget(LETTERS)
        elif name in ("G90", "G91"):
            self.relative = self.relative_e = name == "G91"
        elif name in ("M82", "M83"):
            self.relative_e = name == "M83"
        elif name == "G28":
            self._forget(LETTERS.replace("E", ""))
        elif not HARMLESS.fullmatch(name):
            self._forget(LETTERS)
            self.metric &= name != "G20"

    def copy(self) -> "Position":
        """As it stands now."""
        return Position(
            self.values.copy(), self.epoch.copy(), self.known.copy(), self.relative, self.relative_e, self.metric
        )

    def learn(self, letter: str, value: float, when: "Position") -> None:
        """The printer said that a letter stood at `value` `when` the program was there; nothing if it was set since."""
        if when.metric and self.epoch[letter] == when.epoch[letter]:
            self.values[letter] += value - when.values[letter]
            self.known.add(letter)

    def _move(self, command: str) -> None:
        for letter, value in WORD.findall(command.partition(" ")[2]):
            if letter not in LETTERS:
                continue
            if self.relative_e if letter == "E" else self.relative:
                self.values[letter] += float(value)
            else:
                self._set(letter, float(value))

    def _set(self, letter: str, value: float) -> None:
        self.values[letter] = value
        self.epoch[letter] += 1
        if self.metric:
            self.known.add(letter)

    def _forget(self, letters: str) -> None:
        for letter in letters:
            self.known.discard(letter)
            self.epoch[letter] += 1
