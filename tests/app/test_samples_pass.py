"""Every sample, sliced for every 5-axis machine as its user would, passes the judge; what cannot be reached says so."""

from pathlib import Path

import pytest

from trunnion import samples
from trunnion.dry_run import check_program
from trunnion.pipeline import Job, make_job, solid_part, write_job
from trunnion_core.errors import UnreachableError
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.mesh_io import write_stl

MACHINES = ("generic_ab_cradle", "open5x_prusa_i3", "open5x_voron0", "rep5x_ender3")
COMPARED = "generic_ab_cradle"


def sample_job(name: str, machine: str) -> Job:
    profile = load_profile(machine)
    settings = PrintSettings.model_validate(samples.settings(name))
    return make_job(solid_part(name, samples.make(name), profile, settings), profile, settings)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("name", samples.names())
def test_a_sample_passes_on_every_five_axis_machine(name: str, machine: str, tmp_path: Path) -> None:
    job = sample_job(name, machine)
    program, model = tmp_path / f"{name}.gcode", None
    write_job(job, program)
    if machine == COMPARED:
        model = tmp_path / f"{name}.stl"
        write_stl(samples.make(name), model)
    profile = load_profile(machine)
    report = check_program(program, profile, model)
    assert [finding for finding in report.findings if finding.severity == "error"] == []
    assert report.verdict == "pass"
    along = job.toolpath.role >= Role.NONPLANAR_OUTER_WALL
    assert (job.toolpath.tool_axes[along, 2] < 0.99).any(), "nothing is printed along the skin"


def test_what_a_machine_cannot_reach_names_place_and_joint() -> None:
    """A sample at the edge of a small table: the linear joints end before it does."""
    profile: MachineProfile = load_profile("open5x_prusa_i3")
    settings = PrintSettings.model_validate(samples.settings("freeform") | {"shift": (0.0, 29.0)})
    part = solid_part("freeform", samples.make("freeform"), profile, settings)
    with pytest.raises(
        UnreachableError, match=r"layer \d+: point \(.*\) mm .* is out of reach: joint [A-Z] "
    ) as caught:
        make_job(part, profile, settings)
    assert caught.value.joint in profile.letters
