"""The judge's reader, interpreter, chain and replay: bad input, modal state, geometry, times."""

import math
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.errors import GcodeError
from trunnion_core.profile import load_profile
from trunnion_sim.chain import forward
from trunnion_sim.judge import context_of, judge
from trunnion_sim.reader import Reader

CRADLE = load_profile("generic_ab_cradle")
PLAIN = load_profile("generic_3axis")


def write(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_numbers_words_comments_and_checksums(tmp_path: Path) -> None:
    text = "N3 G1 X-1.25 Y+.5E2*" + str(_checksum("N3 G1 X-1.25 Y+.5E2")) + " ;TYPE:Skirt\nG43.4\n; a = b\n"
    path = tmp_path / "a.gcode"
    path.write_text(text)
    block = next(iter(Reader(path)))
    assert block.code.tolist() == [10, 434]
    assert block.flags.tolist() == [0, 0]
    assert bytes(block.word_letter) == b"XYE"
    assert block.word_value.tolist() == [-1.25, 0.5, 2.0]
    assert block.comments == ((1, b"TYPE:Skirt"), (3, b" a = b"))


def _checksum(text: str) -> int:
    total = 0
    for byte in text.encode():
        total ^= byte
    return total


def test_pieces_of_the_file_do_not_split_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trunnion_sim.reader.CHUNK", 7)
    path = write(tmp_path / "a.gcode", *(f"G1 X{i}.5 Y{i}" for i in range(50)))
    reader = Reader(path)
    lines = [
        (int(line), float(value))
        for block in reader
        for line, value in zip(block.line, block.word_value[::2], strict=True)
    ]
    assert lines == [(i + 1, i + 0.5) for i in range(50)]
    assert reader.end.lines == 50


def test_an_endless_line_is_one_finding_and_the_rest_is_read(tmp_path: Path) -> None:
    path = tmp_path / "long.gcode"
    with path.open("wb") as file:
        file.write(b"G28\n")
        file.truncate(30_000_000)
        file.seek(30_000_000)
        file.write(b"\nG0 X5 F600\n")
    report = judge(path, CRADLE)
    assert [(f.code, f.line, f.value) for f in report.findings] == [("line-too-long", 2, 30_000_000 - len("G28\n"))]
    assert report.trace.line.tolist() == [1, 3]


@pytest.mark.parametrize("content", [b"", b"; only a comment\n", b"\x00" * 5000, bytes(range(256)) * 40])
def test_what_is_no_program_is_one_clear_error(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "junk.gcode"
    path.write_bytes(content)
    with pytest.raises(GcodeError, match=r"junk\.gcode"):
        judge(path, CRADLE)


def test_binary_junk_inside_a_program_is_found_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "a.gcode"
    path.write_bytes(b"G28\nG0 X\x00\xff5\nG0 Y1 F600\n")
    found = [f for f in judge(path, CRADLE).findings if f.code == "unreadable"]
    assert [f.line for f in found] == [2]


def test_huge_numbers_move_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "a.gcode", "G28", "G0 X99999999999999999999999999 F600", "G0 X1")
    report = judge(path, CRADLE)
    assert "bad-number" in report.counts
    assert np.isfinite(report.trace.points).all()
    assert report.trace.line.tolist() == [1, 3]


def test_moves_of_kilometres_are_judged_at_once(tmp_path: Path) -> None:
    """Followed step by step past the part they would take minutes."""
    lines = [
        "G28",
        "M109 S200",
        "G1 Z0.2 F600",
        "G1 X10 E1",
        "G1 X9999999 Y-9999999 F9999999",
        "G1 X0 Y0 E9999999",
        "G1 X20 E9999999.1",
    ]
    report = judge(write(tmp_path / "a.gcode", *lines), PLAIN)
    assert "joint-limit" in report.counts
    assert np.isfinite(report.trace.points).all()


@pytest.mark.parametrize("way", ["X150 Y100", "X150 Y113", "X100 Y150", "X90 Y150"])
def test_cutting_long_beads_where_they_leave_the_field_changes_nothing_in_it(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = ["G28", "M83", "G1 X30 Y100 Z0.2 F6000", f"G1 {way} E4", "G1 Z5", "G1 X30 Y150", "G1 X30 Y20"]
    context = context_of(write(tmp_path / "a.gcode", *lines), PLAIN)
    bounds = np.array([-20.0, -12.0]), np.array([-10.0, -2.0])
    cut = context.lay_down(0.1, bounds)
    monkeypatch.setattr("trunnion_sim.context.LONG", np.inf)
    whole = context.lay_down(0.1, bounds)
    assert cut is not None
    assert whole is not None
    # steps of beads fall elsewhere, so that a cell at an edge may be on the other side of it
    assert np.mean(np.abs(cut.field.top - whole.field.top) > 0.02) < 2e-3
    assert cut.field.top.sum() == pytest.approx(whole.field.top.sum(), rel=0.01)


def test_modal_state(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.gcode",
        "G28", "G91", "G1 X1 F600", "G1 X1", "G90", "G20", "G1 X1 A10", "G21", "G92 Y5", "G1 Y6", "M83", "M221 S200",
        "G1 E1", "M82", "G92 E10", "G1 E10.5",
    )  # fmt: skip
    motion = context_of(path, CRADLE).motion
    x, y, a = (motion.joints[:, CRADLE.letters.index(letter)] for letter in "XYA")
    assert x[1:4].tolist() == [1.0, 2.0, 25.4]
    assert math.degrees(a[3]) == pytest.approx(10)
    assert y[4] == pytest.approx(1.0)
    assert motion.filament[-2:].tolist() == [2.0, 1.0]


def test_arcs_stay_on_their_circle(tmp_path: Path) -> None:
    path = write(tmp_path / "a.gcode", "G28", "G0 X50 Y50 F6000", "G3 X60 Y60 I0 J10 F1200", "G2 X50 Y50 R10")
    context = context_of(path, PLAIN)
    arc = context.motion.line == 3
    points = context.motion.joints[arc][:, [PLAIN.letters.index("X"), PLAIN.letters.index("Y")]]
    assert arc.sum() == math.ceil(10 * math.pi / 2)
    assert np.hypot(points[:, 0] - 50, points[:, 1] - 60) == pytest.approx(10)
    assert points[-1].tolist() == [60.0, 60.0]


def test_chain_agrees_with_rotations_written_out() -> None:
    rng = np.random.default_rng(3)
    joints = np.column_stack([rng.uniform(-50, 50, (40, 3)), rng.uniform(-1, 1, (40, 2))])
    points, axes = forward(CRADLE, joints)
    pivot = np.array([0.0, 0.0, -40.0])
    for (x, y, z, a, b), point, axis in zip(joints, points, axes, strict=True):
        about_x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
        about_y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
        turned = (about_x @ about_y).T
        assert point == pytest.approx(turned @ (np.array([x, y, z]) - pivot) + pivot, abs=1e-9)
        assert axis == pytest.approx(turned @ [0, 0, 1], abs=1e-12)


def test_one_move_takes_the_time_of_its_trapezoid(tmp_path: Path) -> None:
    path = write(tmp_path / "a.gcode", "G28", "M400", "G1 X100 F6000", "M400")
    replay = context_of(path, PLAIN).replay
    # from almost nothing to 100 mm/s at 2000 mm/s², and down again
    up = down = 100 / 2000
    flat = (100 - 2 * 100**2 / 4000) / 100
    assert replay.duration[1] == pytest.approx(up + flat + down, rel=1e-3)


def test_time_law_covers_the_way_and_is_continuous(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    moves = [f"G1 X{x:.3f} Y{y:.3f} F{f:.0f}" for x, y, f in rng.uniform([10, 10, 600], [90, 90, 9000], (200, 3))]
    context = context_of(write(tmp_path / "a.gcode", "G28", *moves), PLAIN)
    replay = context.replay
    rows = slice(1, None)
    up = (replay.cruise**2 - replay.entry**2) / (2 * replay.acceleration)
    down = (replay.cruise**2 - replay.exit**2) / (2 * replay.acceleration)
    assert (up + down <= replay.length + 1e-9)[rows].all()
    row, fraction, speed = replay.at(np.linspace(replay.begin[1], replay.time, 20001)[:-1])
    assert (np.diff(row) >= 0).all()
    inside = np.diff(row) == 0
    assert (np.diff(fraction)[inside] >= -1e-12).all()
    assert (speed <= replay.cruise[row] + 1e-9).all()
    ends = replay.at(replay.begin[rows] + replay.duration[rows] * (1 - 1e-9))
    assert ends[1] == pytest.approx(1.0, abs=1e-6)


def test_rotary_moves_are_measured_in_degrees_and_mixed_ones_in_millimetres(tmp_path: Path) -> None:
    path = write(tmp_path / "a.gcode", "G28", "G1 A10 F600", "G1 X3 Y4 A20")
    replay = context_of(path, CRADLE).replay
    assert replay.length[1:] == pytest.approx([10.0, 5.0])


def test_programs_of_other_slicers_name_their_roles(tmp_path: Path) -> None:
    lines = [
        "G28",
        ";LAYER:0",
        ";TYPE:WALL-OUTER",
        "G1 X1 F600",
        ";TYPE:FILL",
        "G1 X2",
        ";LAYER:1",
        ";TYPE:Top surface",
        "G1 X3",
    ]
    rows = context_of(write(tmp_path / "a.gcode", *lines), PLAIN).rows
    assert rows.role[1:].tolist() == [3, 5, 7]
    assert rows.layer.tolist() == [-1, 0, 0, 1]


def test_a_program_with_too_many_motions_is_one_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trunnion_sim.motion.MOST_BYTES", 330_000)
    path = tmp_path / "long.gcode"
    path.write_text("G28\nG90\n" + "G1 X1 F600\nG1 X2\n" * 600)
    with pytest.raises(GcodeError, match="more than 1,000 motions"):
        judge(path, load_profile("generic_3axis"))


def test_a_zero_that_moves_over_and_over_is_one_finding(tmp_path: Path) -> None:
    path = write(tmp_path / "offsets.gcode", "G28", *("G92 X0", "G1 X0.01 F600") * 500, "G92 Z3")
    found = {finding.axis: finding for finding in judge(path, PLAIN).findings if finding.code == "offset"}
    assert {axis: (finding.line, finding.count) for axis, finding in found.items()} == {"X": (2, 500), "Z": (1002, 1)}
    assert "500 times" in found["X"].message


def test_the_first_mode_that_is_undone_before_plastic_is_named(tmp_path: Path) -> None:
    lines = ["G28", "M83", "G91", "G90", "M83", "G1 X1 E0.1 F600", "G90", "M83", "G1 X2 E0.1", "G90", "G1 X3 E5"]
    report = judge(write(tmp_path / "modes.gcode", *lines), PLAIN)
    assert [finding.line for finding in report.findings if finding.code == "extruder-mode-undone"] == [10]
