"""Limits that a program changes while it runs, as each firmware reads them."""

import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.judge import judge

CRAWL = "G28\nG90\n{}\nG1 X0 Y0 Z20 B0 C0 F6000\nG1 X0.01 C10 F0.6\n"
"""0.01 mm at 0.6 mm a minute: a second, during which the platter turns by ten degrees."""


TURN = 2 * (10 / 2000) ** 0.5
"""s that ten degrees take at 2000 degrees/s², up and down again."""


@pytest.mark.parametrize(("command", "seconds"), [("M203 I0.06", 1.0), ("", TURN)])
def test_repraps_minimum_speed_speeds_up_tiny_moves_until_m203_i_lowers_it(tmp_path, command, seconds):
    program = tmp_path / "crawl.gcode"
    program.write_text(CRAWL.format(command))
    report = judge(program, load_profile("open5x_voron0"))
    last = report.trace.time[-1] - report.trace.time[-2]
    assert last == pytest.approx(seconds, rel=0.06)


def test_marlins_own_minimum_stays_whatever_m203_says(tmp_path):
    program = tmp_path / "crawl.gcode"
    times = []
    for command in ("", "M203 I0.06"):
        program.write_text(CRAWL.format(command).replace("B0 C0", "A0 B0").replace("C10", "B10"))
        time = judge(program, load_profile("generic_ab_cradle")).trace.time
        times.append(time[-1] - time[-2])
    assert times[0] == times[1]
    # 0.05 mm/s over 0.01 mm, and the ramps
    assert times[0] == pytest.approx(0.2, rel=0.15)
