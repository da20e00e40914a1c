"""`trunnion inverse`: tool poses become joint values."""

from pathlib import Path

import click

from trunnion.commands.options import EXISTING_FILE, OUTPUT_FILE, machine_option


@click.command("inverse")
@click.argument("poses", type=EXISTING_FILE)
@machine_option()
@click.option("-o", "--output", type=OUTPUT_FILE, required=True, help="The .npz to write.")
def command(poses: Path, machine: str, output: Path) -> None:
    """Joint values for tool POSES: an .npz with points (n, 3) in mm and tool_axes (n, 3), in the part frame.

    Writes joints (branches, n, k) in mm and degrees in the profile's order, NaN where out of reach; reachable (n,);
    and singularity (n,), the absolute determinant of the orientation Jacobian, 0 at a pole.
    """
    import numpy as np

    from trunnion.arrays_file import read_arrays, unit_rows
    from trunnion_core.output import whole_file
    from trunnion_core.profile import load_profile
    from trunnion_kinematics.chain import JointChain

    profile = load_profile(machine)
    points, axes = read_arrays(poses, points=(None, 3), tool_axes=(None, 3))
    axes = unit_rows(poses, "tool_axes", axes, len(points))
    chain = JointChain.from_profile(profile)
    joints = chain.inverse(points, axes) * profile.to_shown
    with whole_file(output) as path, path.open("wb") as file:
        reachable = np.isfinite(joints).all(axis=2).any(axis=0)
        np.savez_compressed(file, joints=joints, reachable=reachable, singularity=chain.singularity(axes))
