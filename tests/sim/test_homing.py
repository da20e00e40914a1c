"""G28 of the machine and of the judge: one order, one time, found on two roads."""

from pathlib import Path

import numpy as np
import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.judge import context_of


def machine_after(name: str, lines: list[str]) -> tuple[SoftwareMachine, str]:
    machine = SoftwareMachine(load_profile(name), speed=None)
    machine.take()
    said = ""
    for line in ["M302 P1", *lines]:
        machine.receive(line.encode() + b"\n")
        answer = b""
        while b"ok\n" not in answer:
            answer += machine.advance(0.0)
        said += answer.decode()
    return machine, said


@pytest.mark.parametrize("name", ["generic_ab_cradle", "rep5x_ender3", "generic_3axis"])
@pytest.mark.parametrize(
    "lines",
    [["G28"], ["G28 X Y"], ["G28 Z"], ["G0 X37 Y21 Z9 F6000", "M400", "G28"], ["G28", "G0 Z20 X60 F3000", "G28 X0"]],
)
def test_machine_and_judge_take_the_same_time(tmp_path: Path, name: str, lines: list[str]) -> None:
    profile = load_profile(name)
    machine, _ = machine_after(name, lines)
    file = tmp_path / "home.gcode"
    file.write_text("\n".join(["M302 P1", *lines]) + "\n")
    judged = context_of(file, profile)
    assert machine.now == pytest.approx(judged.replay.time, rel=0.01)
    ends = (machine.trace().joints[-1], judged.motion.joints[-1])
    np.testing.assert_allclose(*(values * profile.to_shown for values in ends), rtol=0, atol=0.05)


def test_x_and_y_come_first_then_z_then_the_rotaries_each_with_a_step_back() -> None:
    machine, said = machine_after("generic_ab_cradle", ["G0 X-20 Y10 Z30 A5 B-4 F6000", "M400", "G28"])
    joints = machine.trace().joints[1:] * load_profile("generic_ab_cradle").to_shown
    moved = [int(np.argmax(np.abs(step))) for step in np.diff(np.vstack([[-20, 10, 30, 5, -4], joints]), axis=0)]
    assert moved == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4]
    home = [joint.shown(joint.home) for joint in load_profile("generic_ab_cradle").joints]
    assert abs(abs(joints[1, 0] - home[0]) - 5.0) < 0.02
    assert abs(abs(joints[10, 3] - home[3]) - 2.0) < 0.03
    assert "echo:busy: processing\n" in said
    np.testing.assert_allclose(joints[-1], home, atol=0.03)
