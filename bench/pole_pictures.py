"""Draw docs/pictures/ring_on_platter.png and dome_on_platter.png: joints of a platter machine, before and after.

Before: each pose solved by itself, first branch, angles as atan2 gives them. After: `branches.choose`, on the dome with
5 degrees of tolerance. The lowest row shows the tip speed that the joints' top speeds allow, beside the wanted 30 mm/s.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_kinematics.branches import choose
from trunnion_kinematics.chain import JointChain

mpl.use("Agg")
import matplotlib.pyplot as plt

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
WANTED = 30.0


def main() -> None:
    """Draw both pictures."""
    machine = load_profile("open5x_prusa_i3")
    draw(machine, "ring", [("three turns round a ring, leaning 30°", *ring(), 0.0)])
    passes = [(f"over a dome, {off:g}° beside its top", *dome(off), 5.0) for off in (0.1, 1, 5)]
    draw(machine, "dome", passes)


def draw(machine: MachineProfile, name: str, cases: list[tuple[str, FloatArray, FloatArray, float]]) -> None:
    chain = JointChain.from_profile(machine)
    figure, axes = plt.subplots(3, 2 * len(cases), figsize=(4.2 * len(cases) + 2, 6.5), sharex="col", squeeze=False)
    for case, (title, points, tool_axes, tolerance) in enumerate(cases):
        first = np.arange(len(points)) == 0
        alone = chain.inverse(points, tool_axes)[0]
        chosen = choose(chain, machine, points, tool_axes, travel=first, axis_tolerance=np.radians(tolerance)).joints
        way = np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        for side, (when, joints) in enumerate((("before", alone), ("after", chosen))):
            column = axes[:, 2 * case + side]
            column[0].set_title(f"{title}\n{when}", fontsize=8)
            for row, rotary in enumerate(chain.rotary):
                column[row].plot(way, np.degrees(joints[:, rotary]), ".-", ms=2, lw=0.8, color=f"C{row}")
                column[row].set_ylabel(f"{machine.letters[rotary]} (degrees)")
            column[2].plot(way[1:], allowed_speed(machine, points, joints), lw=0.9, color="C3")
            column[2].axhline(WANTED, lw=0.7, color="0.5", ls="--")
            column[2].set(ylim=(0, 90), ylabel="tip speed allowed (mm/s)", xlabel="tip path (mm)")
    figure.tight_layout()
    figure.savefig(PICTURES / f"{name}_on_platter.png", dpi=80)
    plt.close(figure)


def allowed_speed(machine: MachineProfile, points: FloatArray, joints: FloatArray) -> FloatArray:
    """(n - 1,) mm/s of the tip at which the first joint reaches its top speed."""
    needed = (np.abs(np.diff(joints, axis=0)) / machine.array("speed")).max(axis=1)
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1) / np.maximum(needed, 1e-9))


def ring(radius: float = 20.0, turns: int = 3) -> tuple[FloatArray, FloatArray]:
    a = np.linspace(0, 2 * np.pi * turns, 300 * turns) + 2.5
    lean = np.radians(30)
    tool_axes = np.stack([np.sin(lean) * np.cos(a), np.sin(lean) * np.sin(a), np.full(len(a), np.cos(lean))], axis=1)
    return np.stack([radius * np.cos(a), radius * np.sin(a), np.full(len(a), 10.0)], axis=1), tool_axes


def dome(off_deg: float, radius: float = 40.0) -> tuple[FloatArray, FloatArray]:
    aside = radius * np.sin(np.radians(off_deg))
    circle = np.sqrt(radius**2 - aside**2)
    a = np.radians(np.arange(-40, 40, np.degrees(0.4 / circle)))
    normals = np.stack([circle * np.sin(a), np.full(len(a), aside), circle * np.cos(a)], axis=1) / radius
    return normals * radius - [0, 0, radius - 20], normals


if __name__ == "__main__":
    main()
