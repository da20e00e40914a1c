"""Planned against replayed: for each firmware, how much of the path runs at the planned tip speed, and the time.

    python bench/replay.py [--samples freeform,propeller] [--machines NAME,...]

Every program is written in the firmware's dialect, read back and replayed by the simulator under that firmware's own
rules (F, corners, accelerations, look-ahead); machines that a dialect cannot drive are left out. LinuxCNC runs cycle by
cycle on both sides, and a row is what its overlapping moves make of it.
"""

import argparse
import dataclasses

from trunnion import samples
from trunnion.agreement import agreement
from trunnion.pipeline import settings_for, solid_part
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_motion.plan import plan_motion
from trunnion_sim.rules import firmware_names
from trunnion_slicer.slice import slice_mesh

MACHINES = "generic_ab_cradle,open5x_prusa_i3,open5x_voron0,rep5x_ender3"


def main() -> None:
    """Print one row a sample, machine and firmware."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--samples", default="freeform,propeller")
    options.add_argument("--machines", default=MACHINES)
    chosen = options.parse_args()
    print(
        f"{'sample':12}{'machine':20}{'firmware':16}{'within 2 %':>11}{'within 0.5 %':>13}{'planned s':>11}"
        f"{'replayed s':>11}{'joint speed':>12}"
    )
    for name in chosen.samples.split(","):
        settings = PrintSettings(**samples.settings(name))
        for machine in chosen.machines.split(","):
            profile = load_profile(machine)
            part = solid_part(name, samples.make(name), profile, settings)
            toolpath = slice_mesh(part.mesh, settings_for(profile, settings)).toolpath
            for firmware in sorted(set(dialect_names()) & set(firmware_names())):
                other = dataclasses.replace(profile, firmware=firmware)
                if find_dialect(firmware).refuses(other):
                    continue
                found = agreement(plan_motion(toolpath, other, settings), other, settings)
                print(
                    f"{name:12}{machine:20}{firmware:16}{found.share_within(0.02):11.3%}"
                    f"{found.share_within(0.005):13.3%}{found.planned_time:11.1f}{found.replayed_time:11.1f}"
                    f"{found.joint_speed.max():12.2%}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
