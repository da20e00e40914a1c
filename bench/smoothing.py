"""What smoothing brings: time of the non-planar rows and rotary acceleration asked for, with and without.

    python bench/smoothing.py [--picture]

Printed for the free-form part and the propeller on four machines: without smoothing, with the defaults, and with 5
degrees of axis tolerance besides. Rotary acceleration is what the wanted tip speed would ask of the joints (p99.9 over
rows that are no corner of the path). `off` is the greatest angle between the tool axes of the final program and the
normals of the mesh, averaged and interpolated here once more from its triangles alone. A row of the defaults is `met`
where no axis is off by more than 2 degrees and 30 % less time or 30 % less acceleration of both rotaries is asked for.
--picture draws docs/pictures/propeller_on_platter.png: the planned tip speed over the propeller on a tilt-and-platter
machine, and how fast its rotary joints turn along the path, before and after.
"""

import argparse
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np

from trunnion import samples
from trunnion.pipeline import Part, settings_for, solid_part
from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.mesh import Mesh
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_motion.plan import PlanResult, plan_motion
from trunnion_slicer.nonplanar.grid import build_grid
from trunnion_slicer.nonplanar.head import head_of
from trunnion_slicer.slice import slice_mesh

mpl.use("Agg")
import matplotlib.pyplot as plt

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
PARTS = ("freeform", "propeller")
MACHINES = ("generic_ab_cradle", "open5x_voron0", "open5x_prusa_i3", "rep5x_ender3")
CASES = {
    "plain": {"nonplanar_smoothing": 0.0},
    "smooth": {},
    "smooth, 5 degrees": {"nonplanar_axis_tolerance": 5.0},
}
NONPLANAR = (Role.NONPLANAR_OUTER_WALL, Role.NONPLANAR_INNER_WALL, Role.NONPLANAR_INFILL)
CORNER_DEG = 15.0
SAVED, OFF_DEG = 0.3, 2.0
"""What smoothing has to save at least, and how far it may turn the tool for that."""
CREASE_DEG = 20.0
"""Degrees between facets from which on a surface has two normals where they meet."""
ON_SKIN = 0.02
"""mm. A tip nearer than this to the facet under it stands on that."""


@dataclass(frozen=True)
class Row:
    """What a part, a machine and a case come to."""

    time: float
    """s of the non-planar rows."""
    whole: float
    """s of the program."""
    demand: FloatArray
    """(2,) degrees/s² asked of the rotaries."""
    off: float
    """Degrees between tool axes and the mesh's normals at most."""

    def meets(self, plain: "Row") -> bool:
        """Whether enough is saved and no axis is too far off."""
        less = self.time <= (1 - SAVED) * plain.time or bool((self.demand <= (1 - SAVED) * plain.demand).all())
        return less and self.off <= OFF_DEG


