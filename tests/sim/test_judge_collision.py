"""A collision of every kind of pair, planted in a good program, is found by the judge: which bodies, on which line."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from collision_oracle import box

from trunnion_core.profile import profile_from_file, shipped_profiles
from trunnion_core.profile_file import ProfileFile
from trunnion_sim.judge import judge

TOWER = 15.0
"""mm: a thin wall along X, printed first, with the head well above it in the end."""
BODIES = {
    "gantry": {"carried_by": "X", "solid": box("gantry", [60, -20, 3], [70, 20, 9])},
    "table": {"carried_by": "B", "solid": box("table", [95, -10, -20], [125, 10, -6]), "touches": ["bed"]},
    "low beam": {"carried_by": "frame", "solid": box("low beam", [-10, 100, 20], [10, 120, 40])},
    "inner beam": {"carried_by": "frame", "solid": box("inner beam", [55, 0, 50], [80, 10, 80])},
    "near beam": {"carried_by": "frame", "solid": box("near beam", [-5, -30, 5], [15, -20, 9])},
}
CLAMPS = {
    "clamp": box("clamp", [-45, -5, 0], [-35, 5, 50]),
    "far clamp": box("far clamp", [60, 60, 0], [66, 66, 30]),
}
PLANTED = {
    "nozzle tip enters the part": ["G0 X4 Y10", "G0 Z3", "G0 Y-10"],
    "heater block enters the part": ["G0 X4 Y-30", "G0 Z1", "G0 Y-14"],
    "nozzle tip enters bed": ["G0 X50 Y50", "G0 Z-1"],
    "carriage enters bed": ["G0 X60 Y20", "G0 A58", "G0 Z-20"],
    "gantry enters the part": ["G0 X-55"],
    "near beam enters the part": ["G0 A40"],
    "nozzle tip enters table": ["G0 X115", "G0 Z-10"],
    "heater block enters cradle arm": ["G0 Y-140", "G0 Z-50", "G0 Y-128"],
    "nozzle tip enters cradle arm": ["G0 X0 Y113.5", "G0 Z-26"],
    "nozzle enters frame post": ["G0 X140 Y-30", "G0 Z-30", "G0 Y-22"],
    "heat sink enters clamp": ["G0 X-15 Y0", "G0 Z1", "G0 X-24"],
    "cradle arm enters low beam": ["G0 A58"],
    "inner beam enters far clamp": ["G0 A40"],
}


def wall() -> list[str]:
    """A wall of one bead, 8 mm long."""
    text = ["; machine = generic_ab_cradle", "G21", "G90", "M83", "G28", "M104 S210", "M109 S210"]
    text += ["G0 X0 Y0 F6000", "G0 Z8 F2000"]
    for k, z in enumerate(np.arange(0.3, TOWER + 0.1, 0.3)):
        text += [";LAYER_CHANGE", ";WIDTH:0.4", ";HEIGHT:0.3", ";ROLE:travel", f"G0 Z{z:.4f} F2000"]
        text += [";ROLE:outer_wall", f"G1 X{8 if k % 2 == 0 else 0} E0.35 F2400"]
    return [*text, ";ROLE:travel", "G0 Z120 F2000"]


@pytest.mark.parametrize("kind", PLANTED)
def test_it_is_found_and_the_program_without_it_is_free(kind: str, tmp_path: Path) -> None:
    data = tomllib.loads(shipped_profiles()["generic_ab_cradle"].read_text())
    data["body"] += [body for name, body in BODIES.items() if name in kind]
    data["work"]["body"] = [clamp for name, clamp in CLAMPS.items() if kind.endswith(f"enters {name}")]
    profile = profile_from_file(ProfileFile.model_validate(data), "test")
    good, bad = wall(), [*wall(), *(f"{line} F2000" for line in PLANTED[kind])]
    path = tmp_path / "program.gcode"
    path.write_text("\n".join([*good, ""]))
    assert [found for found in judge(path, profile).findings if found.code == "collision"] == []
    path.write_text("\n".join([*bad, ""]))
    collisions = [found for found in judge(path, profile).findings if found.code == "collision"]
    assert any(found.message.startswith(f"{kind} at (") for found in collisions), collisions
    assert {found.line for found in collisions} == {len(bad)}
