"""A bead that hangs is in the air, in an opening, or a bridge: by what is at its ends and sides, not by its name."""

from pathlib import Path

import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.judge import judge

PER_MM = 0.0419
"""mm of filament of 1.75 mm for a mm of a bead 0.4 wide and 0.3 high."""
LAYERS = 8
"""Of the two walls that beads hang between: deep enough that nothing below is within reach."""


@pytest.fixture(scope="module")
def cradle() -> MachineProfile:
    return load_profile("generic_ab_cradle")


def between_walls(apart: float, bead: tuple[float, float], role: str) -> list[str]:
    """Two walls along Y, `apart` mm from middle to middle, then a bead along X from one place to the other."""
    text = ["; machine = generic_ab_cradle", "G21", "G90", "M83", "G28", "M104 S210", "M109 S210"]
    text += [";WIDTH:0.4", ";HEIGHT:0.3", ";SPEED:20"]
    for k in range(LAYERS):
        for x in (0.0, apart):
            text += [";ROLE:travel", f"G0 Z{LAYERS * 0.3 + 1:.2f} F600", f"G0 X{x} Y-4 A0 B0 F6000"]
            text += [f"G0 Z{(k + 1) * 0.3:.2f} F600", ";ROLE:outer_wall", f"G1 Y4 E{8 * PER_MM:.5f} F1200"]
    z = LAYERS * 0.3 + (0.3 if bead[0] <= 0 else 0.0)
    text += [";ROLE:travel", f"G0 Z{z + 1:.2f} F600", f"G0 X{bead[0]} Y0 F6000", f"G0 Z{z:.2f} F600"]
    text += [f";ROLE:{role}", f"G1 X{bead[1]} E{(bead[1] - bead[0]) * PER_MM:.5f} F1200"]
    return [*text, ";ROLE:travel", "G0 Z30 F600", "M104 S0", "M84", ""]


def hanging(path: Path, program: list[str], profile: MachineProfile) -> set[str]:
    path.write_text("\n".join(program), encoding="utf-8")
    return set(judge(path, profile).counts) & {"bead-in-air", "hanging-bead", "long-bridge"}


@pytest.mark.parametrize("role", ["solid_infill", "infill", "outer_wall", "nonplanar_infill"])
@pytest.mark.parametrize(
    ("apart", "bead", "expected"),
    [
        (5.0, (0.0, 5.0), set()),
        (15.0, (0.0, 15.0), set()),
        (30.0, (0.0, 30.0), {"long-bridge"}),
        (5.0, (1.0, 4.0), {"hanging-bead"}),
        (9.0, (3.0, 6.0), {"bead-in-air"}),
        (12.0, (1.0, 11.0), {"bead-in-air"}),
    ],
)
def test_what_a_bead_between_two_walls_is(
    role: str, apart: float, bead: tuple[float, float], expected: set[str], tmp_path: Path, cradle: MachineProfile
) -> None:
    assert hanging(tmp_path / "walls.gcode", between_walls(apart, bead, role), cradle) == expected


def test_a_short_bead_beside_the_part_is_in_the_air(tmp_path: Path, cradle: MachineProfile) -> None:
    program = between_walls(5.0, (8.0, 11.5), "infill")
    assert hanging(tmp_path / "beside.gcode", program, cradle) == {"bead-in-air"}