def main() -> None:
    """Print one row a machine and case; draw the picture if asked."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--picture", action="store_true")
    if options.parse_args().picture:
        draw("open5x_prusa_i3")
        return
    print(f"{'sample':10}{'machine':18}{'case':18}{'rows s':>7}{'saved':>7}{'whole s':>8}{'off':>6}  degrees/s², saved")
    for name in PARTS:
        for machine in MACHINES:
            plain = measured(name, machine, "plain")
            for case in CASES:
                row = measured(name, machine, case)
                saved = " ".join(
                    f"{a:.0f} {100 * (1 - a / b):.0f}%" for a, b in zip(row.demand, plain.demand, strict=True)
                )
                verdict = ("  met" if row.meets(plain) else "  not met") if case == "smooth" else ""
                print(
                    f"{name:10}{machine:18}{case:18}{row.time:7.1f}{100 * (1 - row.time / plain.time):6.1f}%"
                    f"{row.whole:8.1f}{row.off:6.2f}  {saved}{verdict}",
                    flush=True,
                )


@cache
def measured(name: str, machine: str, case: str) -> Row:
    profile = load_profile(machine)
    part, done = planned(name, profile, case)
    rows = nonplanar(done)
    duration = done.program.duration
    return Row(
        float(duration[rows].sum()),
        float(duration.sum()),
        rotary_demand(done, profile, rows),
        off_normals(part.mesh, done.tip_points[rows], done.tool_axes[rows]),
    )


def planned(name: str, profile: MachineProfile, case: str) -> tuple[Part, PlanResult]:
    settings = settings_for(profile, PrintSettings(**samples.settings(name) | CASES[case]))
    part = solid_part(name, samples.make(name), profile, settings)
    return part, plan_motion(slice_mesh(part.mesh, settings, head_of(profile)).toolpath, profile, settings)


def nonplanar(done: PlanResult) -> BoolArray:
    return np.isin(done.program.role, [int(role) for role in NONPLANAR])


def off_normals(mesh: Mesh, tips: FloatArray, axes: FloatArray) -> float:
    """Greatest angle in degrees between tool axes and the mesh's averaged normals, interpolated over its facets.

    Tips on facets at a crease are left out: there the surface has two normals and the tool must turn.
    """
    corners, faces = mesh.triangles, mesh.faces
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), (ahead * back).sum(axis=2)).ravel()
    # Every corner with every corner at the same vertex.
    order = np.argsort(faces.ravel(), kind="stable")
    first = np.searchsorted(faces.ravel()[order], faces.ravel())
    count = np.searchsorted(faces.ravel()[order], faces.ravel(), side="right") - first
    mine = np.repeat(np.arange(faces.size), count)
    other = order[np.repeat(first, count) + np.arange(len(mine)) - np.repeat(np.cumsum(count) - count, count)]
    alike = (normal[mine // 3] * normal[other // 3]).sum(axis=1) >= np.cos(np.radians(CREASE_DEG))
    weight = angle[other] * alike
    summed = np.stack([np.bincount(mine, weight * normal[other // 3, k]) for k in range(3)], axis=1)
    at_corners = (summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300)).reshape(-1, 3, 3)
    upward = normal[:, 2] > np.sin(np.radians(CREASE_DEG))
    creased = np.bincount(mine // 3, ~alike & upward[other // 3]) > 0

    top = np.flatnonzero(upward)
    found, weights = build_grid(corners[top]).locate(np.ascontiguousarray(tips[:, :2]))
    face = top[found]
    height = (weights * corners[face][:, :, 2]).sum(axis=1)
    checked = ~creased[face] & (np.abs(height - tips[:, 2]) < ON_SKIN)
    expected = np.einsum("nk,nkd->nd", weights, at_corners[face])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    chord = np.linalg.norm(axes - expected, axis=1)[checked]
    if len(chord) < 0.9 * len(tips):
        raise ValueError(f"{len(chord)} of {len(tips)} tips stand on the skin, nearly all should")
    return float(np.degrees(2 * np.arcsin(chord.max() / 2)))


def rates(done: PlanResult) -> FloatArray:
    """(n, k) what every joint moves per mm of tip path."""
    program = done.program
    steps = np.diff(program.joints, axis=0, prepend=program.start[None])
    return np.asarray(steps / np.maximum(program.tip_length, 1e-9)[:, None])


def rotary_demand(done: PlanResult, profile: MachineProfile, rows: BoolArray) -> FloatArray:
    """(2,) degrees/s² of the rotaries at the wanted tip speed, p99.9."""
    program = done.program
    step = np.diff(done.tip_points, axis=0)
    length = np.maximum(program.tip_length, 1e-9)
    cosine = (step[1:] * step[:-1]).sum(axis=1) / (length[1:-1] * length[2:])
    inner = (
        rows[2:] & rows[1:-1] & (cosine > np.cos(np.radians(CORNER_DEG))) & (length[1:-1] > 1e-3) & (length[2:] > 1e-3)
    )
    change = np.abs(np.diff(rates(done)[1:, profile.rotary], axis=0)) / (0.5 * (length[1:-1] + length[2:]))[:, None]
    return np.asarray(np.degrees(np.percentile((change * program.tip_speed[2:, None] ** 2)[inner], 99.9, axis=0)))


def draw(machine: str) -> None:
    profile = load_profile(machine)
    figure, axes = plt.subplots(3, len(CASES), figsize=(14, 8), height_ratios=[2.4, 1, 1], constrained_layout=True)
    for column, case in zip(axes.T, CASES, strict=True):
        _, done = planned("propeller", profile, case)
        rows = nonplanar(done)
        program = done.program
        along = np.cumsum(program.tip_length[rows])
        speed = program.tip_length[rows] / np.maximum(program.duration[rows], 1e-9)
        x, y = done.tip_points[rows, :2].T
        dots = column[0].scatter(
            x, y, c=speed, s=1.0, cmap="viridis", vmin=0, vmax=float(program.tip_speed[rows].max())
        )
        column[0].set_aspect("equal")
        column[0].set_title(f"{case}: {program.duration[rows].sum():.0f} s", fontsize=9)
        near = along < 240
        for row, rotary in zip(column[1:], profile.rotary, strict=True):
            row.plot(along[near], np.degrees(rates(done)[rows, rotary][near]), lw=0.6)
            row.set_ylabel(f"{profile.letters[rotary]} (degrees/mm)", fontsize=8)
            row.set_ylim(*((-15, 15) if rotary == profile.rotary[0] else (-60, 60)))
        column[2].set_xlabel("tip path (mm)", fontsize=8)
    figure.colorbar(dots, ax=axes[0, -1], label="tip speed (mm/s)")
    figure.savefig(PICTURES / "propeller_on_platter.png", dpi=70)
    plt.close(figure)


if __name__ == "__main__":
    main()
