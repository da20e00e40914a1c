"""Firmware that keeps its drive's jumps small takes ramps more gently, in the plan and before the judge alike."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from trunnion.agreement import agreement
from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.write import write_program
from trunnion_motion.plan import plan_motion
from trunnion_sim.judge import context_of

K = 0.08
SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)


def square() -> Toolpath:
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])[np.arange(9) % 4]
    points = np.column_stack([corner * (5.5 - np.arange(9) // 4 * 0.5)[:, None], np.full(9, 0.3)])
    travel = np.arange(9) == 0
    return Toolpath(
        points=points,
        tool_axes=np.tile([0.0, 0.0, 1.0], (9, 1)),
        width=np.where(travel, 0.0, 0.4),
        height=np.where(travel, 0.0, 0.3),
        role=np.where(travel, int(Role.TRAVEL), int(Role.OUTER_WALL)),
        layer=np.zeros(9, dtype=np.int64),
        speed=np.where(travel, 150.0, 40.0),
    )


@pytest.mark.parametrize("firmware", ["marlin", "reprapfirmware", "klipper"])
@pytest.mark.parametrize("deviation", [None, 0.02])
def test_ramps_of_the_drive_stay_below_its_jerk(firmware: str, deviation: float | None, tmp_path: Path) -> None:
    profile = load_profile("generic_ab_cradle")
    profile = dataclasses.replace(
        profile,
        firmware=firmware,
        extruder=profile.extruder.model_copy(update={"pressure_advance": K, "corner_speed": 2.0}),
        planner=profile.planner.model_copy(update={"junction_deviation": deviation}),
    )
    result = plan_motion(square(), profile, SETTINGS)
    assert result.program.advance == 0
    file = tmp_path / "square.gcode"
    write_program(result.program, profile, SETTINGS, title="square", out=file)
    context = context_of(file, profile)
    laid = (context.motion.filament > 0) & context.rows.bead
    per_length = (context.motion.filament / np.where(laid, context.replay.length, 1.0))[laid]
    jumps = K * per_length * context.replay.acceleration[laid]
    # Marlin with junction deviation: sqrt(0.02 mm x 2.414 x 3000 mm/s²), above any jump here.
    most = {"reprapfirmware": 2.0, "marlin": 2.0 if deviation is None else 12.0}.get(firmware, np.inf)
    assert jumps.max() <= most * (1 + 1e-3)
    if most == 2.0:
        assert jumps.max() == pytest.approx(2.0, rel=1e-3)
    else:
        assert jumps.max() > 4.0
    assert agreement(result, profile, SETTINGS).share_within(0.02) > 0.99
    assert context.replay.duration[~context.homing].sum() == pytest.approx(result.law.total, rel=0.02)
