"""What a program says that its plan relies on is held against the profile, in the words of every firmware."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_sim.judge import judge
from trunnion_sim.stated import RELIES, stated_limits

SHIPPED = load_profile("open5x_voron0")
PATH = SHIPPED.planner.model_copy(update={"acceleration": 3000.0, "travel_acceleration": 4000.0})
VORON = dataclasses.replace(SHIPPED, planner=PATH)


def stated_by(profile: MachineProfile) -> list[str]:
    lines = find_dialect(profile.firmware).setup(profile)
    return [line.removeprefix("; ").removeprefix(RELIES) for line in lines if line.startswith("; " + RELIES)]


@pytest.mark.parametrize("firmware", dialect_names())
def test_every_dialects_own_words_agree_with_its_profile(firmware: str) -> None:
    profile = dataclasses.replace(VORON, firmware=firmware)
    found = list(stated_limits(stated_by(profile), profile))
    axes = {stated.axis for stated in found}
    assert axes >= ({"B", "C", "Z", "E"} if firmware == "klipper" else {*profile.letters, "E"})
    assert [s.value for s in found] == pytest.approx([s.profile for s in found], rel=1e-4)


@pytest.mark.parametrize("firmware", dialect_names())
def test_a_slower_table_is_noticed(firmware: str) -> None:
    profile = dataclasses.replace(VORON, firmware=firmware)
    slower = tuple(dataclasses.replace(j, speed=j.speed * 0.9) if j.letter == "C" else j for j in profile.joints)
    here = dataclasses.replace(profile, joints=slower)
    wrong = [s for s in stated_limits(stated_by(profile), here) if not np.isclose(s.value, s.profile, rtol=0.01)]
    assert [(s.axis, s.what) for s in wrong] == [("C", "speed")]
    assert wrong[0].value == pytest.approx(wrong[0].profile / 0.9)


def test_the_finding_names_axis_stated_and_profile_value(tmp_path: Path) -> None:
    profile = load_profile("generic_ab_cradle")
    path = tmp_path / "stated.gcode"
    head = [
        "; the plan relies on M201 X1..5 A",
        "; the plan relies on M204 P1500 T1500",
        "; the plan relies on M203 A90",
    ]
    path.write_text("\n".join([*head, "G21", "G90", "G28", "G0 X1 F600"]) + "\n")
    found = [f for f in judge(path, profile).findings if f.code == "other-limits" and f.axis == "A"]
    assert [(f.value, f.limit) for f in found] == [(90.0, profile.joints[3].shown(profile.joints[3].speed))]
    assert "90" in found[0].message
