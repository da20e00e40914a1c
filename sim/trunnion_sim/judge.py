"""A program and a machine become a report: read, execute, replay, check, and compare the surface with the model."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.errors import GcodeError
from trunnion_core.findings import Finding
from trunnion_core.mesh import Mesh
from trunnion_core.profile import MachineProfile
from trunnion_core.trace import Trace
from trunnion_sim.chain import forward
from trunnion_sim.context import Context, LineOddities
from trunnion_sim.limits import limits_of
from trunnion_sim.motion import Motion, interpret
from trunnion_sim.notes import Notes, row_notes
from trunnion_sim.reader import Block, Reader
from trunnion_sim.registry import run_checks
from trunnion_sim.replay import replay
from trunnion_sim.report import JointUse, Report, SurfaceReport
from trunnion_sim.rules import find_rules
from trunnion_sim.surface.compare import compare

SEVERITIES = ("error", "warning", "note")
CELLS_ACROSS = 12.0
"""Cells of the height field across a bead for comparison with the model."""
MARGIN = 2.0
"""mm of field around the model."""


def judge(
    program: Path, profile: MachineProfile, *, model: Mesh | None = None, max_angle_deg: float | None = None
) -> Report:
    """Dry-run a G-code file on a machine.

    `model` is the mesh in `part` as it was placed for slicing; with it, what the beads leave behind is compared with
    its facets up to `max_angle_deg` from horizontal (by default the angle whose tangent is layer height over bead
    width, from the program's comments). Raises GcodeError where the file cannot be read, is empty, or holds no
    command at all; ProfileError where the firmware is unknown. Everything else is a finding.
    """
    context = context_of(program, profile)
    findings = sorted(run_checks(context), key=lambda found: (SEVERITIES.index(found.severity), found.line or 0))
    surface = None if model is None else surface_of(context, model, max_angle_deg)
    return _report(context, tuple(findings), surface)


def context_of(program: Path, profile: MachineProfile) -> Context:
    """Read and replay a program: everything the checks look at."""
    rules = find_rules(profile.firmware, profile.file)
    reader = Reader(program)
    notes = Notes()
    oddities = _Oddities()
    motion = interpret(oddities.watch(notes.watch(reader)), profile, rules)
    if not motion.code_count and not oddities.lines:
        raise GcodeError(f"{program}: {reader.end.lines} lines hold no command, should be a G-code program")
    if not motion.code_count:
        raise GcodeError(f"{program}: no line holds a G, M or T command, should be a G-code program")
    limits = limits_of(motion, profile, rules.slowest)
    replayed = replay(motion, profile, rules, limits)  # needs the most memory on its way, so it comes first
    tips, axes = forward(profile, motion.path)
    return Context(
        profile=profile,
        rules=rules,
        motion=motion,
        notes=notes,
        rows=row_notes(notes, motion.line),
        limits=limits,
        replay=replayed,
        tips=tips,
        axes=axes,
        oddities=oddities.result(),
        end=reader.end,
    )


def surface_of(
    context: Context, model: Mesh, max_angle_deg: float | None = None, cell: float | None = None
) -> SurfaceReport | None:
    """What the beads leave behind, compared with the model; see `surface.compare`.

    The height field has CELLS_ACROSS cells across a bead, or cells of `cell` mm. None where nothing is laid, or where
    no visible facet is flat enough.
    """
    height, width = context.layer_height, context.bead_width
    low, high = model.bounds[:, :2]
    deposit = context.lay_down(cell or width / CELLS_ACROSS, (low - MARGIN, high + MARGIN))
    if deposit is None:
        return None
    angle = math.degrees(math.atan2(height, width)) if max_angle_deg is None else max_angle_deg
    return compare(deposit.field, model, angle, height)


class _Oddities:
    """Keeps what the reader flagged while the blocks pass through."""

    MOST = 100_000
    """Odd lines kept; a file with more is no program anyway."""

    def __init__(self) -> None:
        self.lines: list[int] = []
        self._flags: list[int] = []
        self._length: list[int] = []
        self._longest = (0, 0)
        self._letters: dict[str, int] = {}

    def watch(self, blocks: Iterable[Block]) -> Iterator[Block]:
        for block in blocks:
            odd = np.flatnonzero(block.flags != 0)[: max(0, self.MOST - len(self.lines))]
            self.lines += block.line[odd].tolist()
            self._flags += block.flags[odd].tolist()
            self._length += block.length[odd].tolist()
            if len(block.length):
                longest = int(block.length.argmax())
                if block.length[longest] > self._longest[1]:
                    self._longest = (int(block.line[longest]), int(block.length[longest]))
            moves = (block.letter == ord("G")) & (block.code >= 0) & (block.code <= 30)
            of_move = np.repeat(moves, np.diff(block.word_start))
            letters, first = np.unique(block.word_letter[of_move], return_index=True)
            owner = np.repeat(block.line, np.diff(block.word_start))[of_move]
            for letter, at in zip(letters.tolist(), first.tolist(), strict=True):
                self._letters.setdefault(chr(letter), int(owner[at]))
            yield block

    def result(self) -> LineOddities:
        return LineOddities(
            np.array(self.lines, np.int64),
            np.array(self._flags, np.int64),
            np.array(self._length, np.int64),
            self._longest,
            self._letters,
        )


def _report(context: Context, findings: tuple[Finding, ...], surface: SurfaceReport | None) -> Report:
    motion, replayed, profile = context.motion, context.replay, context.profile
    volume = context.laid * profile.filament_area
    trace = Trace(motion.line, motion.joints, context.points, context.tool_axes, volume, replayed.end)
    moving = context.feeds & (replayed.duration > 0)
    flow = np.divide(volume * replayed.cruise, replayed.length, out=np.zeros(len(volume)), where=replayed.length > 0)
    return Report(
        findings=findings,
        trace=trace,
        time=replayed.time,
        filament=float(motion.filament.sum()),
        volume=float(motion.filament.sum() * profile.filament_area),
        joints=_joint_use(motion, context, profile),
        tip_speed=_tip_speed(context, moving),
        flow={
            "p50": _percentile(flow[moving], replayed.duration[moving], 50) or 0.0,
            "max": float(flow[moving].max(initial=0.0)),
        },
        role=context.rows.role,
        width=context.stadium_width,
        surface=surface,
        clearance=context.hits.clearance if math.isfinite(context.hits.clearance) else None,
    )


def _joint_use(motion: Motion, context: Context, profile: MachineProfile) -> dict[str, JointUse]:
    replayed = context.replay
    counts = (replayed.length > 0) & ~context.homing
    use = {}
    for k, joint in enumerate(profile.joints):
        way = np.abs(np.diff(motion.path[:, k]))
        per_length = np.divide(way, replayed.length, out=np.zeros(len(way)), where=counts)
        value = motion.joints[:, k] if len(motion) else np.zeros(1)
        use[joint.letter] = JointUse(
            min=joint.shown(float(value.min())),
            max=joint.shown(float(value.max())),
            peak_speed=joint.shown(float((per_length * replayed.cruise).max(initial=0.0))),
            peak_acceleration=joint.shown(float((per_length * replayed.acceleration).max(initial=0.0))),
        )
    return use


def _tip_speed(context: Context, moving: BoolArray) -> dict[str, float | None]:
    """Percentiles of tip speed over wanted speed, weighted by time."""
    wanted = context.rows.speed
    rows = moving & np.isfinite(wanted) & (wanted > 0)
    ratio = context.tip_length[rows] / context.replay.duration[rows] / wanted[rows]
    weight = context.replay.duration[rows]
    return {f"wanted_ratio_p{p:02d}": _percentile(ratio, weight, p) for p in (1, 50, 99)}


def _percentile(values: FloatArray, weights: FloatArray, percent: float) -> float | None:
    """Weighted percentile; None of nothing."""
    if not len(values):
        return None
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(share, percent / 100 * share[-1])])
