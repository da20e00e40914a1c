"""Every shipped machine loads; every kind of mistake in a profile gets its own sentence."""

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.errors import ProfileError
from trunnion_core.profile import load_profile, shipped_profiles

PROFILES = Path(__file__).parents[2] / "machine_profiles"

GOOD = """
[machine]
name = "Test"
firmware = "marlin"
[[joint]]
letter = "X"
side = "tool"
type = "linear"
axis = [2, 0, 0]
min = 0
max = 100
speed = 100
acceleration = 1000
[[joint]]
letter = "Y"
side = "work"
type = "linear"
axis = [0, -1, 0]
min = 0
max = 100
speed = 100
acceleration = 1000
[[joint]]
letter = "Z"
side = "tool"
type = "linear"
axis = [0, 0, 1]
min = 5
max = 100
speed = 10
acceleration = 100
[[joint]]
letter = "B"
side = "work"
type = "rotary"
axis = [0, 1, 0]
point = [0, 0, -20]
min = -90
max = 90
speed = 180
acceleration = 900
steps_per_unit = 20
[[joint]]
letter = "C"
side = "work"
type = "rotary"
axis = [0, 0, 1]
point = [0, 0, 0]
speed = 180
acceleration = 900
[work]
bed = { shape = "circle", diameter = 100, height = 80 }
"""


def written(folder, text, name="machine.toml"):
    path = folder / name
    path.write_text(text)
    return path


def refused(folder, *changes):
    """The problems of the good profile after replacing texts in it."""
    text = GOOD
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(ProfileError) as error:
        load_profile(written(folder, text))
    return error.value.problems


@pytest.mark.parametrize("name", shipped_profiles())
def test_a_shipped_machine_loads_and_makes_sense(name):
    profile = load_profile(name)
    assert len(profile.joints) == (3 if name == "generic_3axis" else 5)
    assert (profile.array("speed") <= np.where(profile.to_shown > 1, math.radians(360), 500)).all()
    assert (profile.array("home") >= profile.array("min")).all()
    assert (profile.array("home") <= profile.array("max")).all()
    assert profile.tool_bodies
    assert min(getattr(solid, "bottom", None) or 0.0 for solid in profile.tool_bodies) == 0.0
    assert profile.assumed
    letters = {f"joint.{letter}" for letter in profile.letters}
    tables = {"joint", "tool", "work", "body", "extruder", "heaters", "planner"}
    for key in profile.assumed:
        assert key.partition(".")[0] in tables
        assert not key.startswith("joint.") or key.rpartition(".")[0] in letters


@pytest.mark.parametrize("name", shipped_profiles())
def test_a_shipped_machine_says_its_own_steps(name):
    table = tomllib.loads((PROFILES / f"{name}.toml").read_text(encoding="utf-8"))
    assert all("steps_per_unit" in joint for joint in table["joint"])


def test_the_five_of_the_design_are_shipped():
    assert list(shipped_profiles()) == [
        "generic_3axis",
        "generic_ab_cradle",
        "open5x_prusa_i3",
        "open5x_voron0",
        "rep5x_ender3",
    ]


def test_degrees_become_radians_and_directions_unit(tmp_path):
    profile = load_profile(written(tmp_path, GOOD))
    x, y, z, b, c = profile.joints
    assert_allclose(x.axis, [1, 0, 0])
    assert (b.max, b.speed, b.steps_per_unit) == pytest.approx((math.pi / 2, math.pi, 20 * 180 / math.pi))
    assert (c.min, c.max) == (-math.inf, math.inf)
    assert (x.steps_per_unit, c.shown(1 / c.steps_per_unit)) == pytest.approx((80, 1 / 44.4444))
    assert (y.home, z.home) == (0.0, 5.0)
    assert profile.rotary == (3, 4)
    assert b.shown(b.max) == pytest.approx(90)
    assert profile.nozzle_flat_diameter == pytest.approx(0.8)


