"""Draw the flow out of the nozzle without and with pressure advance: docs/pictures/pressure_advance.png.

    python bench/pressure.py [OUT.png]
    python bench/pressure.py --table [--machines NAME,...]

A square spiral whose corners slow the tip down, on grblHAL, which has no pressure advance of its own; and a ring that
only the platter turns, on RepRapFirmware, which leaves it out there. Both programs are judged by the software machine,
with a plastic that follows its drive by 0.05 s. Prints how much of the way is within 5 % of the section wanted.

The table is of the free-form sample on every firmware, whatever is chosen there: no advance, the firmware's alone,
and that of the words (beside the firmware's on RepRapFirmware).
"""

import argparse
import dataclasses
import tempfile
from pathlib import Path
from unittest.mock import patch

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from trunnion import samples
from trunnion.pipeline import settings_for, solid_part
from trunnion_core.arrays import FloatArray
from trunnion_core.bead import bead_area
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_gcode.write import write_program
from trunnion_motion.plan import plan_motion
from trunnion_sim.context import Context
from trunnion_sim.judge import context_of, judge
from trunnion_sim.rules import firmware_names
from trunnion_slicer.slice import slice_mesh

SECONDS = 0.05
OF_SAMPLE = 0.04
"""s of the plastic of the table."""
WIDTH, HEIGHT = 0.4, 0.3
STEP = 0.2
"""mm of path over which flow is averaged."""


def main() -> None:
    """Plan, judge, draw, write."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--table", action="store_true", help="the table of the free-form sample instead")
    options.add_argument("--machines", default="generic_ab_cradle,open5x_voron0")
    pictures = Path(__file__).parents[1] / "docs" / "pictures"
    options.add_argument("out", nargs="?", type=Path, default=pictures / "pressure_advance.png")
    chosen = options.parse_args()
    if chosen.table:
        table(chosen.machines.split(","))
    else:
        draw(chosen.out)


def table(machines: list[str]) -> None:
    """Print how much of the way of the free-form sample's beads has the section wanted, for every firmware."""
    print(f"{'machine':20}{'firmware':16}{'advance':10}{'within 5 %':>11}{'within 10 %':>12}{'off':>7}{'wrong':>7}")
    settings = PrintSettings(**samples.settings("freeform"))
    for machine in machines:
        profile = load_profile(machine)
        part = solid_part("freeform", samples.make("freeform"), profile, settings)
        toolpath = slice_mesh(part.mesh, settings_for(profile, settings)).toolpath
        for firmware in sorted(set(dialect_names()) & set(firmware_names())):
            other = dataclasses.replace(profile, firmware=firmware)
            dialect = find_dialect(firmware)
            if dialect.refuses(other):
                continue
            names = {"none": None, "handed": False, "words": True}
            for name, carried in names.items():
                if name == "handed" and dialect.pressure_advance is None:
                    continue
                with tempfile.TemporaryDirectory() as folder:
                    file = Path(folder) / "freeform.gcode"
                    context = _judged(toolpath, other, settings, carried, file)
                    counts = judge(file, context.profile).counts
                close, fair = shares(context)
                print(
                    f"{machine:20}{firmware:16}{name:10}{close:11.1%}{fair:12.1%}{counts.get('flow-off', 0):7}"
                    f"{counts.get('flow-wrong', 0):7}",
                    flush=True,
                )


def _judged(
    toolpath: Toolpath, profile: MachineProfile, settings: PrintSettings, carried: bool | None, file: Path
) -> Context:
    """The program without advance (None), with the firmware's alone (False) or with that of the words (True)."""
    seconds = 0.0 if carried is None else OF_SAMPLE
    extruder = profile.extruder.model_copy(update={"pressure_advance": seconds})
    profile = dataclasses.replace(profile, extruder=extruder)
    with patch("trunnion_motion.plan.words_carry_advance", lambda *_: carried is True):
        program = plan_motion(toolpath, profile, settings).program
    write_program(program, profile, settings, title="freeform", out=file)
    if carried is None:
        file.write_text(f"; plastic advance [s] = {OF_SAMPLE}\n" + file.read_text())
    return context_of(file, profile)


def shares(context: Context) -> tuple[float, float]:
    """Share of the beads' way, STEP mm at a time, that is within 5 % and within 10 % of the section wanted."""
    pressure, replay = context.pressure, context.replay
    if pressure is None:
        raise RuntimeError("the judge did not see what the plastic's pressure advance is")
    times = np.arange(0, replay.time, 2e-4)
    row, fraction, _ = replay.at(times)
    width, height = context.rows.width, context.rows.height
    bead = context.feeds & context.rows.bead & (width > 0) & (height > 0)
    length = np.where(bead, context.tip_length, 0.0)
    section = np.where(bead, bead_area(np.where(bead, width, 1.0), np.where(bead, height, 1.0)), 0.0)
    along = (np.cumsum(length) - length)[row] + fraction * length[row]
    laid = np.where(bead[row], pressure.flow_at(replay, times), 0.0) * context.profile.filament_area * 2e-4
    cuts = np.arange(0, length.sum(), STEP)
    ways, volumes = np.append(0.0, np.cumsum(length)), np.append(0.0, np.cumsum(length * section))
    ratio = np.histogram(along, cuts, weights=laid)[0] / np.diff(np.interp(cuts, ways, volumes))
    return float((np.abs(ratio - 1) < 0.05).mean()), float((np.abs(ratio - 1) < 0.1).mean())


