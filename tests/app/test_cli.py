"""The command line: quick, clear, and leaving nothing half-written."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from trunnion.cli import COMMANDS
from trunnion_core.profile import load_profile

HEAVY = {"numpy", "scipy", "trimesh", "numba", "matplotlib", "pydantic", "shapely", "manifold3d"}


def trunnion(*words: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "trunnion", *map(str, words)], capture_output=True, text=True, cwd=cwd, check=False
    )


@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)], ids=lambda words: words[0])
def test_help_answers_without_a_heavy_import(words):
    script = (
        "import sys\nfrom trunnion.cli import main\n"
        f"try:\n    main({words!r})\nexcept SystemExit as leaving:\n    status = leaving.code\n"
        f"print(sorted(set(sys.modules) & {HEAVY!r}), status)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[] 0"


def test_every_command_of_the_table_has_a_help_line_of_its_own():
    for name in COMMANDS:
        assert f"trunnion {name} " in trunnion(name, "--help").stdout.replace("python -m trunnion", "trunnion")


def test_an_unknown_command_is_misuse():
    done = trunnion("slize")
    assert done.returncode == 2
    assert "slize" in done.stderr


def test_machines_lists_every_shipped_profile():
    listed = trunnion("machines").stdout
    for name in ("generic_3axis", "generic_ab_cradle", "open5x_prusa_i3", "open5x_voron0", "rep5x_ender3"):
        assert name in listed


def test_forward_undoes_inverse_in_files_and_degrees(tmp_path):
    profile = load_profile("generic_ab_cradle")
    rng = np.random.default_rng(1)
    axes = np.column_stack([rng.uniform(-0.4, 0.4, (50, 2)), np.ones(50)])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    points = rng.uniform(-30, 30, (50, 3))
    np.savez(tmp_path / "poses.npz", points=points, tool_axes=axes)
    assert (
        trunnion("inverse", "-m", "generic_ab_cradle", tmp_path / "poses.npz", "-o", tmp_path / "j.npz").returncode == 0
    )
    inverse = np.load(tmp_path / "j.npz")
    assert inverse["joints"].shape == (2, 50, 5)
    assert inverse["reachable"].all()
    angles = inverse["joints"][:, :, list(profile.rotary)]
    assert 5 < np.abs(angles).max() <= 180
    for branch in inverse["joints"]:
        np.savez(tmp_path / "branch.npz", joints=branch)
        done = trunnion("forward", "-m", "generic_ab_cradle", tmp_path / "branch.npz", "-o", tmp_path / "back.npz")
        assert done.returncode == 0, done.stderr
        back = np.load(tmp_path / "back.npz")
        np.testing.assert_allclose(back["points"], points, rtol=0, atol=1e-9)
        np.testing.assert_allclose(back["tool_axes"], axes, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"points": np.zeros((3, 3))}, "tool_axes: is missing"),
        ({"points": np.zeros((3, 2)), "tool_axes": np.ones((3, 3))}, "points: shape (3, 2)"),
        ({"points": np.zeros((3, 3)), "tool_axes": np.zeros((3, 3))}, "row 0 is zero"),
        ({"points": np.full((3, 3), np.nan), "tool_axes": np.ones((3, 3))}, "should be finite"),
        ({"points": np.zeros((3, 3)), "tool_axes": np.ones((2, 3))}, "2 rows, should be 3"),
    ],
    ids=["missing", "shape", "no direction", "not a number", "unequal"],
)
def test_inverse_refuses_bad_arrays_in_one_sentence(tmp_path, arrays, said):
    np.savez(tmp_path / "in.npz", **arrays)
    done = trunnion("inverse", "-m", "generic_ab_cradle", tmp_path / "in.npz", "-o", tmp_path / "out.npz")
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["in.npz"]


def running_sim(*words: str | Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "trunnion", "sim", "-m", "generic_ab_cradle", *map(str, words)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("wire", ["pty", "tcp"])
def test_one_process_prints_through_the_wire_on_another(tmp_path, wire):
    program = tmp_path / "square.gcode"
    program.write_text("G28\nG1 X10 Y0 Z5 A0 B0 F3000\n" + "G1 X10 Y10 F1200\nG1 X0 Y10\nG1 X0 Y0\nG1 X10 Y0\n" * 50)
    link = tmp_path / "printer"
    where = ("--pty", link, "--fault", "flip-up:p=0.002") if wire == "pty" else ("--tcp", "127.0.0.1:0")
    sim = running_sim(*where, "--speed", "max")
    try:
        assert sim.stderr is not None
        place = sim.stderr.readline().removeprefix("listening on ").strip()
        port = link if wire == "pty" else f"tcp://{place}"
        done = trunnion("print", program, "-m", "generic_ab_cradle", "--port", port)
    finally:
        sim.terminate()
        sim.communicate(timeout=30)
    assert done.returncode == 0, done.stderr
    assert "202 lines executed" in done.stdout
    assert not link.is_symlink()


def test_printing_to_no_printer_is_one_sentence(tmp_path):
    program = tmp_path / "a.gcode"
    program.write_text("G28\n")
    done = trunnion("print", program, "-m", "generic_ab_cradle", "--port", tmp_path / "nothing")
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "nothing" in done.stderr


def test_a_wrong_fault_and_a_wrong_factor_are_misuse(tmp_path):
    for words in (["--fault", "gremlins"], ["--speed", "-1"]):
        done = trunnion("sim", "-m", "generic_ab_cradle", "--pty", tmp_path / "p", *words)
        assert done.returncode == 2
        assert words[1] in done.stderr


def test_ctrl_c_stops_the_print_cleanly_and_says_so(tmp_path):
    """The machine moves for minutes; the interrupt comes when the first lines are on their way."""
    program = tmp_path / "long.gcode"
    program.write_text("G92 X0 Y0 Z0 A0 B0\n" + "G1 X50 F600\nG1 X0\n" * 200)
    link = tmp_path / "printer"
    sim = running_sim("--pty", link, "--speed", "50")
    try:
        assert sim.stderr is not None
        sim.stderr.readline()
        command = [
            sys.executable,
            "-m",
            "trunnion",
            "print",
            str(program),
            "-m",
            "generic_ab_cradle",
            "--port",
            str(link),
        ]
        host = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        with pytest.raises(subprocess.TimeoutExpired):
            host.communicate(timeout=5)
        host.send_signal(signal.SIGINT)
        _, said = host.communicate(timeout=60)
    finally:
        sim.terminate()
        sim.communicate(timeout=30)
    assert host.returncode == 1
    assert "stopped after" in said
    assert "Traceback" not in said