def test_a_missing_pivot_is_named(tmp_path):
    (problem,) = refused(tmp_path, ("point = [0, 0, -20]\n", ""))
    assert "joint B: point is missing" in problem
    assert "pivot" in problem


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("axis = [0, 1, 0]", "axis = [0, 0, -3]", r"rotary axes B and C are parallel"),
        ("min = -90\nmax = 90", "min = 90\nmax = -90", r"joint B: min 90 is not below max -90"),
        ("min = -90\n", "", r"joint B: min and max belong together"),
        ("min = 5\n", "", r"joint Z: min and max are needed"),
        ("axis = [2, 0, 0]", "axis = [0, 0, 0]", r"joint X: axis is zero"),
        ("axis = [2, 0, 0]", "axis = [0, 3, 0]", r"three linear axes lie in one plane"),
        ('letter = "C"', 'letter = "B"', r"letter B is used 2 times"),
        ('letter = "C"', 'letter = "E"', r"joint E: the letter E has another meaning"),
        ('letter = "C"', 'letter = "cc"', r"joint\[4\]\.letter: 'cc' is wrong"),
        ("axis = [2, 0, 0]", "axis = [2, 0, 0]\npoint = [0, 0, 0]", r"joint X: point belongs to rotary joints"),
        ("speed = 100", "speed = -1", r"joint\[0\]\.speed: -1 is wrong, should be greater than 0"),
        ("speed = 100", 'speed = "fast"', r"joint\[0\]\.speed: 'fast' is wrong"),
        ("speed = 100", "speed = nan", r"joint\[0\]\.speed: nan is wrong, should be a finite number"),
        ("speed = 100\n", "", r"joint\[0\]\.speed: is missing"),
        ("speed = 100", "sped = 100\nspeed = 100", r"joint\[0\]\.sped: unknown key, did you mean 'speed'\?"),
        ("[work]", "[wrok]\n[work]", r"wrok: unknown key, did you mean 'work'\?"),
        ("diameter = 100, ", "", r"a circle needs its diameter"),
        ('shape = "circle", diameter = 100', 'shape = "rectangle"', r"a rectangle needs min and max"),
        ('"circle", diameter = 100', '"rectangle", min = [0, 9], max = [5, 9]', r"is not below max"),
        ('name = "Test"\n', "", r"machine\.name: is missing"),
        ("[work]", "[tool]\naxis = [0, 0, 0]\n[work]", r"tool\.axis: is zero"),
        ("[work]", '[tool]\nbody = [{ shape = "blob", name = "b" }]\n[work]', r"tool\.body\[0\]"),
    ],
)
def test_each_mistake_has_its_sentence(tmp_path, old, new, sentence):
    problems = refused(tmp_path, (old, new))
    assert any(re.search(sentence, problem) for problem in problems), problems


def test_all_problems_come_at_once_each_with_the_file(tmp_path):
    problems = refused(tmp_path, ("speed = 100", "speed = 0"), ("[0, 0, -20]", "[0, 0]"), ('name = "Test"', "nam = 1"))
    assert len(problems) == 4
    with pytest.raises(ProfileError) as error:
        load_profile(written(tmp_path, "[machine]\n"))
    assert str(error.value).count("machine.toml: ") == len(error.value.problems) >= 3


def test_a_wrong_number_of_joints_is_refused(tmp_path):
    one_rotary = GOOD[: GOOD.index('[[joint]]\nletter = "C"')] + GOOD[GOOD.index("[work]") :]
    with pytest.raises(ProfileError, match="1 rotary joints, should be none or 2"):
        load_profile(written(tmp_path, one_rotary))


def test_a_profile_extends_a_shipped_one_or_a_file_beside_it(tmp_path):
    written(tmp_path, GOOD, "base.toml")
    child = written(tmp_path, 'extends = "base.toml"\n[machine]\nname = "Child"\n[tool]\nnozzle_diameter = 0.6\n')
    profile = load_profile(child)
    assert (profile.name, profile.firmware, profile.nozzle_diameter) == ("Child", "marlin", 0.6)
    cradle = load_profile(written(tmp_path, 'extends = "generic_ab_cradle"\n[work]\norigin = [1, 2, 3]\n', "b.toml"))
    assert_allclose(cradle.origin, [1, 2, 3])
    assert cradle.bed.diameter == 200


def test_profiles_that_extend_each_other_are_refused(tmp_path):
    written(tmp_path, 'extends = "b.toml"', "a.toml")
    with pytest.raises(ProfileError, match="circle"):
        load_profile(written(tmp_path, 'extends = "a.toml"', "b.toml"))


def test_what_is_no_profile_is_refused(tmp_path):
    with pytest.raises(ProfileError, match="did you mean 'generic_3axis'"):
        load_profile("generic_3axes")
    with pytest.raises(ProfileError, match="TOML"):
        load_profile(written(tmp_path, "[machine\n"))
