"""Speeds that a firmware cannot be told, or will not go: what is planned is what is driven, or the writer refuses."""

import dataclasses

import numpy as np
import pytest

from trunnion.agreement import agreement, on_firmware
from trunnion_core.errors import GcodeError
from trunnion_core.profile import load_profile
from trunnion_core.program import MachineProgram
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_gcode.feed import MOST_INVERSE, speeds_read
from trunnion_gcode.moves import make_moves
from trunnion_motion.plan import plan_motion

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
VORON = load_profile("open5x_voron0")
LEAST = {"marlin": 0.05, "marlin_tcp": 0.05, "grblhal": 1 / 60}
"""mm/s along X, Y and Z that these do not go below; RepRapFirmware is allowed less by M203 I."""


def line(speed):
    """A travel to the plate and a straight bead of 2 mm."""
    points = np.array([[0.0, 0, 0.3], [0.5, 0, 0.3], [1.0, 0, 0.3], [2.0, 0, 0.3]])
    width = np.array([0.0, 0.4, 0.4, 0.4])
    return Toolpath(
        points=points,
        tool_axes=np.tile([0.0, 0.0, 1.0], (4, 1)),
        width=width,
        height=np.where(width > 0, 0.3, 0.0),
        role=np.where(width > 0, int(Role.SOLID_INFILL), int(Role.TRAVEL)),
        layer=np.zeros(4, dtype=np.int64),
        speed=np.array([100.0, speed, speed, speed]),
    )


@pytest.mark.parametrize("firmware", dialect_names())
@pytest.mark.parametrize("speed", [0.004, 0.4, 1e5])
def test_what_is_planned_is_driven(firmware, speed):
    profile = on_firmware(VORON, firmware)
    found = agreement(plan_motion(line(speed), profile, SETTINGS), profile, SETTINGS)
    assert found.share_within(0.02) >= 0.99
    assert found.time_ratio == pytest.approx(1.0, abs=0.005)
    assert found.joint_speed.max() <= 1.001
    if speed < 1:
        bead = found.replayed[found.weight > 0][-2]
        assert bead == pytest.approx(max(speed, LEAST.get(firmware, 0.0)), rel=0.02)


def one_move(step_mm, seconds):
    """X alone."""
    k = len(VORON.joints)
    joints = np.zeros((1, k))
    joints[0, VORON.letters.index("X")] = step_mm
    return MachineProgram(
        start=np.zeros(k), joints=joints, duration=np.array([seconds]), filament=np.zeros(1),
        role=np.full(1, int(Role.TRAVEL)), layer=np.zeros(1, np.int64), width=np.zeros(1), height=np.zeros(1),
        tip_speed=np.ones(1), tip_length=np.array([step_mm]), source=np.zeros(1, np.int64),
        tip=np.zeros((2, 3)) + np.array([[0.0], [1.0]]) * [step_mm, 0, 0],
    )  # fmt: skip


@pytest.mark.parametrize("firmware", dialect_names())
def test_a_feed_beyond_any_number_is_refused_or_capped(firmware):
    """F of 6e15 mm/min is no word; under G93 it is the shortest time that a reader can tell."""
    profile, dialect = dataclasses.replace(VORON, firmware=firmware), find_dialect(firmware)
    moves = make_moves(one_move(100.0, 1e-12), profile, dialect)
    if dialect.inverse_time:
        assert speeds_read(moves, moves.asked, dialect) == pytest.approx(moves.metric * MOST_INVERSE / 60)
    else:
        with pytest.raises(GcodeError, match=r"row 0: F is .*, should be a finite number below"):
            speeds_read(moves, moves.asked, dialect)
