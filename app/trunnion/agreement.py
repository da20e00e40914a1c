"""How far the plan agrees with what the judge's firmware makes of the file: tip speed along the path, and time.

The plan is motion's time law; the other side is the written file, read and replayed by the simulator, which shares no
code with it and turns joints into tips with its own chain.
"""

import dataclasses
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.settings import PrintSettings
from trunnion_gcode.dialect import find_dialect
from trunnion_gcode.moves import make_moves
from trunnion_gcode.write import write_program
from trunnion_motion.plan import PlanResult
from trunnion_motion.timelaw import TimeLaw
from trunnion_sim.context import Context
from trunnion_sim.judge import context_of

SAMPLES = 8
"""Places in every move at which speeds are compared."""
STILL = 1e-6
"""mm: moves whose tip stays have no tip speed."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """Planned against replayed, over the moves of the file."""

    planned: FloatArray
    """(m, SAMPLES) mm/s of the tip over the part; 0 where the tip stays."""
    replayed: FloatArray
    """(m, SAMPLES) mm/s."""
    weight: FloatArray
    """(m,) mm of tip path."""
    planned_time: float
    """s."""
    replayed_time: float
    """s, homing and heating left out."""
    joint_speed: FloatArray
    """(k,) highest share of its rated speed that each joint reaches in the replay."""

    def share_within(self, tolerance: float) -> float:
        """Share of the path's length on which the tip is within that relative tolerance of the planned speed."""
        close = np.abs(self.replayed - self.planned) <= tolerance * self.planned
        total = float(self.weight.sum())
        return float((self.weight[:, None] * close).sum() / (SAMPLES * total)) if total > 0 else 1.0

    @property
    def time_ratio(self) -> float:
        """Replayed over planned time."""
        return self.replayed_time / self.planned_time if self.planned_time > 0 else 1.0


def agreement(plan: PlanResult, profile: MachineProfile, settings: PrintSettings) -> Agreement:
    """Write the program, replay it under the rules of the profile's firmware, and compare. Raises as those do."""
    program = plan.program
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "program.gcode"
        write_program(program, profile, settings, title="agreement", out=file)
        context = context_of(file, profile)
    moves = make_moves(program, profile, find_dialect(profile.firmware, profile.file))
    rows, first, count = _rows_of_moves(context, len(moves.row))
    fraction = (np.arange(SAMPLES) + 0.5) / SAMPLES
    piece = np.minimum((fraction * count[:, None]).astype(np.int64), count[:, None] - 1)
    replayed = _replayed(context, rows[first[:, None] + piece], fraction * count[:, None] - piece)
    planned, length = _planned(plan.law, program.tip_length, moves.row, fraction)
    replay = context.replay
    driven = np.abs(context.motion.joints - context.motion.before)[rows]
    speed = (
        driven
        * np.divide(replay.cruise, replay.length, out=np.zeros_like(replay.cruise), where=replay.length > 0)[rows, None]
    )
    return Agreement(
        planned=planned,
        replayed=np.where(length[:, None] > STILL, replayed, 0.0),
        weight=np.where(length > STILL, length, 0.0),
        planned_time=float(program.duration.sum()),
        replayed_time=float(replay.end[rows[-1]] - replay.begin[rows[0]]) if len(rows) else 0.0,
        joint_speed=np.max(speed / profile.array("speed"), axis=0, initial=0.0),
    )


def _rows_of_moves(context: Context, moves: int) -> tuple[IntArray, IntArray, IntArray]:
    """Rows of the replay (m,), and which of them is each move's first and how many it has, both (moves,).

    The judge cuts long turns of tip words into even pieces.
    """
    rows = np.flatnonzero(~context.homing)
    first = np.flatnonzero(np.diff(context.motion.line[rows], prepend=-1))
    end = int(first[moves]) if len(first) > moves else len(rows)
    first = first[:moves]
    return rows[:end], first, np.diff(np.append(first, end))


def on_firmware(profile: MachineProfile, firmware: str) -> MachineProfile:
    """The same machine with other firmware."""
    return dataclasses.replace(profile, firmware=firmware)


def _replayed(context: Context, rows: IntArray, fraction: FloatArray) -> FloatArray:
    """(m, SAMPLES) mm/s of the tip at fractions of the rows, both (m, SAMPLES)."""
    replay = context.replay
    entry, cruise, leave, a, d = (
        value[rows] for value in (replay.entry, replay.cruise, replay.exit, replay.acceleration, replay.length)
    )
    way = fraction * d
    speed = np.minimum(np.sqrt(entry**2 + 2 * a * way), np.sqrt(leave**2 + 2 * a * (d - way)))
    per_length = np.divide(context.tip_length[rows], d, out=np.zeros_like(d), where=d > 0)
    return np.asarray(np.minimum(speed, cruise) * per_length)


def _planned(
    law: TimeLaw, tip_length: FloatArray, last: IntArray, fraction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(m, SAMPLES) mm/s of the tip at fractions of the moves that end program rows `last`, and (m,) mm of each."""
    ends = np.concatenate([[0.0], np.cumsum(tip_length)])
    begin = ends[np.concatenate([[0], last[:-1] + 1])]
    length = ends[last + 1] - begin
    at = begin[:, None] + fraction * length[:, None]
    row = np.clip(np.searchsorted(ends, at, side="right") - 1, 0, len(tip_length) - 1)
    inside = np.clip((at - ends[row]) / np.maximum(tip_length[row], STILL), 0.0, 1.0)
    speed = _speed(law, row, inside)
    scale = np.divide(tip_length, law.length, out=np.zeros_like(tip_length), where=law.length > 0)
    return np.where(length[:, None] > STILL, speed * scale[row], 0.0), length


def _speed(law: TimeLaw, row: IntArray, fraction: FloatArray) -> FloatArray:
    """Speed of the law's rows at fractions of their lengths, all three of one shape."""
    entry, peak, leave = law.entry[row], law.peak[row], law.leave[row]
    ramp, length = law.acceleration[row], law.length[row]
    rising = np.sqrt(entry**2 + 2 * ramp * fraction * length)
    falling = np.sqrt(leave**2 + 2 * ramp * (1 - fraction) * length)
    return np.asarray(np.minimum(np.minimum(rising, falling), peak))
