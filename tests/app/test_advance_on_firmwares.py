"""A ring that only the platter turns: with pressure advance in the words the judge sees the flow that was wanted."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.arrays import FloatArray
from trunnion_core.bead import bead_area
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.write import write_program
from trunnion_motion.plan import plan_motion
from trunnion_sim.context import Context
from trunnion_sim.judge import context_of, judge

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
FIRMWARES = ("marlin", "reprapfirmware", "grblhal", "klipper", "linuxcnc")
AT_SPEED = ("marlin", "reprapfirmware", "grblhal")
"""Those that go through the rows of a ring without slowing down; where every row slows down, lag shows less."""
WITHIN = {"linuxcnc": 0.08}
"""Of the section wanted, over two rows; 0.05 elsewhere. LinuxCNC lets rows overlap, so their ends are no corners."""
OFF = {"marlin": "M900 K0", "reprapfirmware": "M572 D0 S0.05", "klipper": "SET_PRESSURE_ADVANCE ADVANCE=0"}
K = 0.05
ROWS, RADIUS = 150, 15.0
PITCH = 2 * RADIUS * np.sin(0.9 * np.pi / ROWS)


def ring(lean: float = 30.0) -> Toolpath:
    """Nine tenths of a circle about the platter's axis, the tool leaning outwards, at 30 and 10 mm/s by turns.

    Before it the beginning of another, since no prime comes before a program's first bead.
    """
    angle = np.linspace(0, 1.8 * np.pi, ROWS + 1)
    rows = np.concatenate([np.arange(11), np.arange(ROWS + 1)])
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(ROWS + 1)])[rows]
    layer = np.repeat([0, 1], [11, ROWS + 1])
    travel = rows == 0
    tilt = np.radians(lean)
    return Toolpath(
        points=RADIUS * out + [0, 0, 0.3] + 0.3 * layer[:, None] * [0, 0, 1],
        tool_axes=np.sin(tilt) * out + np.cos(tilt) * np.array([0, 0, 1]),
        width=np.where(travel, 0.0, 0.4),
        height=np.where(travel, 0.0, 0.3),
        role=np.where(travel, int(Role.TRAVEL), int(Role.NONPLANAR_OUTER_WALL)),
        layer=layer,
        speed=np.where(rows // 25 % 2, 10.0, 30.0),
    )


def machine(firmware: str, seconds: float, name: str = "open5x_voron0") -> MachineProfile:
    profile = load_profile(name)
    extruder = profile.extruder.model_copy(update={"pressure_advance": seconds})
    return dataclasses.replace(profile, firmware=firmware, extruder=extruder)


def written(folder: Path, firmware: str, seconds: float) -> Path:
    file = folder / f"{firmware}_{seconds}.gcode"
    profile = machine(firmware, seconds)
    write_program(plan_motion(ring(), profile, SETTINGS).program, profile, SETTINGS, title="ring", out=file)
    return file


def told(file: Path, *lines: str) -> Path:
    """The same program, with lines before its first."""
    file.write_text("\n".join([*lines, file.read_text()]))
    return file


def sections(context: Context) -> FloatArray:
    """Plastic that leaves the nozzle over plastic wanted, along every second row of the ring."""
    bead = context.feeds & context.rows.bead & (context.rows.layer == 1)
    way = np.append(0.0, np.cumsum(context.tip_length[bead]))
    laid = np.append(0.0, np.cumsum(context.laid[bead] * context.profile.filament_area))
    cuts = np.arange(0, way[-1] + PITCH / 2, 2 * PITCH)
    wanted = float(bead_area(np.array(0.4), np.array(0.3)))
    return np.diff(np.interp(cuts, way, laid)) / (2 * PITCH * wanted)


def off(file: Path, profile: MachineProfile) -> int:
    """Rows of the ring whose flow the judge has something against."""
    findings = judge(file, profile).findings
    return sum(found.count for found in findings if found.code in ("flow-off", "flow-wrong") and found.layer == 1)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_flow_is_right_when_only_the_platter_turns(firmware: str, tmp_path: Path) -> None:
    file = written(tmp_path, firmware, K)
    commands = file.read_text().splitlines()
    assert commands.count("; plastic advance [s] = 0.05") == 1
    assert firmware not in OFF or commands.count(OFF[firmware]) == 1
    profile = machine(firmware, K)
    context = context_of(file, profile)
    turning = context.feeds & context.rows.bead
    steps = np.abs(context.motion.joints - context.motion.before)[turning]
    assert steps[:, [profile.letters.index(letter) for letter in "XYZ"]].max() == 0
    found = sections(context)
    assert np.abs(found - 1).max() < WITHIN.get(firmware, 0.05)
    assert off(file, profile) == 0
    assert not {"bead-without-plastic", "unknown-command"} & set(judge(file, profile).counts)
    plain = context_of(written(tmp_path, firmware, 0.0), profile).motion.filament
    assert context.motion.filament.sum() == pytest.approx(plain.sum(), abs=2e-5)
    assert context.laid.sum() == pytest.approx(plain.sum() + SETTINGS.retract_length, rel=5e-3)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_without_it_the_judge_sees_what_is_wrong(firmware: str, tmp_path: Path) -> None:
    file = told(written(tmp_path, firmware, 0.0), "; plastic advance [s] = 0.05")
    found = sections(context_of(file, machine(firmware, 0.0)))
    if firmware in AT_SPEED:
        assert found.min() < 0.65
        assert found.max() > 1.5
        assert off(file, machine(firmware, 0.0)) > 0
    else:
        assert np.abs(found - 1).max() > 0.03
    counts = judge(file, machine(firmware, 0.0)).counts
    assert counts.get("flow-off", 0) + counts.get("flow-wrong", 0) > 0


def test_twice_is_as_wrong_as_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Marlin's own advance left on beside words that carry it, on a path that moves X and Y."""
    monkeypatch.setattr("trunnion_motion.plan.words_carry_advance", lambda *_: True)
    profile = machine("marlin", K, "generic_ab_cradle")
    file = tmp_path / "flat.gcode"
    write_program(plan_motion(ring(0.0), profile, SETTINGS).program, profile, SETTINGS, title="flat", out=file)
    assert off(file, profile) == 0
    assert np.abs(sections(context_of(file, profile)) - 1).max() < 0.05
    file.write_text(file.read_text().replace("M900 K0\n", "M900 K0.05\n"))
    assert np.abs(sections(context_of(file, profile)) - 1).max() > 0.3
    assert off(file, profile) > 0


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_none_is_said_of_it_where_the_profile_has_none(firmware: str, tmp_path: Path) -> None:
    text = written(tmp_path, firmware, 0.0).read_text()
    assert "advance" not in text
    assert "M900" not in text
    assert "M572" not in text
    assert "ADVANCE" not in text
