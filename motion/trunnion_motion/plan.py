"""Turn a toolpath into the program of one machine: joints, times and filament, row by row.

One continuous way through the joint solutions is chosen, rows are subdivided so that the tip stays on its chords,
hops lead over the part where the machine must turn, filament follows from the path in the part, retractions bracket the
travels, and the time law gives every row what the slowest joint allows. Where the firmware has no pressure advance for
such motion, the filament carries it.
"""

from dataclasses import dataclass, replace

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import UnreachableError
from trunnion_core.findings import Finding
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.advance import words_carry_advance
from trunnion_gcode.dialect import find_dialect
from trunnion_gcode.moves import make_moves
from trunnion_kinematics.branches import PathChoice, choose
from trunnion_kinematics.chain import JointChain
from trunnion_motion.advance import with_advance
from trunnion_motion.events import events_for
from trunnion_motion.executed import executed
from trunnion_motion.flow import filament_per_row, share
from trunnion_motion.flow_window import flow_findings, tip_window
from trunnion_motion.hop import Machine
from trunnion_motion.path import assemble
from trunnion_motion.retraction import with_retractions
from trunnion_motion.rows import Rows
from trunnion_motion.timelaw import STILL_TIP, TimeLaw, time_law


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A program, what is worth saying about it, and the poses that its joints make."""

    program: MachineProgram
    findings: tuple[Finding, ...]
    tip_points: FloatArray
    """(n, 3) mm, part: the tip at the end of every row of the program."""
    tool_axes: FloatArray
    """(n, 3) unit, part."""
    law: TimeLaw
    """How the rows' durations come about."""


def plan(toolpath: Toolpath, profile: MachineProfile, settings: PrintSettings) -> MachineProgram:
    """The program alone; see `plan_motion`."""
    return plan_motion(toolpath, profile, settings).program


def plan_motion(toolpath: Toolpath, profile: MachineProfile, settings: PrintSettings) -> PlanResult:
    """The toolpath as motion of this machine, from its home values to a lift above the part.

    Rows of the program that end a row of the toolpath (the last with its `source`) make exactly the toolpath's point,
    and its tool axis within `nonplanar_axis_tolerance`. Rows with source -1 are motion's own: the way from home, hops,
    retract, prime, the last lift. An empty toolpath gives an empty program. Raises UnreachableError with row, layer,
    point, tool axis and joint where the machine cannot follow, a machine without rotaries and a tilted tool included.
    """
    chain = JointChain.from_profile(profile)
    home = profile.array("home")
    findings: tuple[Finding, ...] = ()
    if not len(toolpath):
        rows = _no_rows(len(home))
    else:
        choice = _chosen(toolpath, profile, settings, chain, home)
        rows, findings = assemble(toolpath, Machine.of(profile, chain), choice, settings, home)
        feed = filament_per_row(toolpath, profile.filament_diameter, settings.extrusion_multiplier)
        rows = replace(rows, filament=share(feed, rows.points, rows.source))
        rows = with_retractions(rows, settings.retract_length)
        _, fastest = tip_window(rows.width, rows.height, profile, settings.extrusion_multiplier)
        rows = replace(rows, tip_speed=np.minimum(rows.tip_speed, fastest))

    home_tip = chain.forward(home[None])[0]
    tip_length = rows.tip_lengths(home_tip[0])
    asked, ideal = _timed(rows, tip_length, profile, settings, home)
    program = MachineProgram(
        start=home,
        joints=rows.joints,
        duration=asked,
        filament=rows.filament,
        role=rows.role,
        layer=rows.layer,
        width=rows.width,
        height=rows.height,
        tip_speed=rows.tip_speed,
        tip_length=tip_length,
        source=rows.source,
        events=events_for(rows.layer, profile, settings),
        cruise=asked,
        tip=np.concatenate([home_tip, rows.points]),
    )
    dialect = find_dialect(profile.firmware, profile.file)
    done = executed(program, ideal, profile, dialect)
    points, axes, nominal = rows.points, rows.tool_axes, program.filament
    if profile.extruder.pressure_advance > 0 and words_carry_advance(
        make_moves(program, profile, dialect), profile, dialect
    ):
        if not dialect.advance_in_ramps:
            # The firmware's own, which is turned off, slows ramps down.
            done = executed(replace(program, advance=profile.extruder.pressure_advance), ideal, profile, dialect)
        advanced = with_advance(program, ideal, done, rows.tool_axes, profile, dialect)
        program, done, nominal = advanced.program, advanced.execution, advanced.nominal
        points, axes = advanced.tip_points, advanced.tool_axes
    law = done.law
    program = replace(program, duration=law.duration, cruise=done.asked)
    findings = (*findings, *flow_findings(replace(program, filament=nominal), law, points, profile))
    return PlanResult(program, findings, points, axes, law)


def _chosen(
    toolpath: Toolpath, profile: MachineProfile, settings: PrintSettings, chain: JointChain, home: FloatArray
) -> PathChoice:
    try:
        return choose(
            chain,
            profile,
            toolpath.points,
            toolpath.tool_axes,
            travel=toolpath.role == Role.TRAVEL,
            axis_tolerance=float(np.radians(settings.nonplanar_axis_tolerance)),
            start=home,
            speed=toolpath.speed,
        )
    except UnreachableError as error:
        layer = int(toolpath.layer[error.row])
        raise UnreachableError(
            error.row, error.point, error.tool_axis, error.joint, error.reason, layer=layer
        ) from None


def _timed(
    rows: Rows, tip_length: FloatArray, profile: MachineProfile, settings: PrintSettings, home: FloatArray
) -> tuple[FloatArray, TimeLaw]:
    """(n,) s that each row takes at the wanted speed or what its joints can go, and what the machine could do."""
    extruder, planner = profile.extruder, profile.planner
    wanted = np.where(rows.tip_speed > 0, rows.tip_speed, np.inf)
    filament_only = (rows.role == Role.RETRACT) | (rows.role == Role.PRIME)
    still = (tip_length <= 0) & ~filament_only
    wanted = np.where(filament_only, min(settings.retract_speed / extruder.speed, 1.0), wanted)
    wanted = np.where(still, np.inf, wanted)
    printing = np.inf if planner.acceleration is None else planner.acceleration
    travelling = printing if planner.travel_acceleration is None else planner.travel_acceleration
    steps = rows.steps(home)
    speed = np.append(profile.array("speed"), extruder.speed)
    slowest_joint = (np.abs(steps) / speed).max(axis=1)
    asked = np.maximum(slowest_joint, np.where(tip_length > STILL_TIP, tip_length, slowest_joint) / wanted)
    ideal = time_law(
        steps,
        tip_length,
        wanted,
        speed,
        np.append(profile.array("acceleration"), extruder.acceleration),
        np.append(profile.array("corner_speed"), extruder.corner_speed),
        path_acceleration=np.where(rows.width > 0, printing, travelling),
        linear=np.array([not joint.rotary for joint in profile.joints] + [False]),
        junction_deviation=planner.junction_deviation or 0.0,
    )
    return asked, ideal


def _no_rows(k: int) -> Rows:
    none, whole = np.zeros(0), np.zeros(0, dtype=np.int64)
    poses = np.zeros((0, 3))
    return Rows(np.zeros((0, k)), poses, poses, whole, whole, whole, none, none, none, none)
