"""What leaves the nozzle, behind what the program and the firmware push: first-order lag of pressure.

Filament in excess of what has come out is under pressure, and flow follows pressure: K dq/dt + q = pushed. K belongs to
the plastic and its hot end, and only the program can tell it, in its header (`; plastic advance [s] = 0.045`). What it
sets the firmware's own advance to is not taken for it: a program that does not tell is taken at its words.

The firmware's own advance adds K times the speed of the filament in the rows where it applies any (`Rules`); programs
may carry it in their words instead. Either makes up for the lag, both are too much, and none leaves too little where
speed rises and too much where it falls. Left out: Klipper's smoothing of its advance over 40 ms, and how hard a real
drive can be pushed.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile
from trunnion_sim import pressure_kernel as kernel
from trunnion_sim.advance import own_advance
from trunnion_sim.motion import Motion
from trunnion_sim.replay import Replay
from trunnion_sim.rules import Rules

PLASTIC = "plastic advance [s]"
"""Key of the header comment that tells K of the plastic."""
BETWEEN = {"at once": kernel.AT_ONCE, "held": kernel.HELD, "ramps": kernel.RAMPS}


_Terms = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""Filament per length, entry, cruise, exit, acceleration, begin, duration, K of the plastic, K of the firmware."""


@dataclass(frozen=True, eq=False)
class Pressure:
    """Flow out of the nozzle. Rows are those of the motion."""

    phases: FloatArray
    """(n, 3) mm of filament that leave the nozzle while the row speeds up, cruises and brakes; never negative."""
    _terms: "_Terms"
    _before: FloatArray

    @property
    def laid(self) -> FloatArray:
        """(n,) mm of filament that leave the nozzle while the row is executed."""
        return np.asarray(self.phases.sum(axis=1))

    def flow_at(self, replay: Replay, times: FloatArray) -> FloatArray:
        """(m,) mm/s of filament that leave the nozzle at `times` (m,) s."""
        row = np.clip(np.searchsorted(replay.begin, times, side="right") - 1, 0, max(0, len(replay.begin) - 1))
        return np.asarray(kernel.flow_at(times, row, *self._terms, self._before))


def pressure(
    motion: Motion, replay: Replay, profile: MachineProfile, rules: Rules, header: dict[str, str]
) -> Pressure | None:
    """The flow of a program whose K is known, or None. Linear in the rows, about ten million a second."""
    seconds = _lag(header)
    if seconds <= 0 or not len(motion):
        return None
    lag = np.full(len(motion), seconds)
    ahead = own_advance(motion, profile, rules)
    per_length = np.divide(motion.filament, replay.length, out=np.zeros(len(motion)), where=replay.length > 0)
    ramp = np.where(replay.acceleration > 0, replay.acceleration, 1.0)
    terms = (
        per_length,
        replay.entry,
        replay.cruise,
        replay.exit,
        ramp,
        replay.begin,
        replay.duration,
        lag,
        ahead,
    )
    phases, before = kernel.run(*terms, BETWEEN[rules.advance])
    return Pressure(phases, terms, before)


def phase_shares(replay: Replay) -> FloatArray:
    """(n, 3) of the way of every row, 0 to 1: while it speeds up, cruises and brakes."""
    twice = np.where(replay.acceleration > 0, 2 * replay.acceleration, 1.0)
    up, down = (replay.cruise**2 - replay.entry**2) / twice, (replay.cruise**2 - replay.exit**2) / twice
    ways = np.column_stack([up, np.maximum(replay.length - up - down, 0.0), down])
    total = ways.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(ways, total, out=np.full(ways.shape, 1 / 3), where=total > 0))


def _lag(header: dict[str, str]) -> float:
    """s of K of the plastic; 0 where the header does not tell it."""
    try:
        told = float(header.get(PLASTIC, ""))
    except ValueError:
        return 0.0
    return told if 0 < told < np.inf else 0.0
