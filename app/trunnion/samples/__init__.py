"""The sample parts by name. A part is a file here that exposes `make() -> Mesh` and `SETTINGS`; nothing to register."""

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trunnion_core.mesh import Mesh

COMMON: dict[str, Any] = {"layer_height": 0.3, "extrusion_width": 0.4}
"""What all samples are printed with: the layer and bead of Shahid 2024 (arXiv 2411.07225)."""


def names() -> tuple[str, ...]:
    """Every sample, sorted."""
    return tuple(sorted(module.name for module in iter_modules(__path__) if not module.name.startswith("_")))


def make(name: str) -> "Mesh":
    """The sample's mesh: closed, flat on z = 0, mm. ValueError for an unknown name."""
    mesh: Mesh = _module(name).make()
    return mesh


def settings(name: str) -> dict[str, Any]:
    """Print settings that the sample is meant for, as keys and values. ValueError for an unknown name."""
    own: dict[str, Any] = _module(name).SETTINGS
    return COMMON | own


def _module(name: str) -> ModuleType:
    if name not in names():
        raise ValueError(f"no sample is called '{name}'; there are: {', '.join(names())}")
    return import_module(f"{__name__}.{name}")
