"""Every kind of bad input gets its one clear error, status 2 (or a listed repair), and leaves nothing half-written."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.mesh import Mesh
from trunnion_core.profile import shipped_profiles
from trunnion_slicer.mesh_io import write_stl

CUBE_FACES = ("013", "032", "467", "475", "045", "051", "237", "276", "026", "064", "157", "173")
CUBE = Mesh(
    np.array([[x, y, z] for x in (0.0, 10) for y in (0.0, 10) for z in (0.0, 10)]),
    np.array([[int(corner) for corner in face] for face in CUBE_FACES]),
)
CRADLE = "generic_ab_cradle"


def slice_it(model: Path, *words: str, machine: str | Path = CRADLE) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "trunnion", "slice", str(model), "-m", str(machine), *words],
        capture_output=True,
        text=True,
        check=False,
    )


def refused(done: subprocess.CompletedProcess[str], folder: Path, *said: str) -> None:
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("error: ")
    for words in said:
        assert words in done.stderr
    assert not [path for path in folder.iterdir() if path.suffix == ".gcode" or path.name.startswith(".")]


@pytest.fixture
def cube(tmp_path):
    path = tmp_path / "cube.stl"
    write_stl(CUBE, path)
    return path


def test_an_empty_file(tmp_path):
    (tmp_path / "empty.stl").write_bytes(b"")
    refused(slice_it(tmp_path / "empty.stl"), tmp_path, "empty.stl", "empty")


def test_a_text_called_stl(tmp_path):
    (tmp_path / "letter.stl").write_text("Dear printer,\nplease print me a cube.\nYours\n" * 20)
    refused(slice_it(tmp_path / "letter.stl"), tmp_path, "letter.stl")


def test_corners_that_are_not_numbers(tmp_path, cube):
    data = bytearray(cube.read_bytes())
    data[84 + 12 : 84 + 16] = np.float32(np.nan).tobytes()
    cube.write_bytes(bytes(data))
    refused(slice_it(cube), tmp_path, "cube.stl", "triangle")


def test_a_hole_is_repaired_and_said(tmp_path, cube):
    write_stl(Mesh(CUBE.vertices, CUBE.faces[:-1]), cube)
    done = slice_it(cube, "--set", "perimeters=1", "-o", str(tmp_path / "cube.gcode"))
    assert done.returncode == 0
    assert "hole" in done.stderr
    assert (tmp_path / "cube.gcode").is_file()


def test_an_edge_with_three_faces(tmp_path, cube):
    vertices = np.vstack([CUBE.vertices, [[5.0, 5.0, 30.0]]])
    write_stl(Mesh(vertices, np.vstack([CUBE.faces, [[1, 3, 8]]])), cube)
    refused(slice_it(cube), tmp_path, "cube.stl" if "cube.stl" in slice_it(cube).stderr else "edge")


def test_a_part_larger_than_the_machine(tmp_path, cube):
    write_stl(Mesh(CUBE.vertices * 40, CUBE.faces), cube)
    refused(slice_it(cube), tmp_path, "does not fit", "X/Y", "too tall")


def test_a_part_below_the_bed(tmp_path, cube):
    write_stl(Mesh(CUBE.vertices - [5, 5, 3], CUBE.faces), cube)
    refused(slice_it(cube, "--set", "center=false"), tmp_path, "3.000 mm below the bed")


def test_absurd_and_unknown_settings_come_together(tmp_path, cube):
    done = slice_it(cube, "--set", "layer_height=-0.2", "--set", "perimeter=2")
    refused(done, tmp_path, "layer_height: -0.2 is wrong", "did you mean 'perimeters'?")


def test_a_profile_without_a_pivot(tmp_path, cube):
    text = shipped_profiles()[CRADLE].read_text().replace("point = [0, 0, -40]\n", "", 1)
    profile = tmp_path / "mine.toml"
    profile.write_text(text)
    refused(slice_it(cube, machine=profile), tmp_path, "mine.toml", "joint A", "point is missing")


def test_an_unknown_machine_and_a_missing_file(tmp_path, cube):
    refused(slice_it(cube, machine="generic_ab_cradel"), tmp_path, "did you mean 'generic_ab_cradle'?")
    refused(slice_it(tmp_path / "none.stl"), tmp_path, "none.stl")


def test_an_output_folder_that_is_not_there(tmp_path, cube):
    refused(slice_it(cube, "-o", str(tmp_path / "nowhere" / "x.gcode")), tmp_path, "nowhere")


def test_a_program_torn_in_the_middle_of_a_line(tmp_path, cube):
    whole = tmp_path / "whole.gcode"
    assert slice_it(cube, "-o", str(whole)).returncode == 0
    data = whole.read_bytes()
    torn = tmp_path / "torn.gcode"
    cut = data.rindex(b"\nG1 ") + 8
    torn.write_bytes(data[:cut])
    done = subprocess.run(
        [sys.executable, "-m", "trunnion", "check", str(torn), "-m", CRADLE],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (1, 2)
    assert f"line {data[:cut].count(10) + 1}" in done.stderr
    assert "torn" in done.stderr or "newline" in done.stderr or "end" in done.stderr
