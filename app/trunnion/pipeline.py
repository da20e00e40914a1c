"""The main job as functions: a mesh file becomes a placed part, a toolpath, a machine program, lines of G-code.

Each step takes what the step before returned, so a laboratory can stop, look or replace at any of them.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.findings import Finding
from trunnion_core.mesh import Mesh
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.write import WriteSummary, write_program
from trunnion_motion.plan import plan_motion
from trunnion_slicer.mesh_io import load_mesh
from trunnion_slicer.nonplanar.head import head_of
from trunnion_slicer.placement import place
from trunnion_slicer.repair import make_solid
from trunnion_slicer.slice import slice_mesh


@dataclass
class Timings:
    """Seconds of wall time of every stage, in the order they ran."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block under that name."""
        started = perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - started


@dataclass(frozen=True, eq=False)
class Part:
    """A solid mesh, placed: `mesh` is in the part frame; `shift` (3,) mm was added to the turned file's."""

    name: str
    mesh: Mesh
    shift: FloatArray
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class Job:
    """A part, ready for one machine."""

    part: Part
    profile: MachineProfile
    settings: PrintSettings
    toolpath: Toolpath
    program: MachineProgram
    findings: tuple[Finding, ...]


def load_part(path: Path, profile: MachineProfile, settings: PrintSettings, timings: Timings | None = None) -> Part:
    """Read a mesh file, make it solid and place it on the bed. Raises MeshError or PlacementError."""
    timings = timings or Timings()
    with timings.stage("read"):
        loaded = load_mesh(path)
    return solid_part(path.stem, loaded.mesh, profile, settings, timings, loaded.findings)


def solid_part(
    name: str,
    mesh: Mesh,
    profile: MachineProfile,
    settings: PrintSettings,
    timings: Timings | None = None,
    findings: tuple[Finding, ...] = (),
) -> Part:
    """Make a mesh solid and place it on the bed. Raises MeshError or PlacementError."""
    timings = timings or Timings()
    with timings.stage("repair"):
        solid, repairs = make_solid(mesh)
    with timings.stage("place"):
        placed, shift = place(solid, profile, settings)
    return Part(name, placed, shift, (*findings, *repairs))


def make_job(part: Part, profile: MachineProfile, settings: PrintSettings, timings: Timings | None = None) -> Job:
    """Slice a part and plan its motion on the machine. Raises UnreachableError, SettingsError or MeshError."""
    timings = timings or Timings()
    settings = settings_for(profile, settings)
    sliced = slice_mesh(part.mesh, settings, head_of(profile))
    timings.seconds.update(sliced.timings)
    with timings.stage("motion"):
        planned = plan_motion(sliced.toolpath, profile, settings)
    findings = (*part.findings, *sliced.findings, *planned.findings)
    return Job(part, profile, settings, sliced.toolpath, planned.program, findings)


def settings_for(profile: MachineProfile, settings: PrintSettings) -> PrintSettings:
    """The settings as this machine can follow them: without rotary joints the tool stays vertical."""
    if profile.rotary:
        return settings
    return settings.model_copy(update={"nonplanar_tool_axis": "vertical"})


def write_job(job: Job, out: Path, timings: Timings | None = None) -> WriteSummary:
    """Write the program as G-code; the file appears whole or not at all."""
    timings = timings or Timings()
    with timings.stage("write"):
        dx, dy, dz = (float(value) for value in job.part.shift)
        return write_program(
            job.program,
            job.profile,
            job.settings,
            title=job.part.name,
            out=out,
            placement=(dx, dy, dz),
            layer_z=layer_tops(job.toolpath),
        )


def layer_tops(toolpath: Toolpath) -> dict[int, float]:
    """Highest z in mm of the beads of every layer."""
    rows = toolpath.extrudes
    tops = np.full(int(toolpath.layer.max(initial=-1)) + 1, -np.inf)
    np.maximum.at(tops, toolpath.layer[rows], toolpath.points[rows, 2])
    return {layer: top for layer, top in enumerate(tops.tolist()) if top > -np.inf}
