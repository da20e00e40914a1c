"""What one particular machine does: joint values, times and filament, row by row."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray, check_array, freeze

EventKind = Literal["nozzle_temperature", "bed_temperature", "wait_nozzle", "wait_bed", "fan", "layer", "pause"]


@dataclass(frozen=True)
class Event:
    """Something that happens just before `row` is executed; `value` in °C, fan duty 0 to 1, or a layer number."""

    row: int
    kind: EventKind
    value: float = 0.0


@dataclass(frozen=True, eq=False)
class MachineProgram:
    """Joint motion of one machine. Row i goes from joints[i-1] (row 0: from `start`) to joints[i], linear in joints."""

    start: FloatArray
    """(k,) mm or rad: where the joints stand before row 0."""
    joints: FloatArray
    """(n, k) mm or rad, in profile order."""
    duration: FloatArray
    """(n,) s that the row takes, as planned."""
    filament: FloatArray
    """(n,) mm of filament fed during the row; negative where it is retracted."""
    role: IntArray
    """(n,) values of `Role`; RETRACT and PRIME rows may stand still."""
    layer: IntArray
    """(n,)."""
    width: FloatArray
    """(n,) mm, 0 where no bead is laid."""
    height: FloatArray
    """(n,) mm, 0 where no bead is laid."""
    tip_speed: FloatArray
    """(n,) mm/s wanted of the tip over the part, from the toolpath; `duration` says what the axes allow."""
    tip_length: FloatArray
    """(n,) mm that the tip moves over the part during the row."""
    source: IntArray
    """(n,) row of the toolpath whose motion this is a part of; -1 for what motion inserted."""
    events: tuple[Event, ...] = field(default=())
    cruise: FloatArray = field(default_factory=lambda: np.zeros(0))
    """(n,) s that the row would take at the speed asked of a firmware that makes its own ramps: feed words come from
    this, the time of the print from `duration`. Empty where nobody worked it out."""
    tip: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    """(n + 1, 3) mm, `part`: the tip at `start` and at the end of every row, for firmware that is told tips instead of
    joints. Empty where nobody worked it out."""
    advance: float = 0.0
    """s of pressure advance that `filament` carries itself; 0 where it is left to the firmware, or there is none."""

    def __post_init__(self) -> None:
        n, k = self.joints.shape
        check_array("joints", self.joints, (n, k))
        check_array("start", self.start, (k,))
        per_row = (
            "duration",
            "filament",
            "role",
            "layer",
            "width",
            "height",
            "tip_speed",
            "tip_length",
            "source",
        )
        for name in per_row:
            check_array(name, getattr(self, name), (n,))
        if self.cruise.size:
            check_array("cruise", self.cruise, (n,))
        if self.tip.size:
            check_array("tip", self.tip, (n + 1, 3))
        if not self.advance >= 0:
            raise ValueError(f"advance: is {self.advance}, should be 0 or more seconds")
        if n and self.duration.min() < 0:
            raise ValueError(f"duration: row {int(self.duration.argmin())} is negative")
        freeze(self.joints, self.start, self.cruise, self.tip, *(getattr(self, name) for name in per_row))

    def __len__(self) -> int:
        return len(self.joints)
