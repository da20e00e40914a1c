"""`trunnion forward`: joint values become tool poses."""

from pathlib import Path

import click

from trunnion.commands.options import EXISTING_FILE, OUTPUT_FILE, machine_option


@click.command("forward")
@click.argument("joints", type=EXISTING_FILE)
@machine_option()
@click.option("-o", "--output", type=OUTPUT_FILE, required=True, help="The .npz to write.")
def command(joints: Path, machine: str, output: Path) -> None:
    """Tool poses for JOINTS: an .npz with joints (n, k) in mm and degrees in the profile's order.

    Writes points (n, 3) in mm and tool_axes (n, 3), in the part frame.
    """
    import numpy as np

    from trunnion.arrays_file import read_arrays
    from trunnion_core.output import whole_file
    from trunnion_core.profile import load_profile
    from trunnion_kinematics.chain import JointChain

    profile = load_profile(machine)
    (values,) = read_arrays(joints, joints=(None, len(profile.joints)))
    points, axes = JointChain.from_profile(profile).forward(values / profile.to_shown)
    with whole_file(output) as path, path.open("wb") as file:
        np.savez_compressed(file, points=points, tool_axes=axes)
