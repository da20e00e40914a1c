"""Comments and habits of slicers nobody here wrote: roles, layers, sizes, modes of E, retraction, arcs."""

from pathlib import Path

import numpy as np
import pytest

from trunnion_core.bead import bead_area
from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_sim.judge import context_of, judge

PLAIN = load_profile("generic_3axis")
OUTER, INNER, SPARSE, SOLID, TOP, SKIRT = (
    *(Role.OUTER_WALL, Role.INNER_WALL, Role.INFILL),
    *(Role.SOLID_INFILL, Role.TOP_SOLID_INFILL, Role.SKIRT),
)
OTHER = -1

SAID: dict[str, dict[str, int]] = {
    "prusaslicer": {
        ";TYPE:External perimeter": OUTER,
        ";TYPE:Perimeter": INNER,
        ";TYPE:Overhang perimeter": OUTER,
        ";TYPE:Internal infill": SPARSE,
        ";TYPE:Solid infill": SOLID,
        ";TYPE:Top solid infill": TOP,
        ";TYPE:Bridge infill": SOLID,
        ";TYPE:Gap fill": INNER,
        ";TYPE:Skirt/Brim": SKIRT,
        ";TYPE:Support material": OTHER,
        ";TYPE:Custom": OTHER,
    },
    "orcaslicer": {
        ";TYPE:Outer wall": OUTER,
        ";TYPE:Inner wall": INNER,
        ";TYPE:Sparse infill": SPARSE,
        ";TYPE:Internal solid infill": SOLID,
        ";TYPE:Top surface": TOP,
        ";TYPE:Bottom surface": SOLID,
        ";TYPE:Brim": SKIRT,
    },
    "bambustudio": {
        "; FEATURE: Outer wall": OUTER,
        "; FEATURE: Inner wall": INNER,
        "; FEATURE: Sparse infill": SPARSE,
        "; FEATURE: Floating vertical shell": INNER,
        "; FEATURE: Prime tower": OTHER,
    },
    "cura": {
        ";TYPE:WALL-OUTER": OUTER,
        ";TYPE:WALL-INNER": INNER,
        ";TYPE:FILL": SPARSE,
        ";TYPE:SKIN": SOLID,
        ";TYPE:SKIRT": SKIRT,
        ";TYPE:SUPPORT": OTHER,
    },
    "ideamaker": {
        ";TYPE:WALL-OUTER": OUTER,
        ";TYPE:SOLID-FILL": SOLID,
        ";TYPE:GAP-FILL": INNER,
        ";TYPE:BRIDGE": SOLID,
    },
    "simplify3d": {
        "; feature outer perimeter": OUTER,
        "; feature solid layer": SOLID,
        "; feature infill": SPARSE,
        "; inner perimeter": INNER,
        "; external single extrusion": OUTER,
        "; skirt": SKIRT,
        "; support": OTHER,
    },
    "kisslicer": {
        "; 'Perimeter Path', 0.8 [feed mm/s], 42.5 [head mm/s]": OUTER,
        "; 'Loop Path', 0.8 [feed mm/s], 42.5 [head mm/s]": INNER,
        "; 'Solid Path', 0.8 [feed mm/s], 42.5 [head mm/s]": SOLID,
        "; 'Stacked Sparse Infill Path', 0.9 [feed mm/s]": SPARSE,
        "; 'Prime Pillar Path', 0.9 [feed mm/s]": OTHER,
    },
}
SIZES = {
    "prusaslicer": (";LAYER_CHANGE", ";Z:0.2", ";HEIGHT:0.2", ";WIDTH:0.48"),
    "bambustudio": ("; CHANGE_LAYER", "; Z_HEIGHT: 0.2", "; LAYER_HEIGHT: 0.2", "; LINE_WIDTH: 0.48"),
    "ideamaker": (";LAYER:0", ";Z:0.200", ";HEIGHT:0.200", ";WIDTH:0.480"),
    "simplify3d": ("; layer 1, Z = 0.200", "; tool H0.200 W0.480"),
}


