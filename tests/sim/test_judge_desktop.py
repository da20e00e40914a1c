"""Programs that desktop slicers wrote are understood and pass: roles, layers, filament, time, purge lines, scripts.

`prusaslicer_knob.gcode` was written by PrusaSlicer 2.5.0, `cura_knob.gcode` by CuraEngine 4.13.0 with the start and end
code of a common 3-axis printer: a plate of 7 x 6 x 1.2 mm with a knob of 3 mm up to z = 2, ten layers of 0.2 mm.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_sim.context import Context
from trunnion_sim.judge import context_of, judge

DATA = Path(__file__).parents[1] / "data"
PRUSA, CURA = DATA / "prusaslicer_knob.gcode", DATA / "cura_knob.gcode"
CURA_PURGE, PRUSA_PURGE = 30.0, 10.0
"""mm of filament in the start codes."""


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_profile("generic_3axis")


@pytest.fixture(scope="module", params=[PRUSA, CURA], ids=["prusaslicer", "cura"])
def program(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


@pytest.fixture(scope="module")
def context(program: Path, machine: MachineProfile) -> Context:
    return context_of(program, machine)


def test_it_passes(program: Path, machine: MachineProfile) -> None:
    assert [f for f in judge(program, machine).findings if f.code != "joint-speed-clamped"] == []


def test_every_bead_of_the_part_has_its_role(context: Context) -> None:
    roles = context.rows.role[context.feeds & ~context.priming]
    assert set(roles.tolist()) >= {Role.SKIRT, Role.OUTER_WALL, Role.INNER_WALL, Role.SOLID_INFILL}
    assert (roles >= 0).all()


def test_the_outer_walls_are_where_the_model_is(context: Context) -> None:
    """The knob stands at the origin of `part`: middle of the bed."""
    walls = context.feeds & (context.rows.role == Role.OUTER_WALL)
    low, high = context.points[walls].min(axis=0), context.points[walls].max(axis=0)
    np.testing.assert_allclose(low[:2], [-3.5, -3], atol=0.3)
    np.testing.assert_allclose(high, [3.5, 3, 2], atol=0.3)


def test_it_has_ten_layers_at_their_heights(context: Context) -> None:
    beads = context.feeds & ~context.priming
    for layer in range(10):
        z = context.points[beads & (context.rows.layer == layer), 2]
        np.testing.assert_allclose(z, 0.2 * (layer + 1), atol=1e-6)
    assert context.rows.layer.max() == 9


def test_purge_lines_belong_to_no_layer(context: Context, program: Path) -> None:
    purged = float(context.motion.filament[context.priming & context.feeds].sum())
    assert purged == pytest.approx(CURA_PURGE if program == CURA else PRUSA_PURGE)


def test_filament_is_what_prusaslicer_says(machine: MachineProfile) -> None:
    used = re.search(r"filament used \[mm\] = ([\d.]+)", PRUSA.read_text())
    assert used is not None
    motion = context_of(PRUSA, machine).motion
    retracted_at_the_end = 3.0
    assert motion.filament.sum() - PRUSA_PURGE + retracted_at_the_end == pytest.approx(float(used[1]), abs=0.05)


def test_time_is_what_prusaslicer_says(machine: MachineProfile) -> None:
    """Two firmware models that nobody made for each other, over the same limits."""
    said = re.search(r"estimated printing time \(normal mode\) = (\d+)s", PRUSA.read_text())
    assert said is not None
    assert judge(PRUSA, machine).time == pytest.approx(float(said[1]), rel=0.05)


def test_filament_is_the_last_e_of_cura(machine: MachineProfile) -> None:
    """Absolute E: the highest word since the last G92 E0, and the start code's own."""
    text = CURA.read_text()
    highest = max(float(e) for e in re.findall(r" E([\d.]+)", text[text.index(";LAYER:0") :]))
    motion = context_of(CURA, machine).motion
    fed = np.maximum.accumulate(np.cumsum(motion.filament))[-1]
    assert fed == pytest.approx(CURA_PURGE + highest, abs=1e-6)


def test_a_mistake_in_it_is_still_found(machine: MachineProfile, tmp_path: Path) -> None:
    """The tolerance for purge lines and soft bulges does not hide a travel through the part."""
    text = PRUSA.read_text()
    cut = text.index(";LAYER_CHANGE\n;Z:1.2")
    path = tmp_path / "low.gcode"
    path.write_text(text[:cut] + "G1 Z0.4 F600\nG1 X100 Y100 F6000\nG1 X120 Y120\n" + text[cut:])
    counts = judge(path, machine).counts
    assert "travel-through-print" in counts
    assert "collision" in counts


START = """M115 U3.13.2 ; tell printer latest fw version
M73 P0 R1
M413 S0
M486 S0
M17
T0
M201 X1000 Y1000 Z200 E5000
M204 P1250 R1250 T1250
M205 X8 Y8 Z0.4 E1.5
M220 S100
M221 S100
M140 S60
M105
M190 S60
M104 S215
G28 W ; home all without mesh bed level
G80
G34
M420 S1 Z10
M109 S215
G92 E0.0
M900 K0.05
M117 Printing X10 of 20: "hello"
M118 E1 started
M300 S440 P200
M0 Click to go on, at X5..5
M211 S1
G21
G17
G90
M82
G1 Z0.3 F600
G1 X60 E9 F1000
G10
G92 E0
M106 S255
M400
"""


def test_start_scripts_are_understood(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "start.gcode"
    path.write_text(START + "M104 S0\nM84 X Y E\n")
    assert judge(path, machine).counts == {}
