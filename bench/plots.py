"""Draw joint speeds, tip speed and flow over a print: docs/pictures/motion.png.

    python bench/plots.py [OUT.png]

A dome's cap printed along its normals on the A-B cradle, which has no pole at the upright tool, and on a table whose
platter has one: there without and with a tolerance for the tool's direction. The same toolpath, the same plastic.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_motion.plan import PlanResult, plan_motion
from trunnion_motion.timelaw import speeds_at

CASES = (
    ("generic_ab_cradle", 0.0, "A-B cradle"),
    ("open5x_voron0", 0.0, "B-C table, tool exact"),
    ("open5x_voron0", 5.0, "B-C table, 5° tolerance"),
)


def main() -> None:
    """Plan, draw, write."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs" / "pictures" / "motion.png"
    out.parent.mkdir(parents=True, exist_ok=True)
    toolpath = cap()
    figure, axes = plt.subplots(3, len(CASES), figsize=(13, 6.5), sharex="col", sharey="row", dpi=72)
    for column, (name, tolerance, title) in enumerate(CASES):
        profile = load_profile(name)
        result = plan_motion(toolpath, profile, PrintSettings(layer_height=0.3, nonplanar_axis_tolerance=tolerance))
        seconds, joints, tip, flow = traces(result, profile.filament_area)
        axes[0, column].set_title(f"{title}: {result.program.duration.sum():.0f} s")
        for joint, letter in enumerate(profile.letters):
            axes[0, column].plot(seconds, joints[:, joint] / profile.array("speed")[joint], lw=0.7, label=letter)
        axes[1, column].plot(seconds, tip, lw=0.7, color="black")
        axes[2, column].plot(seconds, flow, lw=0.7, color="tab:brown")
        axes[2, column].set_xlabel("time, s")
        axes[0, column].legend(ncol=5, fontsize=7, loc="upper right")
    axes[0, 0].set_ylabel("joint speed / its cap")
    axes[1, 0].set_ylabel("tip speed over the part, mm/s")
    axes[2, 0].set_ylabel("flow, mm³/s")
    axes[0, 0].set_ylim(-1.05, 1.4)
    axes[1, 0].set_ylim(0, 60)
    axes[2, 0].set_ylim(0, 5)
    figure.tight_layout()
    figure.savefig(out, metadata={"Software": None})
    print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


def traces(result: PlanResult, filament_area: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, joint speeds, tip speed and flow at both ends and the middle of every row."""
    program, law = result.program, result.law
    fraction = np.linspace(0, 1, 3)
    times, speeds = speeds_at(law, fraction)
    started = np.concatenate([[0.0], np.cumsum(program.duration)[:-1]])
    seconds = (started[:, None] + times).ravel()
    length = np.maximum(law.length, 1e-12)
    steps = np.diff(program.joints, axis=0, prepend=program.start[None])
    joints = (steps / length[:, None])[:, None] * speeds[:, :, None]
    tip = (program.tip_length / length)[:, None] * speeds
    beads = program.width > 0
    flow = np.where(beads, program.filament * filament_area / length, 0.0)[:, None] * speeds
    return seconds, joints.reshape(len(seconds), -1), tip.ravel(), flow.ravel()


def cap(radius: float = 40.0, pitch: float = 2.0, lift: float = 1.0) -> Toolpath:
    """Straight passes over a dome's cap, tool along its normals, 0.4 mm off its top at the nearest."""
    points, axes, beads = [], [], []
    for number, y in enumerate(np.arange(-15.6, 16, pitch)):
        x = np.linspace(-1, 1, 120) * np.sqrt(20**2 - y**2) * (-1) ** number
        normal = np.stack([x, np.full_like(x, y), np.sqrt(radius**2 - x**2 - y**2)], axis=1) / radius
        line = radius * normal - [0, 0, 20]
        points += [line[:1] + lift * normal[:1], line, line[-1:] + lift * normal[-1:]]
        axes += [normal[:1], normal, normal[-1:]]
        beads += [[False, False], [True] * 119, [False]]
    extrudes = np.concatenate(beads)
    n = len(extrudes)
    return Toolpath(
        points=np.concatenate(points),
        tool_axes=np.concatenate(axes),
        width=np.where(extrudes, 0.46, 0.0),
        height=np.where(extrudes, 0.3, 0.0),
        role=np.where(extrudes, int(Role.NONPLANAR_INFILL), int(Role.TRAVEL)),
        layer=np.zeros(n, dtype=np.int64),
        speed=np.where(extrudes, 30.0, 120.0),
    )


if __name__ == "__main__":
    main()
