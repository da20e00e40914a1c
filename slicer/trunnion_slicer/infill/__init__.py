"""Infill patterns: the name in `fill_pattern` is the name of a file here, which exposes `fill`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from trunnion_core.errors import SettingsError
from trunnion_core.validation import nearest

if TYPE_CHECKING:
    from shapely.geometry import MultiPolygon

    from trunnion_core.arrays import FloatArray

    Fill = Callable[..., list[FloatArray]]


def fill(pattern: str, region: MultiPolygon, spacing: float, angle: float, *, fit: bool = True) -> list[FloatArray]:
    """Centre lines (n, 2) mm that fill `region`, each one unbroken bead.

    `region` is where centre lines may lie (already inset by half a bead). `spacing` in mm is the distance of
    neighbouring lines, `angle` in rad their direction from +X. With `fit` every island gets a whole number of lines
    from edge to edge, their distance as near to `spacing` as that allows; without, lines lie on multiples of
    `spacing` from the origin, the same on every layer. Raises SettingsError for an unknown pattern.
    """
    require(pattern)
    lay: Fill = import_module(f"{__name__}.{pattern}").fill
    return lay(region, spacing, angle, fit=fit)


def require(pattern: str) -> None:
    """Raise SettingsError, which names the nearest, unless there is such a pattern."""
    if pattern not in patterns():
        raise SettingsError("settings", [f"fill_pattern: '{pattern}' is unknown, {nearest(pattern, patterns())}"])


def patterns() -> list[str]:
    """Every pattern there is, sorted."""
    return sorted(file.stem for file in Path(__file__).parent.glob("*.py") if not file.stem.startswith("_"))