def write(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("slicer", SAID)
def test_roles_are_understood(slicer: str, tmp_path: Path) -> None:
    lines = ["G28", "G1 Z0.2 F600"]
    for k, comment in enumerate(SAID[slicer]):
        lines += [comment, f"G1 X{k + 1}"]
    roles = context_of(write(tmp_path / "a.gcode", *lines), PLAIN).rows.role[2:]
    assert roles.tolist() == list(SAID[slicer].values())


@pytest.mark.parametrize("slicer", SIZES)
def test_layers_widths_and_heights_are_understood(slicer: str, tmp_path: Path) -> None:
    lines = ["G28", "G1 Z0.2 F600", *SIZES[slicer], "G1 X1"]
    rows = context_of(write(tmp_path / "a.gcode", *lines), PLAIN).rows
    assert (rows.layer[-1], rows.height[-1], rows.width[-1]) == (0, 0.2, 0.48)
    assert rows.layer[0] == -1


def test_kisslicers_layers_have_their_height(tmp_path: Path) -> None:
    lines = [
        "G28",
        "; BEGIN_LAYER_OBJECT z=0.25 z_thickness=0.25",
        "G1 X1 F600",
        "; BEGIN_LAYER_OBJECT z=0.45 z_thickness=0.20",
    ]
    rows = context_of(write(tmp_path / "a.gcode", *lines, "G1 X2"), PLAIN).rows
    assert rows.layer.tolist() == [-1, 0, 1]
    assert rows.height[1:].tolist() == [0.25, 0.2]


SECTION = float(bead_area(np.array(0.4), np.array(0.2)))


def square(feed: str) -> list[str]:
    """A square of 20 mm, first layer; `feed` turns mm³ into the value of an E word, added up where E is absolute."""
    per_side = 20 * SECTION
    e = {
        "absolute": lambda k: (k + 1) * per_side / PLAIN.filament_area,
        "relative": lambda k: per_side / PLAIN.filament_area,
    }
    e["volumetric"] = lambda k: (k + 1) * per_side
    corners = ["X120 Y100", "X120 Y120", "X100 Y120", "X100 Y100"]
    return [f"G1 {at} E{e[feed](k):.5f} F1200" for k, at in enumerate(corners)]


START = (
    'M862.3 P "MK3S"',
    "M862.1 P0.4",
    "G21",
    "G90",
    "G28",
    "M104 S210",
    "M109 S210",
    "G0 X100 Y100 Z5 F6000",
    "G1 Z0.2 F600",
)
SAYS = (";LAYER_CHANGE", ";TYPE:External perimeter", ";WIDTH:0.4", ";HEIGHT:0.2")
END = ("G1 Z30 F600", "M104 S0", "M84")


@pytest.mark.parametrize(
    ("mode", "feed"),
    [
        (("M82", "G92 E0"), "absolute"),
        (("M83",), "relative"),
        (("M82", "G92 E0", "M200 D1.75"), "volumetric"),
        (("M200 S1", "G92 E0"), "volumetric"),
        (("M200 D1.75", "M200 S0", "G92 E0"), "absolute"),
        (("M200 D1.75", "M200 D0", "G92 E0"), "absolute"),
    ],
)
def test_e_words_of_every_mode_feed_the_same_plastic(mode: tuple[str, ...], feed: str, tmp_path: Path) -> None:
    report = judge(write(tmp_path / "a.gcode", *START, *mode, *SAYS, *square(feed), *END), PLAIN)
    assert report.counts == {}
    assert report.volume == pytest.approx(80 * SECTION, rel=1e-3)


def test_firmware_retraction_feeds_nothing_by_itself(tmp_path: Path) -> None:
    lines = [*START, "M83", *SAYS, *square("relative"), "G10", "G0 X90 Y90 F6000", "G0 X100 Y100", "G11", *END]
    report = judge(write(tmp_path / "a.gcode", *lines), PLAIN)
    assert report.counts == {}
    assert report.volume == pytest.approx(80 * SECTION, rel=1e-3)


def test_a_circle_of_arcs_is_a_bead_like_any_other(tmp_path: Path) -> None:
    e = np.pi * 20 * SECTION / PLAIN.filament_area / 2
    arcs = [f"G2 X120 Y100 I10 J0 E{e:.5f} F1200", f"G2 X100 Y100 R10 E{e:.5f}"]
    report = judge(write(tmp_path / "a.gcode", *START, "M83", *SAYS, *arcs, *END), PLAIN)
    assert report.counts == {}
    laid = report.width > 0
    assert laid.sum() == 2 * np.ceil(np.pi * 10)
    assert report.width[laid] == pytest.approx(0.4, abs=2e-3)
