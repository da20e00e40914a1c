"""What one firmware understands, as a value: its commands, and the length over which it reads F.

A dialect is a file in `dialects/` that exposes DIALECT; the profile's `firmware` is the name of the file.
"""

import importlib
import math
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import ProfileError
from trunnion_core.profile import MachineProfile
from trunnion_core.validation import nearest
from trunnion_gcode import dialects
from trunnion_gcode.planner import Planner

Metric = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(n, 3) mm of the linear words, (n, r) degrees of the rotary words, (n,) mm of filament -> (n,) length that F is
measured over. Zero where the firmware would see no motion at all."""


@dataclass(frozen=True)
class Dialect:
    """A firmware's language. Texts with `%s` take one number; None means that the firmware has no such command."""

    name: str
    metric: Metric
    planner: Planner
    tip_words: bool = False
    """Whether X, Y and Z are the tip over the part, turned back to rotaries at zero, instead of joints."""
    refuses: Callable[[MachineProfile], str | None] = lambda profile: None
    """Why a machine cannot be driven in this dialect; None where it can."""
    enter: tuple[str, ...] = ()
    """Just before the first move of the program, when the machine is homed and hot."""
    leave: tuple[str, ...] = ()
    """Just after the last."""
    inverse_time: bool = False
    """G93: F is one over the minutes that the move takes, and stands on every move."""
    relative_extrusion: bool = True
    extruder: str = "E"
    """Letter of the filament."""
    travel: str = "G0"
    """Command of a move without plastic, where its F is honoured."""
    start: tuple[str, ...] = ("G21", "G90", "M83")
    """Units and modes that the program relies on."""
    finish: tuple[str, ...] = ()
    """Closes the program, after the profile's end code."""
    nozzle_temperature: str | None = "M104 S%s"
    wait_nozzle: str | None = "M109 S%s"
    bed_temperature: str | None = "M140 S%s"
    wait_bed: str | None = "M190 S%s"
    fan: str | None = "M106 S%s"
    """Takes the duty from 0 to `fan_full`."""
    fan_off: str | None = "M107"
    fan_full: int = 255
    pause: str = "M0"
    pressure_advance: str | None = None
    """Turns pressure advance on; takes s, 0 for off."""
    advance_axes: str = "XY"
    """Letters of the words of which one has to change for the firmware to apply it."""
    advance_ratio: float = math.inf
    """mm of filament to a mm over those axes beyond which it does not."""
    advance_in_ramps: bool = False
    """Whether it only follows the ramps within moves, and leaves out what the flow changes by from move to move."""
    draws_back: bool = True
    """Whether a move of joints may draw filament back without the planner stopping before and after."""
    progress: str | None = "M73 P%d R%d"
    """Takes percent done and minutes left."""
    checksums: bool = True
    """Whether a host may number the lines and add checksums."""
    max_line: int = 95
    """Bytes in a line as it goes over the wire, number and checksum included."""
    shortest: float = 0.0
    """Length of the metric under which the firmware's own arithmetic spoils F; such moves are merged if possible."""
    minimum_steps: int = 0
    """A move of fewer motor steps on every joint and the filament is joined to the next one (`joining`); one with as
    many of filament alone is measured over that."""
    minimum_speed: float = 0.0
    """mm/s along the metric; slower moves are sped up by the firmware unless `allow_slower` is said."""
    allow_slower: str | None = None
    """Lowers `minimum_speed`; takes mm/min."""
    setup: Callable[[MachineProfile], tuple[str, ...]] = lambda profile: ()
    """Comments for the head of the file: what the firmware must be told once."""


def find_dialect(name: str, source: str = "profile") -> Dialect:
    """The dialect of that name. ProfileError suggests the nearest."""
    known = dialect_names()
    if name not in known:
        raise ProfileError(source, [f"machine.firmware: no dialect '{name}', {nearest(name, known)}"])
    found = importlib.import_module(f"{dialects.__name__}.{name}").DIALECT
    if not isinstance(found, Dialect) or found.name != name:
        raise TypeError(f"dialects/{name}.py: DIALECT should be a Dialect called '{name}'")
    return found


def dialect_names() -> tuple[str, ...]:
    """Every dialect there is, sorted."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(dialects.__path__)))
