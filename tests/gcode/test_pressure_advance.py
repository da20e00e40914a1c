"""Pressure advance goes to the firmware where it applies it to every bead, and nowhere else."""

import dataclasses
import io

import numpy as np
import pytest

from trunnion_core.errors import GcodeError
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.program import MachineProgram
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_gcode.write import write_program


def machine(firmware: str, seconds: float) -> MachineProfile:
    profile = load_profile("generic_ab_cradle")
    extruder = profile.extruder.model_copy(update={"pressure_advance": seconds})
    return dataclasses.replace(profile, firmware=firmware, extruder=extruder)


def beads(profile: MachineProfile, moving: str, rows: int = 50) -> MachineProgram:
    """A travel, then rows of beads in which only the joints named move."""
    step = np.array([0.3 if letter in moving else 0.0 for letter in profile.letters]) / profile.to_shown
    joints = np.cumsum(np.tile(step, (rows, 1)), axis=0)
    bead = np.arange(rows) > 0
    whole = np.zeros(rows, dtype=np.int64)
    return MachineProgram(
        start=np.zeros(len(profile.joints)),
        joints=joints,
        duration=np.full(rows, 0.01),
        filament=np.where(bead, 0.02, 0.0),
        role=np.where(bead, int(Role.NONPLANAR_INFILL), int(Role.TRAVEL)),
        layer=whole,
        width=np.where(bead, 0.4, 0.0),
        height=np.where(bead, 0.3, 0.0),
        tip_speed=np.full(rows, 30.0),
        tip_length=np.full(rows, 0.3),
        source=np.arange(rows),
    )


def written(profile: MachineProfile, moving: str) -> list[str]:
    out = io.StringIO()
    write_program(beads(profile, moving), profile, PrintSettings(), title="t", out=out)
    return out.getvalue().splitlines()


COMMANDS = {
    "marlin": "M900 K0.045",
    "reprapfirmware": "M572 D0 S0.045",
    "klipper": "SET_PRESSURE_ADVANCE ADVANCE=0.045",
}


@pytest.mark.parametrize("firmware", COMMANDS)
def test_it_is_handed_over_once_before_the_first_move(firmware: str) -> None:
    lines = written(machine(firmware, 0.045), "XA")
    assert lines.count(COMMANDS[firmware]) == 1
    first = next(index for index, line in enumerate(lines) if line.startswith(("G0 X", "G1 X")))
    assert lines.index(COMMANDS[firmware]) < first


@pytest.mark.parametrize("firmware", COMMANDS)
def test_without_it_the_firmwares_own_setting_is_left_alone(firmware: str) -> None:
    word = COMMANDS[firmware].split()[0]
    assert not any(line.startswith(word) for line in written(machine(firmware, 0.0), "XA"))


@pytest.mark.parametrize(
    ("firmware", "moving"), [("klipper", "AB"), ("klipper", "ZA"), ("reprapfirmware", "ZB"), ("marlin", "AB")]
)
def test_beads_that_the_firmware_would_leave_without_it_are_refused(firmware: str, moving: str) -> None:
    with pytest.raises(GcodeError, match=r"none to 100\.0 % of the plastic"):
        written(machine(firmware, 0.045), moving)
    assert written(machine(firmware, 0.0), moving)


def test_marlin_applies_it_to_moves_of_z() -> None:
    assert COMMANDS["marlin"] in written(machine("marlin", 0.045), "ZA")


@pytest.mark.parametrize("firmware", ["linuxcnc", "grblhal"])
def test_firmwares_without_it_take_no_program_that_does_not_carry_it(firmware: str) -> None:
    with pytest.raises(GcodeError, match="does not carry it"):
        written(machine(firmware, 0.045), "XA")
