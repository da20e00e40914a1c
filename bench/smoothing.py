"""What smoothing brings: time of the non-planar rows and rotary acceleration asked for, with and without.

    python bench/smoothing.py [--picture]

Printed for the free-form part and the propeller on four machines: without smoothing, with the default 2 degrees, with
1 degree and 1 of axis tolerance (so at most 2 from the normals, pole included), and with 5 degrees of tolerance.
Rotary acceleration is what the wanted tip speed would ask of the joints (p99.9 over rows that are no corner of the
path). --picture draws docs/pictures/propeller_on_platter.png: the planned tip speed over the propeller on a
tilt-and-platter machine, and how fast its rotary joints turn along the path, before and after.
"""

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np

from trunnion import samples
from trunnion.pipeline import settings_for, solid_part
from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_motion.plan import PlanResult, plan_motion
from trunnion_slicer.slice import slice_mesh

mpl.use("Agg")
import matplotlib.pyplot as plt

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
MACHINES = ("generic_ab_cradle", "open5x_voron0", "open5x_prusa_i3", "rep5x_ender3")
CASES = {
    "plain": {"nonplanar_smoothing": 0.0},
    "smooth": {},
    "1 + 1 degrees": {"nonplanar_smoothing": 1.0, "nonplanar_axis_tolerance": 1.0},
    "smooth, 5 degrees": {"nonplanar_axis_tolerance": 5.0},
}
NONPLANAR = (Role.NONPLANAR_OUTER_WALL, Role.NONPLANAR_INNER_WALL, Role.NONPLANAR_INFILL)
CORNER_DEG = 15.0


def main() -> None:
    """Print one row a machine and case; draw the picture if asked."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--picture", action="store_true")
    if options.parse_args().picture:
        draw("open5x_prusa_i3")
        return
    print(f"{'sample':10}{'machine':19}{'case':19}{'rows s':>8}{'saved':>7}{'whole s':>9}  rotary deg/s², saved")
    for name in ("freeform", "propeller"):
        for machine in MACHINES:
            profile = load_profile(machine)
            before: tuple[float, FloatArray] | None = None
            for case in CASES:
                done = planned(name, profile, case)
                rows = nonplanar(done)
                time, asked = float(done.program.duration[rows].sum()), rotary_demand(done, profile, rows)
                before = before or (time, asked)
                saved = " ".join(f"{a:.0f} {100 * (1 - a / b):.0f}%" for a, b in zip(asked, before[1], strict=True))
                print(
                    f"{name:10}{machine:19}{case:19}{time:8.1f}{100 * (1 - time / before[0]):6.1f}%"
                    f"{done.program.duration.sum():9.1f}  {saved}",
                    flush=True,
                )


def planned(name: str, profile: MachineProfile, case: str) -> PlanResult:
    settings = settings_for(profile, PrintSettings(**samples.settings(name) | CASES[case]))
    part = solid_part(name, samples.make(name), profile, settings)
    return plan_motion(slice_mesh(part.mesh, settings).toolpath, profile, settings)


def nonplanar(done: PlanResult) -> BoolArray:
    return np.isin(done.program.role, [int(role) for role in NONPLANAR])


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
        done = planned("propeller", profile, case)
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
