"""A solid, placed mesh becomes layers and a toolpath: the whole of slicing in one call."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter

from trunnion_core.findings import Finding
from trunnion_core.layers import Layer, LayerStack
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath

from trunnion_slicer.assemble import to_toolpath
from trunnion_slicer.planar import planar_layers


@dataclass(frozen=True, eq=False)
class SliceResult:
    """What slicing made of a mesh."""

    stack: LayerStack
    toolpath: Toolpath
    findings: tuple[Finding, ...]
    timings: Mapping[str, float] = field(default_factory=dict)
    """Seconds of every stage, in the order of the work."""


def slice_mesh(mesh: Mesh, settings: PrintSettings) -> SliceResult:
    """Layers and toolpath of `mesh`, a solid that stands on z = 0 where it is to be printed.

    Raises MeshError or PlacementError for a part that cannot be sliced, SettingsError for an unknown pattern.
    """
    clock = _Clock()
    findings: tuple[Finding, ...] = ()
    layers: list[Layer] = planar_layers(mesh, settings)
    clock.lap("planar")
    stack = LayerStack(tuple(layers))
    toolpath = to_toolpath(stack, settings)
    clock.lap("toolpath")
    return SliceResult(stack, toolpath, findings, clock.laps)


class _Clock:
    """Seconds since the last lap, by name."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, name: str) -> None:
        now = perf_counter()
        self.laps[name] = now - self._last
        self._last = now
