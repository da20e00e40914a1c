"""Settings come from file and words; every kind of mistake gets its own sentence."""

import math

import pytest

from trunnion_core.errors import SettingsError
from trunnion_core.settings_file import load_settings


def test_words_win_over_the_file_and_the_file_over_defaults(tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("layer_height = 0.3\nperimeters = 4\n")
    settings = load_settings(path, ["perimeters=1", "center = false", "fill_density=35%"])
    assert (settings.layer_height, settings.perimeters, settings.center, settings.fill_density) == (0.3, 1, False, 35.0)
    assert settings.extrusion_width == 0.4


def test_what_is_left_out_follows_from_what_is_given():
    settings = load_settings(words=["layer_height=0.3", "extrusion_width=0.4"])
    assert settings.max_angle_deg == pytest.approx(36.8699, abs=1e-4)
    assert math.tan(math.radians(settings.max_angle_deg)) == pytest.approx(0.75)
    assert (settings.first_height, settings.first_width) == (0.3, 0.4)
    assert load_settings(words=["nonplanar_max_angle=0"]).max_angle_deg == 0
    assert load_settings(words=["first_layer_height=0.25"]).first_height == 0.25


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("layer_height=-0.2", "layer_height: -0.2 is wrong, should be greater than 0"),
        ("layer_heigth=0.2", "layer_heigth: unknown key, did you mean 'layer_height'"),
        ("perimeters=1.5", "perimeters: 1.5 is wrong"),
        ("fill_density=140", "fill_density: 140 is wrong, should be less than or equal to 100"),
        ("nonplanar_max_angle=90", "nonplanar_max_angle: 90 is wrong, should be less than 90"),
        ("nonplanar_tool_axis=sideways", "nonplanar_tool_axis: 'sideways' is wrong, should be 'normal' or 'vertical'"),
        ("layer_height=nan", "layer_height: nan is wrong, should be a finite number"),
        ("layer_height", "'layer_height' should be key=value"),
        ("=3", "'=3' should be key=value"),
    ],
)
def test_each_mistake_has_its_sentence(word, sentence):
    with pytest.raises(SettingsError) as error:
        load_settings(words=[word])
    assert sentence in str(error.value)


def test_all_problems_come_at_once():
    with pytest.raises(SettingsError) as error:
        load_settings(words=["layer_height=0", "nonsense=1", "perimeters=-1"])
    assert len(error.value.problems) == 3


def test_a_file_that_is_no_toml_or_absent_is_refused(tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("layer_height: 0.2")
    with pytest.raises(SettingsError, match="is not TOML"):
        load_settings(path)
    with pytest.raises(SettingsError, match="cannot be read"):
        load_settings(tmp_path / "absent.toml")
