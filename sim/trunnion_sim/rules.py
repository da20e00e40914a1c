"""What the judge knows about one firmware: the commands it takes and how it reads F and rounds corners.

A firmware is a file in `firmwares/` that exposes RULES; the profile's `firmware` is the name of the file.
"""

import importlib
import math
import pkgutil
from dataclasses import dataclass, field
from typing import Literal

from trunnion_core.errors import ProfileError
from trunnion_core.validation import nearest
from trunnion_sim import firmwares


@dataclass(frozen=True)
class Rules:
    """How one firmware executes a program."""

    name: str
    commands: frozenset[tuple[str, int]]
    """Letter and ten times the number of every command it knows."""
    names: frozenset[str] = field(default=frozenset(), kw_only=True)
    """Commands that have a name instead of a number, as far as the judge knows them."""
    corners: Literal["marlin", "per_axis", "klipper", "grbl", "linuxcnc"]
    """How speeds at corners come about: see `replay_kernel`, `duet_kernel`, `toolhead_kernel` and `blend_kernel`."""
    g90_resets_e: bool
    """Whether G90 and G91 also set the mode of the extruder."""
    case_sensitive: bool
    """Whether a lower-case letter is an unknown command."""
    inverse_time: bool
    """Whether G93 is understood."""
    max_line: int
    """Bytes of one line, with number and checksum, that the firmware can take."""
    least_blocks: int
    """Moves that the planner looks ahead at least, whatever the profile says."""
    slowest: float
    """mm/s; slower moves are sped up to this."""
    unseen_blocks: int = 0
    """Places of the planner's queue that the plan of a move can never count on when the move begins."""
    homes_in_turn: bool = False
    """Whether G28 homes one joint after the other, as `homing` says, and not all at once at full speed."""
    first_move_delay: float = 0.0
    """s that fewer than three moves after a standstill wait for company before they begin."""
    least_steps: int = 0
    """Motor steps on some axis below which a move is left to the next one; corners see whole steps then. 0: neither."""
    shortest_linear: float = 0.0
    """mm: F is read over the rotaries where linear motion is no longer than this."""
    whole_percent: bool = False
    """Whether M220 and M221 read whole percents."""
    filament: str = "E"
    """Letter of the filament."""
    tip_words: Literal["never", "G43.4", "always"] = "never"
    """When X, Y and Z are the tip over the part, as with the rotaries at zero, instead of joints."""
    advance_axes: str = ""
    """Letters of the joints of which one has to move for the firmware's own pressure advance; empty if it has none."""
    advance_ratio: float = math.inf
    """mm of filament to a mm over those joints beyond which it applies none."""
    advance: Literal["at once", "held", "ramps"] = "at once"
    """What its advance does between moves: see `pressure_kernel`."""


def find_rules(name: str, source: str = "profile") -> Rules:
    """The rules of the firmware of that name. ProfileError suggests the nearest."""
    known = firmware_names()
    if name not in known:
        raise ProfileError(source, [f"machine.firmware: the simulator knows no '{name}', {nearest(name, known)}"])
    found = importlib.import_module(f"{firmwares.__name__}.{name}").RULES
    if not isinstance(found, Rules) or found.name != name:
        raise TypeError(f"firmwares/{name}.py: RULES should be a Rules called '{name}'")
    return found


def firmware_names() -> tuple[str, ...]:
    """Every firmware whose rules are known, sorted."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(firmwares.__path__)))


def codes(g: str, m: str) -> frozenset[tuple[str, int]]:
    """Commands from two lists of numbers and ranges ("0-3 4 43.4"), and every T."""
    return frozenset(_numbers("G", g) | _numbers("M", m) | {("T", n * 10) for n in range(16)})


def _numbers(letter: str, text: str) -> set[tuple[str, int]]:
    found = set()
    for word in text.split():
        low, _, high = word.partition("-")
        if high:
            found |= {(letter, n * 10) for n in range(int(low), int(high) + 1)}
        else:
            found.add((letter, round(float(low) * 10)))
    return found
