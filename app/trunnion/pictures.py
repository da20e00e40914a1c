"""Pictures of a job, as PNG: the toolpath coloured by role, the surface's deviation, the joints over time."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.profile import MachineProfile
from trunnion_core.roles import Role
from trunnion_core.toolpath import Toolpath
from trunnion_core.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROLE_COLOURS = {
    Role.SKIRT: "#8a8a8a",
    Role.OUTER_WALL: "#e07b39",
    Role.INNER_WALL: "#f2b84b",
    Role.INFILL: "#7d5ba6",
    Role.SOLID_INFILL: "#4f6db8",
    Role.TOP_SOLID_INFILL: "#3aa17e",
    Role.NONPLANAR_OUTER_WALL: "#c2185b",
    Role.NONPLANAR_INNER_WALL: "#e75a8d",
    Role.NONPLANAR_INFILL: "#d7263d",
}
"""Warm for walls, cool for planar infill, reds for what is not planar."""

VIEW_AZIMUTH = np.radians(-55.0)
VIEW_ELEVATION = np.radians(35.0)
PIXELS_PER_INCH = 130
PIECE = 0.5
"""mm of a bead that is drawn as one stroke: shorter than anything that hides it is wide."""
DEVIATION_RANGE = 0.2
"""mm at the ends of the colour scale: two thirds of a coarse layer, so that stairs saturate and grooves show."""
DEVIATION_CELL = 0.1
"""mm of the grid on which deviation samples are averaged for the picture."""


def draw_toolpath(toolpath: Toolpath, path: Path, title: str) -> None:
    """Orthographic view of every bead, far ones first, as wide as they are, coloured by role."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    rows, begin, end = _pieces(toolpath)
    start, near = _project(begin)
    stop, far = _project(end)
    segments = np.stack([start, stop], axis=1)
    order = np.argsort(near + far, kind="stable")
    roles = toolpath.role[rows]
    colours = _role_colours(roles, end - begin)
    figure, axes = _figure(9.0, 6.5)
    low, high = segments.min(axis=(0, 1)), segments.max(axis=(0, 1))
    axes.set_xlim(low[0] - 1, high[0] + 1)
    axes.set_ylim(low[1] - 1, high[1] + 1)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(title)
    figure.tight_layout()
    points_per_mm = 72 * axes.get_window_extent().width / figure.dpi / (high[0] - low[0] + 2)
    widths = toolpath.width[rows] * points_per_mm * 0.9
    lines = LineCollection(list(segments[order]), colors=colours[order], linewidths=widths[order], capstyle="round")
    axes.add_collection(lines)
    present = [role for role in ROLE_COLOURS if role in roles]
    handles = [Line2D([], [], color=ROLE_COLOURS[role], lw=4, label=role.text.replace("_", " ")) for role in present]
    axes.legend(handles=handles, loc="lower center", ncols=4, frameon=False, fontsize=8, bbox_to_anchor=(0.5, -0.06))
    _save(figure, path)


def draw_deviation(points: FloatArray, deviation: FloatArray, path: Path, title: str) -> None:
    """Top view of the compared surface: where beads stand above the model (red) and stay below it (blue).

    points (n, 3) mm on the model and deviation (n,) mm, positive outwards.
    """
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    cells = np.maximum(np.ceil((high - low) / DEVIATION_CELL).astype(int), 1)
    extent = [[low[0], high[0] + 1e-9], [low[1], high[1] + 1e-9]]
    sums, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=cells, range=extent, weights=deviation)
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=cells, range=extent)
    with np.errstate(invalid="ignore"):
        mean = sums / counts
    figure, axes = _figure(8.0, 6.5)
    image = axes.imshow(
        mean.T,
        origin="lower",
        extent=(low[0], high[0], low[1], high[1]),
        cmap="RdBu_r",
        vmin=-DEVIATION_RANGE,
        vmax=DEVIATION_RANGE,
        interpolation="nearest",
    )
    figure.colorbar(image, label="mm above (+) or below (-) the model", shrink=0.8)
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.set_title(title)
    _save(figure, path)


def draw_joints(trace: Trace, profile: MachineProfile, path: Path, title: str) -> None:
    """Every joint over time, with its limits where they are near."""
    figure, rows = _figure(9.0, 1.5 * len(profile.joints) + 1, rows=len(profile.joints))
    for axes, joint, values in zip(rows, profile.joints, trace.joints.T, strict=True):
        shown = np.degrees(values) if joint.rotary else values
        axes.plot(trace.time, shown, lw=0.6, color="#28536b")
        axes.set_ylabel(f"{joint.letter}, {'°' if joint.rotary else 'mm'}")
        axes.grid(alpha=0.3)
        axes.margins(x=0)
    rows[-1].set_xlabel("s")
    rows[0].set_title(title)
    _save(figure, path)


def _pieces(toolpath: Toolpath) -> tuple[IntArray, FloatArray, FloatArray]:
    """Rows (m,) and both ends (m, 3) of every bead, cut so short that sorting by depth shows what hides what."""
    rows = np.flatnonzero(toolpath.extrudes & (toolpath.role != Role.SKIRT))
    begin, end = toolpath.points[rows - 1], toolpath.points[rows]
    cuts = np.maximum(np.ceil(np.linalg.norm(end - begin, axis=1) / PIECE), 1).astype(np.int64)
    which = np.repeat(np.arange(len(rows)), cuts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    step = ((end - begin) / cuts[:, None])[which]
    first = begin[which] + number[:, None] * step
    return rows[which], first, first + step


def _project(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Screen coordinates (n, 2) and depth (n,) growing towards the eye."""
    c, s = np.cos(VIEW_AZIMUTH), np.sin(VIEW_AZIMUTH)
    across = -s * points[:, 0] + c * points[:, 1]
    towards = c * points[:, 0] + s * points[:, 1]
    up = np.cos(VIEW_ELEVATION) * points[:, 2] - np.sin(VIEW_ELEVATION) * towards
    depth = np.sin(VIEW_ELEVATION) * points[:, 2] + np.cos(VIEW_ELEVATION) * towards
    return np.stack([across, up], axis=1), depth


def _role_colours(roles: IntArray, direction: FloatArray) -> FloatArray:
    """(n, 4) colours, darker the more a bead runs towards the eye, so that neighbouring directions can be told."""
    from matplotlib.colors import to_rgba

    table = np.zeros((max(Role) + 1, 4))
    for role, colour in ROLE_COLOURS.items():
        table[role] = to_rgba(colour)
    length = np.maximum(np.linalg.norm(direction, axis=1), 1e-12)
    across = np.abs(-np.sin(VIEW_AZIMUTH) * direction[:, 0] + np.cos(VIEW_AZIMUTH) * direction[:, 1]) / length
    colours = table[roles]
    colours[:, :3] *= (0.7 + 0.3 * across)[:, None]
    return np.asarray(colours)


def _figure(width: float, height: float, rows: int = 1) -> "tuple[Figure, Any]":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=PIXELS_PER_INCH)
    FigureCanvasAgg(figure)
    axes: Axes | Any = figure.subplots(rows, 1, sharex=rows > 1)
    return figure, axes


def _save(figure: "Figure", path: Path) -> None:
    figure.savefig(path, bbox_inches="tight", metadata={"Software": None})