def draw(out: Path) -> None:
    """The two paths, as a picture."""
    figure, axes = plt.subplots(2, 1, figsize=(11, 6), dpi=80)
    cases = (
        (spiral(), "generic_ab_cradle", "grblhal", "square spiral, 40 mm/s, on grblHAL"),
        (
            ring(),
            "open5x_voron0",
            "reprapfirmware",
            "ring turned by the platter alone, 30 and 10 mm/s, on RepRapFirmware",
        ),
    )
    for panel, (toolpath, machine, firmware, title) in zip(axes, cases, strict=True):
        _draw(panel, toolpath, machine, firmware, title)
    axes[1].set_xlabel("mm of path")
    figure.tight_layout()
    figure.savefig(out)


def _draw(panel: Axes, toolpath: Toolpath, machine: str, firmware: str, title: str) -> None:
    print(title)
    for seconds, colour, name in ((0.0, "tab:orange", "without"), (SECONDS, "tab:blue", "with")):
        way, section, speed = flow(toolpath, machine, firmware, seconds)
        close = float((np.abs(section - 1) <= 0.05).mean())
        print(
            f"  {name:8} within 5 % on {100 * close:5.1f} % of the way, from {section.min():.2f} to {section.max():.2f}"
        )
        if seconds == 0:
            panel.fill_between(
                way, speed / speed.max() * 0.5, color="0.88", label=f"tip speed, to {speed.max():.0f} mm/s"
            )
        panel.plot(way, section, color=colour, linewidth=1.3, label=f"bead {name} pressure advance")
    panel.axhline(1.0, color="0.4", linewidth=0.6)
    panel.set(title=title, ylabel="section laid / wanted", ylim=(0, 2.7), xlim=(0, way[-1]))
    panel.legend(loc="upper right", ncols=3, fontsize=8)


def flow(toolpath: Toolpath, machine: str, firmware: str, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Way (m,) mm along the beads, section there over the one wanted, and tip speed mm/s, as the judge sees them."""
    profile = load_profile(machine)
    extruder = profile.extruder.model_copy(update={"pressure_advance": seconds})
    profile = dataclasses.replace(profile, firmware=firmware, extruder=extruder)
    settings = PrintSettings(layer_height=HEIGHT, extrusion_width=WIDTH)
    program = plan_motion(toolpath, profile, settings).program
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pressure.gcode"
        write_program(program, profile, settings, title="pressure", out=file)
        file.write_text(f"; plastic advance [s] = {SECONDS}\n" + file.read_text())
        context = context_of(file, profile)
    pressure, replay = context.pressure, context.replay
    if pressure is None:
        raise RuntimeError("the judge did not see what the plastic's pressure advance is")
    times = np.arange(0, replay.time, 1e-4)
    row, fraction, _ = replay.at(times)
    bead = context.feeds & context.rows.bead
    length = np.where(bead, context.tip_length, 0.0)
    along = (np.cumsum(length) - length)[row] + fraction * length[row]
    laid = np.where(bead[row], pressure.flow_at(replay, times), 0.0) * profile.filament_area * 1e-4
    cuts = np.arange(0, length.sum(), STEP)
    wanted = float(bead_area(np.array(WIDTH), np.array(HEIGHT)))
    section = np.histogram(along, cuts, weights=laid)[0] / (wanted * STEP)
    took = np.histogram(along, cuts, weights=bead[row] * 1e-4)[0]
    return cuts[:-1] + STEP / 2, section, STEP / np.maximum(took, 1e-9)


def spiral() -> Toolpath:
    """A square spiral inwards."""
    half = 5.5 - np.arange(9) // 4 * 0.5
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])[np.arange(9) % 4]
    points = np.column_stack([corner * half[:, None], np.full(9, HEIGHT)])
    return _beads(points, np.tile([0.0, 0.0, 1.0], (9, 1)), np.full(9, 40.0))


def ring() -> Toolpath:
    """Nine tenths of a circle about the platter's axis, the tool leaning outwards, at 30 and 10 mm/s by turns."""
    angle = np.linspace(0, 1.8 * np.pi, 151)
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(151)])
    speed = np.where(np.arange(151) // 25 % 2, 10.0, 30.0)
    return _beads(15.0 * out + [0, 0, HEIGHT], 0.5 * out + [0, 0, np.sqrt(0.75)], speed)


def _beads(points: FloatArray, axes: FloatArray, speed: FloatArray) -> Toolpath:
    """One bead along the points, reached by a travel."""
    travel = np.arange(len(points)) == 0
    return Toolpath(
        points=points,
        tool_axes=axes,
        width=np.where(travel, 0.0, WIDTH),
        height=np.where(travel, 0.0, HEIGHT),
        role=np.where(travel, int(Role.TRAVEL), int(Role.NONPLANAR_OUTER_WALL)),
        layer=np.zeros(len(points), dtype=np.int64),
        speed=np.where(travel, 150.0, speed),
    )


if __name__ == "__main__":
    main()
