"""The head of a program names every limit of the profile in the words of its firmware, and sets none."""

import dataclasses
import io
import re

import numpy as np
import pytest

from trunnion_core.profile import load_profile
from trunnion_core.program import MachineProgram
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_gcode.write import write_program

VORON = load_profile("open5x_voron0")
LIMITS = {
    "marlin": ("M203 X250 Y250 Z20 B180 C180 E120", "M201 X5000 Y5000 Z1000 B2000 C2000 E3000", "M205 X30 Y30 Z6"),
    "marlin_tcp": ("M665 X0 Y0 Z0 I0 J0 K-12", "M203 X250 Y250 Z20 B180 C180 E120"),
    "reprapfirmware": ("M203 X15000 Y15000 Z1200 B10800 C10800 E7200", "M566 P0 X1800 Y1800 Z360 B798 C798 E300"),
    "klipper": (
        "[printer] max_velocity: 250, max_accel: 5000",
        "[printer] square_corner_velocity: 30, minimum_cruise_ratio: 0.5",
        "MANUAL_STEPPER STEPPER=c GCODE_AXIS=C LIMIT_VELOCITY=180 LIMIT_ACCEL=2000 INSTANTANEOUS_CORNER_VELOCITY=13.3",
    ),
    "linuxcnc": ("[AXIS_C] and its [JOINT_] MAX_VELOCITY = 180 MAX_ACCELERATION = 2000", "trivkins coordinates=xyzbcu"),
    "linuxcnc_tcp": ("KINEMATICS = xyzbc-trt-kins", "SERVO_PERIOD = 1000000"),
    "grblhal": ("$11=0.01", "$112=1200 $122=1000", "$115=10800 $125=2000", "$116=7200 $126=3000"),
}


def head_of(firmware, profile=VORON):
    """The comments before the first command, and the commands before the first move."""
    k = len(profile.joints)
    program = MachineProgram(
        start=np.zeros(k), joints=np.full((1, k), 0.01), duration=np.ones(1), filament=np.zeros(1),
        role=np.full(1, int(Role.TRAVEL)), layer=np.zeros(1, np.int64), width=np.zeros(1), height=np.zeros(1),
        tip_speed=np.ones(1), tip_length=np.ones(1), source=np.zeros(1, np.int64), tip=np.zeros((2, 3)),
    )  # fmt: skip
    out = io.StringIO()
    write_program(program, dataclasses.replace(profile, firmware=firmware), PrintSettings(), title="part", out=out)
    lines = out.getvalue().splitlines()
    first = next(i for i, line in enumerate(lines) if re.match("G[01] ", line))
    return [line for line in lines[:first] if line.startswith(";")], [line for line in lines[:first] if line[0] != ";"]


def test_every_dialect_states_its_limits():
    assert set(LIMITS) == set(dialect_names())


@pytest.mark.parametrize("firmware", LIMITS)
def test_the_head_names_the_limits_and_sets_none(firmware):
    comments, commands = head_of(firmware)
    for limit in LIMITS[firmware]:
        assert any(limit in line for line in comments), limit
    raises = re.compile(r"M(201|203|204|205|566)\b|SET_VELOCITY_LIMIT|\$1")
    assert not [line for line in commands if raises.match(line) and not re.match(r"M203 I", line)]


@pytest.mark.parametrize("firmware", ["marlin", "reprapfirmware"])
def test_acceleration_along_the_path_is_stated_where_the_profile_has_one(firmware):
    ender = load_profile("rep5x_ender3")
    assert any("M204 P3000 T3000" in line for line in head_of(firmware, ender)[0])
    assert not any("M204" in line for line in head_of(firmware)[0])


def test_marlin_states_the_corner_rule_that_the_profile_has():
    assert any("M205 J0.013" in line for line in head_of("marlin", load_profile("rep5x_ender3"))[0])


@pytest.mark.parametrize("firmware", LIMITS)
def test_what_is_stated_follows_the_profile(firmware):
    """Every limit of every joint shows somewhere."""
    setup = find_dialect(firmware).setup
    before = setup(dataclasses.replace(VORON, firmware=firmware))
    for column, joint in enumerate(VORON.joints):
        for field in ("speed", "acceleration"):
            if firmware == "klipper" and joint.letter == "Y":
                continue  # X speaks for both: they are equal, and the weaker one counts.
            changed = dataclasses.replace(joint, **{field: 0.5 * getattr(joint, field)})
            joints = tuple(changed if place == column else other for place, other in enumerate(VORON.joints))
            if firmware == "klipper" and joint.letter == "X" and field == "speed":
                joints = tuple(dataclasses.replace(j, speed=0.5 * j.speed) for j in VORON.joints)
            assert setup(dataclasses.replace(VORON, joints=joints)) != before, (joint.letter, field)
