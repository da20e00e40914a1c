"""The firmware's planner and the judge's replay were written apart: the same program takes both the same time."""

import math
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.judge import context_of


def five_axis_program(seed: int) -> list[str]:
    """Rings on a bowl with the table turning along, travels between them, retractions at their ends."""
    random = np.random.default_rng(seed)
    lines = ["M302 P1", "G90", "M83", "G92 E0"]
    for ring in range(6):
        radius = random.uniform(8.0, 40.0)
        pieces = int(radius * random.uniform(4.0, 12.0))
        lines.append(f"G0 X{radius:.4f} Y0 Z{5 + ring:.4f} F6000")
        lines.append("G1 E1.2 F1800")
        for i in range(1, pieces + 1):
            t = 2 * math.pi * i / pieces
            tilt = random.uniform(0.0, 0.02) + radius / 3
            lines.append(
                f"G1 X{radius * math.cos(t):.4f} Y{radius * math.sin(t):.4f} Z{5 + ring + 0.1 * math.sin(3 * t):.4f} "
                f"A{tilt * math.sin(t):.4f} B{tilt * math.cos(t):.4f} E{0.033 * 2 * math.pi * radius / pieces:.5f} "
                f"F{random.choice([1200, 2400, 3600])}"
            )
        lines.append("G1 E-1.2 F1800")
    return [*lines, "M400"]


@pytest.mark.parametrize("name", ["generic_ab_cradle", "rep5x_ender3"])
@pytest.mark.parametrize("seed", [1, 2])
def test_machine_and_judge_agree_on_time_place_and_plastic(tmp_path: Path, name: str, seed: int) -> None:
    profile = load_profile(name)
    lines = five_axis_program(seed)
    file = tmp_path / "rings.gcode"
    file.write_text("\n".join(lines) + "\n")
    judged = context_of(file, profile)
    machine = SoftwareMachine(profile, speed=None)
    machine.take()
    for line in lines:
        machine.receive(line.encode() + b"\n")
        while b"ok" not in machine.advance(0.0):
            pass
    machine.finish()
    trace = machine.trace()
    assert machine.now == pytest.approx(judged.replay.time, rel=0.02)
    step = 1.5 / np.array([j.steps_per_unit for j in profile.joints])
    assert (np.abs(trace.joints[-1] - judged.motion.joints[-1]) < step).all()
    fed = sum(float(line.split("E")[1].split()[0]) for line in lines if line.startswith("G1"))
    assert trace.volume.sum() == pytest.approx(fed * profile.filament_area, rel=2e-3)
    near = np.abs(trace.points[:, None, :] - judged.points[None, ::7, :]).sum(axis=2).min(axis=0)
    assert np.median(near) < 0.05
