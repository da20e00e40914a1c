"""Flow at any instant: filament in step with speed, ahead of it by pressure advance, and none lost over a line."""

from pathlib import Path

import numpy as np
import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.advance import own_advance, pushed
from trunnion_sim.judge import context_of

PROFILE = load_profile("generic_ab_cradle")
LINE = [
    "M302 P1",
    "M83",
    "G1 X10 F3000",
    "M400",
    "G1 X60 E2 F3000",
    "M400",
    "G1 E-1 F1800",
    "G1 E1 F1800",
    "G1 A20 E0.5 F1200",
]


def rates(folder: Path, program: list[str], row: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, flow and the advance of rows over one row of a program."""
    file = folder / "line.gcode"
    file.write_text("\n".join(program) + "\n")
    context = context_of(file, PROFILE)
    begin, duration = context.replay.begin[row], context.replay.duration[row]
    times = begin + (np.arange(20000) + 0.5) / 20000 * duration
    pushes = pushed(context.replay, context.motion, PROFILE, context.rules, times)
    return times, pushes, own_advance(context.motion, PROFILE, context.rules)


@pytest.mark.parametrize("seconds", [0.0, 0.05])
def test_the_volume_of_a_line_is_the_integral_of_its_flow(seconds: float, tmp_path: Path) -> None:
    times, rate, _ = rates(tmp_path, [f"M900 K{seconds}", *LINE], 1)
    assert rate.mean() * (times[-1] - times[0]) == pytest.approx(2 * PROFILE.filament_area, rel=1e-3)


def test_advance_pushes_more_while_speeding_up_and_draws_back_while_braking(tmp_path: Path) -> None:
    times, plain, _ = rates(tmp_path, LINE, 1)
    _, ahead, _ = rates(tmp_path, ["M900 K0.05", *LINE], 1)
    extra = (ahead - plain) / PROFILE.filament_area
    limit = 2 / 50 * 0.05 * PROFILE.joints[0].acceleration
    quarter = len(times) // 400
    assert extra[quarter] == pytest.approx(limit, rel=1e-6)
    assert extra[-quarter] == pytest.approx(-extra[quarter], rel=1e-6)
    assert extra[len(times) // 2] == 0.0
    assert plain[len(times) // 2] == pytest.approx(50 * 2 / 50 * PROFILE.filament_area, rel=1e-3)


def test_retractions_and_rows_that_only_turn_get_none(tmp_path: Path) -> None:
    _, retract, seconds = rates(tmp_path, ["M900 K0.05", *LINE], 2)
    assert (retract < 0).all()
    np.testing.assert_array_equal(seconds, [0.0, 0.05, 0.0, 0.0, 0.0])


def test_the_program_may_change_it_on_the_way(tmp_path: Path) -> None:
    program = ["M83", "G1 X10 E1 F3000", "M900 K0.02", "G1 X20 E1", "M900 K0", "G1 X30 E1"]
    _, _, seconds = rates(tmp_path, program, 0)
    np.testing.assert_array_equal(seconds, [0.0, 0.02, 0.0])
