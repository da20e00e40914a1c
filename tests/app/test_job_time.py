"""How long a job takes: the software machine's planner, in whole steps line by line, against the judge's replay.

The two share no planner code. The samples are printed as shipped; with tip control the same surface goes to a table.
"""

from pathlib import Path

import numpy as np
import pytest

from trunnion import samples
from trunnion.agreement import on_firmware
from trunnion.pipeline import make_job, solid_part, write_job
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.write import write_program
from trunnion_host.prepare import commands
from trunnion_motion.plan import plan_motion
from trunnion_sim.context import Context
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.judge import context_of

HEAT = ("M104", "M109", "M140", "M190")


def executed(program: Path, profile: MachineProfile) -> SoftwareMachine:
    """The machine after it has run the program as fast as a host without latency feeds it, heaters left out."""
    machine = SoftwareMachine(profile, speed=None)
    machine.take()
    lines = ["M302 P1", *commands(program.read_text().splitlines()).text, "M400"]
    for line in lines:
        if not line.startswith(HEAT):
            machine.receive(line.encode() + b"\n")
            while b"ok" not in machine.advance(0.0):
                pass
    return machine


def assert_same_job(machine: SoftwareMachine, judged: Context) -> None:
    profile = machine.profile
    trace = machine.trace()
    assert machine.now == pytest.approx(judged.replay.time, rel=0.02)
    assert trace.volume.sum() == pytest.approx(judged.motion.filament.sum() * profile.filament_area, rel=1e-4)
    np.testing.assert_allclose(trace.points[-1], judged.points[-1], atol=0.05)


@pytest.mark.parametrize("name", samples.names())
def test_machine_and_judge_take_the_same_time_for_every_sample(name: str, tmp_path: Path) -> None:
    profile = load_profile("generic_ab_cradle")
    settings = PrintSettings.model_validate(samples.settings(name))
    file = tmp_path / f"{name}.gcode"
    write_job(make_job(solid_part(name, samples.make(name), profile, settings), profile, settings), file)
    assert_same_job(executed(file, profile), context_of(file, profile))


def bowl() -> Toolpath:
    """Rings on a bowl, tool along its normals."""
    t = np.linspace(0.0, 12 * np.pi, 1500)
    radius = 6.0 + t / 2
    points = np.column_stack([radius * np.cos(t), radius * np.sin(t), 4.0 + radius**2 / 80])
    axes = np.column_stack([-points[:, 0] / 40, -points[:, 1] / 40, np.ones(len(t))])
    travel = np.arange(len(t)) == 0
    return Toolpath(
        points=points,
        tool_axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        width=np.where(travel, 0.0, 0.4),
        height=np.where(travel, 0.0, 0.3),
        role=np.where(travel, int(Role.TRAVEL), int(Role.NONPLANAR_INFILL)),
        layer=np.zeros(len(t), np.int64),
        speed=np.full(len(t), 40.0),
    )


def test_machine_and_judge_agree_on_a_program_of_tip_words(tmp_path: Path) -> None:
    profile = on_firmware(load_profile("open5x_voron0"), "marlin_tcp")
    settings = PrintSettings()
    file = tmp_path / "bowl.gcode"
    plan = plan_motion(bowl(), profile, settings)
    write_program(plan.program, profile, settings, title="bowl", out=file)
    text = file.read_text()
    assert "G43.4" in text
    file.write_text(text.replace("G28\n", ""))  # homing is no part of the program's time
    machine, judged = executed(file, profile), context_of(file, profile)
    assert_same_job(machine, judged)
    laid = machine.trace().points[machine.trace().volume > 0]
    np.testing.assert_allclose(laid[:, 2], 4.0 + (laid[:, :2] ** 2).sum(axis=1) / 80, atol=0.05)
