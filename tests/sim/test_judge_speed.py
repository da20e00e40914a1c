"""Speed of the tip is judged row by row: a burst of a third of a millimetre counts."""

import dataclasses
from pathlib import Path

import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.judge import context_of, judge

STEP, WANTED = 0.1, 10.0
PER_MM = 0.04


def line(speeds: dict[int, float], step: float = STEP) -> list[str]:
    """One bead of 100 rows of `step` mm at WANTED, where `speeds` gives no other mm/s."""
    text = ["G21", "G90", "M83", "G28", "M104 S210", "M109 S210", "G0 X0 Y0 Z0.2 A0 B0 F3000"]
    text += [";LAYER_CHANGE", ";TYPE:Solid infill", ";ROLE:solid_infill", f";SPEED:{WANTED}"]
    rows = range(100)
    text += [f"G1 X{(i + 1) * step:.4f} E{step * PER_MM:.5f} F{60 * speeds.get(i, WANTED):.1f}" for i in rows]
    return [*text, ";ROLE:travel", "G0 Z30 F1000", "M104 S0", "M84"]


@pytest.mark.parametrize("firmware", ["marlin", "klipper", "reprapfirmware"])
@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_a_burst_over_three_tenths_of_a_millimetre_is_found(tmp_path: Path, firmware: str, factor: float) -> None:
    path = tmp_path / "burst.gcode"
    path.write_text("\n".join(line(dict.fromkeys((40, 41, 42), WANTED * factor))) + "\n")
    profile = load_profile("generic_ab_cradle")
    found = [
        f for f in judge(path, dataclasses.replace(profile, firmware=firmware)).findings if f.code == "tip-too-fast"
    ]
    assert bool(found) == (factor > 1)
    if found:
        first = line({}).index(";SPEED:10.0") + 2
        assert found[0].line is not None
        assert first + 40 <= found[0].line <= first + 42
        assert found[0].value == pytest.approx(15.0, rel=0.05)


def test_rows_that_marlin_joins_run_at_the_speed_of_the_last(tmp_path: Path) -> None:
    """Four steps each: two rows are one move, which takes the F of the second."""
    path = tmp_path / "joined.gcode"
    path.write_text("\n".join(line({41: 3 * WANTED}, step=0.05)) + "\n")
    profile = load_profile("generic_ab_cradle")
    context = context_of(path, profile)
    beads = context.feeds
    assert context.joined[beads].all()
    assert "tip-too-fast" in judge(path, profile).counts
    path.write_text("\n".join(line({40: 3 * WANTED}, step=0.05)) + "\n")
    assert "tip-too-fast" not in judge(path, profile).counts


@pytest.mark.parametrize(("firmware", "speed"), [("marlin", 9.9), ("klipper", 9.99)])
def test_marlin_reads_whole_percents(tmp_path: Path, firmware: str, speed: float) -> None:
    """`M220.cpp` and `M221.cpp` read integers, other firmwares take the fraction."""
    program = line({})
    first = program.index(";SPEED:10.0")
    path = tmp_path / "percent.gcode"
    path.write_text("\n".join([*program[:first], "M220 S99.9", "M221 S99.9", *program[first:]]) + "\n")
    context = context_of(path, dataclasses.replace(load_profile("generic_ab_cradle"), firmware=firmware))
    bead = context.feeds
    assert context.motion.feed[bead] == pytest.approx(speed)
    assert context.motion.filament[bead] == pytest.approx(STEP * PER_MM * speed / WANTED)
