"""Moves that Klipper would end the print over are found; those that it lets pass are not (`check_move`)."""

import dataclasses
from pathlib import Path

import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.judge import judge

HEAD = ["G21", "G90", "M83", "G28", "M109 S210", "G0 X10 Y10 Z0.3 A0 B0 F3000"]


def refused(folder: Path, *lines: str, firmware: str = "klipper") -> int:
    file = folder / "bead.gcode"
    file.write_text("\n".join([*HEAD, *lines, ""]))
    return judge(file, dataclasses.replace(load_profile("generic_ab_cradle"), firmware=firmware)).counts.get(
        "extrusion-refused", 0
    )


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("G1 X11 E0.26 F600", 0),  # 0.625 mm², 4 x 0.4² are 0.64
        ("G1 X11 E0.27 F600", 1),  # 0.649 mm²
        ("G1 X10.2 E0.1 F600", 0),  # 1.2 mm², but less than 0.4 x 0.64 / 2.405 = 0.1064 mm of filament
        ("G1 X10.2 E0.11 F600", 1),
        ("G1 X10.3 Z0.7 E0.12 F600", 0),  # half a mm of way
        ("G1 Z0.4 A5 E0.5 F600", 0),  # neither X nor Y: only the extruder's own limits hold
        ("G1 X11 E-0.8 F600", 0),
    ],
)
def test_what_is_refused(line: str, count: int, tmp_path: Path) -> None:
    assert refused(tmp_path, line) == count
    assert refused(tmp_path, line, firmware="marlin") == 0


def test_what_the_head_asks_for_counts(tmp_path: Path) -> None:
    asked = "; the plan relies on [extruder] max_extrude_cross_section = 100 (the part turns)"
    assert refused(tmp_path, asked, "G1 X11 E30 F60") == 0
    assert refused(tmp_path, asked, "G1 X11 E49 F60") == 1
