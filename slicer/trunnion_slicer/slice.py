"""A solid, placed mesh becomes layers and a toolpath: the whole of slicing in one call."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter

from trunnion_core.findings import Finding
from trunnion_core.layers import LayerStack
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings
from trunnion_core.solid_tables import SolidTable
from trunnion_core.toolpath import Toolpath
from trunnion_slicer.assemble import to_toolpath
from trunnion_slicer.nonplanar.plan import plan_nonplanar
from trunnion_slicer.planar import plan_planar


@dataclass(frozen=True, eq=False)
class SliceResult:
    """What slicing made of a mesh."""

    stack: LayerStack
    """Planar layers from the bed up, then non-planar layers from the lowest up."""
    toolpath: Toolpath
    findings: tuple[Finding, ...]
    timings: Mapping[str, float]
    """Seconds of every stage, in the order of the work."""


def slice_mesh(mesh: Mesh, settings: PrintSettings, head: Sequence[SolidTable] = ()) -> SliceResult:
    """Layers and toolpath of `mesh`, a closed solid that stands on z = 0 where it is to be printed.

    The space of the non-planar layers, if any, is taken out of the part first; what is left is sliced planar and
    printed before them. `head` is what carries the nozzle (convex bodies in the tool frame, mm): skin that it cannot
    be over without entering the part stays planar. Raises MeshError or PlacementError for a part that cannot be sliced,
    SettingsError for an unknown infill pattern.
    """
    clock = _Clock()
    plan = plan_nonplanar(mesh, settings, head, clock.lap)
    clock.lap("nonplanar")
    planar = plan_planar(mesh, settings) if plan is None else plan.planar
    clock.lap("planar")
    stack = LayerStack(planar.layers + (() if plan is None else plan.layers))
    findings = planar.findings + (() if plan is None else plan.findings)
    toolpath = to_toolpath(stack, settings)
    clock.lap("toolpath")
    return SliceResult(stack, toolpath, findings, clock.laps)


class _Clock:
    """Seconds between laps, by name."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, name: str) -> None:
        now = perf_counter()
        self.laps[name] = self.laps.get(name, 0.0) + now - self._last
        self._last = now
