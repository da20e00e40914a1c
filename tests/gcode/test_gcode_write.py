"""What was written reads back to the program: joints, filament, times; and nothing half-written is left."""

import dataclasses
import io
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import GcodeError, ProfileError
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.program import Event, MachineProgram
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_gcode.dialect import dialect_names, find_dialect
from trunnion_gcode.feed import speeds_read
from trunnion_gcode.moves import MERGE_DEVIATION, make_moves
from trunnion_gcode.write import write_program

SETTINGS = PrintSettings()
OF_JOINTS = [name for name in dialect_names() if not find_dialect(name).tip_words]
"""Dialects whose words are joints; of tips: tests/app/test_firmware_replay.py."""


def random_program(profile: MachineProfile, rows: int, seed: int = 0, events: tuple[Event, ...] = ()) -> MachineProgram:
    """Runs of 20 rows: a travel first, then beads, links and travels; a retraction at the end of each run."""
    random = np.random.default_rng(seed)
    k = len(profile.joints)
    step = random.normal(0, 0.3, (rows, k)) * (random.random((rows, k)) > 0.1) / profile.to_shown
    role = np.repeat(random.choice([0, 1, 2, 3, 4, 5, 8, 10], rows // 20 + 1), 20)[:rows].astype(np.int64)
    role[:2] = Role.TRAVEL
    role[19::20] = Role.RETRACT
    still = role == Role.RETRACT
    step[still] = 0.0
    start = np.zeros(k)
    length = np.linalg.norm(step, axis=1)
    beads = (role >= Role.SKIRT) & (role <= Role.NONPLANAR_INFILL)
    filament = np.where(beads, length * 0.0333, 0.0)
    filament[still] = -0.8
    speed = random.choice([20.0, 30.0, 50.0], rows)
    duration = np.where(still, 0.8 / 35, np.maximum(length, 1e-3) / speed)
    return MachineProgram(
        start=start,
        joints=start + np.cumsum(step, axis=0),
        duration=duration,
        filament=filament,
        role=role,
        layer=(np.arange(rows) // 200).astype(np.int64),
        width=np.where(beads, 0.4, 0.0),
        height=np.where(beads, 0.2, 0.0),
        tip_speed=np.where(still, 0.0, 30.0),
        tip_length=length,
        source=np.arange(rows),
        events=events,
    )


@dataclass
class Read:
    """What a firmware makes of the moves of a file."""

    joints: list[list[float]] = field(default_factory=list)
    filament: list[float] = field(default_factory=list)
    feed: list[float] = field(default_factory=list)
    command: list[str] = field(default_factory=list)
    other: list[str] = field(default_factory=list)


def read(text: str, letters: tuple[str, ...], start: list[float], extruder: str = "E", absolute: bool = False) -> Read:
    """Every G0/G1, with modal words filled in; other commands by themselves; G93's F is kept as written."""
    result = Read()
    state = dict(zip(letters, start, strict=True))
    feed = fed = 0.0
    for line in text.splitlines():
        code = line.split(";")[0].split()
        if not code:
            continue
        if code[0] not in ("G0", "G1"):
            result.other.append(" ".join(code))
            continue
        moved = 0.0
        for word in code[1:]:
            letter, value = word[0], float(word[1:])
            if letter == extruder:
                moved = value - fed if absolute else value
                fed = value if absolute else 0.0
            elif letter == "F":
                feed = value
            else:
                state[letter] = value
        result.joints.append([state[letter] for letter in letters])
        result.filament.append(moved)
        result.feed.append(feed)
        result.command.append(code[0])
    return result


def nist_seconds(found: Read, start: list[float], rotary: list[bool], threshold: float = 1e-3) -> FloatArray:
    """Seconds of every move when F is over XYZ, else degrees, else filament: written out once more, by itself."""
    step = np.diff(np.array([start, *found.joints]), axis=0)
    linear = np.sqrt((step[:, ~np.array(rotary)] ** 2).sum(axis=1))
    turned = np.sqrt((step[:, np.array(rotary)] ** 2).sum(axis=1))
    length = np.where(linear > threshold, linear, np.where(turned > 0, turned, np.abs(found.filament)))
    return np.asarray(60 * length / np.array(found.feed))


def cradle(firmware: str = "marlin") -> MachineProfile:
    return dataclasses.replace(load_profile("generic_ab_cradle"), firmware=firmware)


def written(program: MachineProgram, profile: MachineProfile, settings: PrintSettings = SETTINGS) -> str:
    out = io.StringIO()
    write_program(program, profile, settings, title="part", out=out)
    return out.getvalue()


@pytest.mark.parametrize("firmware", OF_JOINTS)
@pytest.mark.parametrize("seed", range(3))
def test_joints_and_filament_read_back(firmware: str, seed: int) -> None:
    profile = cradle(firmware)
    dialect = find_dialect(firmware)
    program = random_program(profile, 600, seed)
    found = read(
        written(program, profile), profile.letters, [0.0] * 5, dialect.extruder, not dialect.relative_extrusion
    )
    moves = make_moves(program, profile, dialect)
    assert len(found.joints) == len(moves.row)
    wanted = program.joints[moves.row] * profile.to_shown
    assert np.abs(np.array(found.joints) - wanted).max() <= 0.5e-4 + 1e-9
    assert math.isclose(sum(found.filament), program.filament.sum(), abs_tol=1e-5)
    fed = np.array(found.filament) != 0
    assert not fed[np.isin(program.role[moves.row], (0, 1))].any()


@pytest.mark.parametrize("firmware", ["marlin", "reprapfirmware"])
def test_times_under_the_firmwares_own_rule(firmware: str) -> None:
    profile = cradle(firmware)
    program = random_program(profile, 3000, 7)
    found = read(written(program, profile), profile.letters, [0.0] * 5)
    seconds = nist_seconds(found, [0.0] * 5, [joint.rotary for joint in profile.joints])
    moves = make_moves(program, profile, find_dialect(firmware))
    off = np.abs(seconds / moves.seconds - 1) > 0.02
    assert program.tip_length[moves.row][off].sum() <= 0.01 * program.tip_length.sum()
    assert math.isclose(seconds.sum(), program.duration.sum(), rel_tol=2e-3)


def ring(profile: MachineProfile, step_mm: float) -> MachineProgram:
    """Almost only rotary motion: X creeps by `step_mm` a row while A turns by half a degree in 10 ms."""
    rows = 400
    joints = np.zeros((rows, 5))
    joints[:, 0] = np.cumsum(np.full(rows, step_mm))
    joints[:, 3] = np.cumsum(np.full(rows, math.radians(0.05)))
    base = random_program(profile, rows)
    return dataclasses.replace(
        base,
        joints=joints,
        duration=np.full(rows, 0.01),
        filament=np.r_[0.0, np.full(rows - 1, 0.01)],
        role=np.r_[0, np.full(rows - 1, 10)].astype(np.int64),
        layer=np.zeros(rows, dtype=np.int64),
        tip_length=np.full(rows, 0.4),
    )


@pytest.mark.parametrize(
    ("firmware", "step_mm", "share"),
    [("linuxcnc", 0.00001, 0.99), ("linuxcnc", 0.0001, 0.99), ("linuxcnc", 0.0003, 0.99), ("marlin", 0.0001, 0.8)],
)
def test_linear_words_that_creep_beside_a_turn_do_not_drive_it(firmware: str, step_mm: float, share: float) -> None:
    """Firmwares read F no slower than a least speed; over 0.1 um in 0.3 s that would be a turn at several times F."""
    profile, dialect = cradle(firmware), find_dialect(firmware)
    program = ring(profile, step_mm)
    program = dataclasses.replace(program, duration=np.full(len(program), 0.3))
    moves = make_moves(program, profile, dialect)
    speed = np.maximum(speeds_read(moves, moves.asked, dialect), dialect.planner.slowest)
    turning = moves.word_step[:, 3] != 0
    late = np.cumsum(moves.word_step[:, 0]) - program.joints[moves.row, 0]
    assert np.abs(late).max() <= MERGE_DEVIATION + 1e-4
    as_planned = moves.metric[turning] / speed[turning] >= 0.999 * moves.asked[turning]
    assert as_planned.mean() > share


@pytest.mark.parametrize("step_mm", [0.0, 0.00003, 0.0004, 0.0009, 0.0011, 0.003])
def test_slow_linear_motion_beside_fast_rotary_motion_keeps_its_time(step_mm: float) -> None:
    profile = cradle()
    program = ring(profile, step_mm)
    found = read(written(program, profile), profile.letters, [0.0] * 5)
    seconds = nist_seconds(found, [0.0] * 5, [joint.rotary for joint in profile.joints])
    planned = make_moves(program, profile, find_dialect("marlin")).seconds
    assert np.abs(seconds / planned - 1).max() < 0.02
    assert math.isclose(sum(found.filament), program.filament.sum(), abs_tol=1e-5)


def test_merged_rows_stay_close_to_the_path_and_keep_time_and_filament() -> None:
    profile = cradle()
    base = random_program(profile, 2000, 3)
    angle = np.linspace(0, 3 * math.pi, 2000)
    joints = np.zeros((2000, 5))
    joints[:, 0], joints[:, 1] = 3 * np.cos(angle) - 3, 3 * np.sin(angle)  # rows of 0.014 mm: about one step
    program = dataclasses.replace(
        base,
        joints=joints,
        role=np.r_[0, np.full(1999, 5)].astype(np.int64),
        layer=np.zeros(2000, dtype=np.int64),
        filament=np.r_[0.0, np.full(1999, 0.0005)],
        width=np.full(2000, 0.4),
        tip_length=np.full(2000, 0.014),
        duration=np.full(2000, 0.001),
    )
    moves = make_moves(program, profile, find_dialect("marlin"))
    assert len(moves.row) < 1000
    assert math.isclose(moves.seconds.sum(), 2.0, rel_tol=1e-9)
    assert math.isclose(moves.filament.sum(), program.filament.sum(), abs_tol=1e-5)
    lumps = np.r_[np.full(1000, 0.2), np.full(1000, 0.3)]
    uneven = make_moves(dataclasses.replace(program, height=lumps), profile, find_dialect("marlin"))
    assert math.isclose(uneven.height.mean(), 0.25, abs_tol=2e-3)
    assert ((uneven.height > 0.201) & (uneven.height < 0.299)).sum() <= 1
    kept = moves.joint_ticks[:, :2] * 1e-4
    for start, end, first, last in zip(moves.row[:-1], moves.row[1:], kept[:-1], kept[1:], strict=True):
        along = (last - first) / np.linalg.norm(last - first)
        off = joints[start : end + 1, :2] - first
        assert np.abs(off[:, 0] * along[1] - off[:, 1] * along[0]).max() <= MERGE_DEVIATION + 2e-4


def test_the_first_move_says_every_joint_and_later_ones_only_what_changes() -> None:
    profile = cradle()
    program = random_program(profile, 40)
    text = [line for line in written(program, profile).splitlines() if line.startswith(("G0", "G1"))]
    assert all(letter in text[0] for letter in profile.letters)
    alone = dataclasses.replace(
        random_program(profile, 3),
        joints=np.array([[1.0, 0, 0, 0, 0], [2.0, 0, 0, 0, 0], [3.0, 0, 0, 0, 0]]),
        role=np.zeros(3, dtype=np.int64),
        filament=np.zeros(3),
        duration=np.full(3, 0.1),
    )
    lines = [line for line in written(alone, profile).splitlines() if line.startswith(("G0", "G1"))]
    assert lines == ["G0 X1 Y0 Z0 A0 B0 F600", "G0 X2", "G0 X3"]


def test_a_retraction_runs_at_the_speed_of_the_filament() -> None:
    profile = cradle()
    text = written(random_program(profile, 40), profile).splitlines()
    after = text[text.index(";ROLE:retract") :]
    assert next(line for line in after if line.startswith("G")) == "G1 E-0.8 F2100"


def test_same_input_same_bytes() -> None:
    profile = cradle()
    program = random_program(profile, 300)
    assert written(program, profile) == written(program, profile)


def test_header_and_tail_say_what_readers_look_for() -> None:
    text = written(random_program(cradle(), 300), cradle())
    lines = text.splitlines()
    assert lines[0].startswith("; generated by Trunnion ")
    assert "; generated by PrusaSlicer" in text[:10000]
    assert "; machine = generic_ab_cradle" in lines
    assert "; placement = 0 0 0" in lines
    assert "; layer_height = 0.2" in lines
    assert any(line.startswith("; estimated printing time (normal mode) = ") for line in lines)
    assert text.count(";LAYER_CHANGE") == 2
    assert "M73 P100 R0" in lines
    progress = [int(line.split()[1][1:]) for line in lines if line.startswith("M73")]
    assert progress == sorted(progress)
    assert len(progress) > 80


def test_heating_is_set_before_the_start_code_and_waited_for_after_it() -> None:
    lines = written(random_program(cradle(), 40), cradle(), PrintSettings(first_layer_temperature=215)).splitlines()
    order = [lines.index(line) for line in ("M140 S60", "M104 S215", "G28", "M190 S60", "M109 S215")]
    assert order == sorted(order)


def test_temperature_and_fan_change_after_the_first_layer() -> None:
    text = written(random_program(cradle(), 500), cradle(), PrintSettings(first_layer_temperature=215))
    second = text.split(";LAYER_CHANGE")[2]
    assert "M104 S210" in second
    assert "M106 S255" in second
    assert "M106" not in text.split(";LAYER_CHANGE")[1]


def test_events_of_the_program_come_before_their_row_and_are_not_repeated() -> None:
    events = (
        Event(0, "nozzle_temperature", 210.0),
        Event(30, "fan", 0.5),
        Event(35, "fan", 0.5),
        Event(38, "pause"),
        Event(39, "fan", 0.0),
    )
    lines = written(random_program(cradle(), 60, events=events), cradle()).splitlines()
    assert lines.count("M106 S128") == 1
    assert lines.count("M104 S210") == 1
    assert lines.count("M0") == 1
    assert "M107" in lines


def test_start_code_placeholders_are_filled_and_unknown_ones_refused() -> None:
    profile = cradle()
    known = dataclasses.replace(
        profile, gcode=profile.gcode.model_copy(update={"start": ("G28", "G1 {park} ; at {temperature}")})
    )
    assert "G1 X0 Y0 Z220 A0 B0 ; at 210" in written(random_program(profile, 5), known).splitlines()
    unknown = dataclasses.replace(profile, gcode=profile.gcode.model_copy(update={"start": ("M104 S{temprature}",)}))
    with pytest.raises(GcodeError, match=r"gcode.start\[0\].*did you mean 'temperature'"):
        written(random_program(profile, 5), unknown)


def test_an_unknown_firmware_is_a_profile_error_with_the_nearest() -> None:
    with pytest.raises(ProfileError, match="no dialect 'marlim', did you mean 'marlin'"):
        written(random_program(cradle(), 5), cradle("marlim"))


def test_a_number_that_cannot_be_written_leaves_no_file(tmp_path: Path) -> None:
    program = random_program(cradle(), 30)
    huge = dataclasses.replace(program, joints=program.joints + 1e12)
    out = tmp_path / "part.gcode"
    out.write_text("older")
    with pytest.raises(GcodeError, match="row 0: X"):
        write_program(huge, cradle(), SETTINGS, title="part", out=out)
    assert [path.name for path in tmp_path.iterdir()] == ["part.gcode"]
    assert out.read_text() == "older"
    summary = write_program(program, cradle(), SETTINGS, title="part", out=out)
    assert [path.name for path in tmp_path.iterdir()] == ["part.gcode"]
    assert len(out.read_text().splitlines()) == summary.lines


def test_a_line_too_long_for_the_wire_is_refused() -> None:
    profile = cradle()
    long = dataclasses.replace(profile, gcode=profile.gcode.model_copy(update={"end": ("M117 " + "x" * 90,)}))
    with pytest.raises(GcodeError, match="marlin takes"):
        written(random_program(profile, 5), long)


def test_a_title_cannot_break_out_of_its_comment() -> None:
    out = io.StringIO()
    write_program(random_program(cradle(), 5), cradle(), SETTINGS, title="a\nM112 *1;b", out=out)
    assert not any(line.startswith("M112") for line in out.getvalue().splitlines())


def test_an_empty_program_is_start_and_end_only() -> None:
    empty = random_program(cradle(), 20)
    empty = dataclasses.replace(
        empty,
        **{
            name: getattr(empty, name)[:0]
            for name in (
                "joints",
                "duration",
                "filament",
                "role",
                "layer",
                "width",
                "height",
                "tip_speed",
                "tip_length",
                "source",
            )
        },
    )
    found = read(written(empty, cradle()), cradle().letters, [0.0] * 5)
    assert found.joints == []
    assert "G28" in found.other


def test_a_slow_move_lowers_repraps_minimum_speed_first() -> None:
    profile = cradle("reprapfirmware")
    text = written(ring(profile, 0.003), profile)
    permission = next(line for line in text.splitlines() if line.startswith("M203 I"))
    assert 0 < float(permission[6:]) < 60 * 0.3
    assert "M203 I" not in written(ring(profile, 0.0), profile)


def test_a_move_in_no_time_is_refused() -> None:
    program = random_program(cradle(), 30)
    timeless = dataclasses.replace(program, duration=np.r_[np.zeros(5), program.duration[5:]])
    with pytest.raises(GcodeError, match=r"row 0: moves .* in no time"):
        written(timeless, cradle())


def test_klipper_measures_rotary_moves_by_the_largest_axis() -> None:
    profile = cradle("klipper")
    found = read(written(ring(profile, 0.0), profile), profile.letters, [0.0] * 5)
    step = np.diff(np.array([[0.0] * 5, *found.joints]), axis=0)
    largest = np.maximum(np.abs(step[:, 3:]).max(axis=1), np.abs(found.filament))
    assert np.abs(60 * largest / np.array(found.feed) / 0.01 - 1).max() < 0.02


def test_inverse_time_stands_on_every_move_and_gives_its_time() -> None:
    profile = cradle("linuxcnc")
    program = random_program(profile, 400, 5)
    text = written(program, profile)
    moves = [line for line in text.splitlines() if line.startswith("G1 ")]
    assert all(" F" in line for line in moves)
    found = read(text, profile.letters, [0.0] * 5, "U", absolute=True)
    assert set(found.command) == {"G1"}
    seconds = 60 / np.array(found.feed)
    assert np.abs(seconds / make_moves(program, profile, find_dialect("linuxcnc")).seconds - 1).max() < 1e-3


def test_a_joint_with_the_letter_of_the_filament_is_refused() -> None:
    profile = cradle("linuxcnc")
    joints = (dataclasses.replace(profile.joints[0], letter="U"), *profile.joints[1:])
    with pytest.raises(GcodeError, match="joint U has the letter of linuxcnc's filament"):
        written(random_program(profile, 5), dataclasses.replace(profile, joints=joints))


def test_a_bead_without_length_is_no_line_whatever_rounding_left_in_it() -> None:
    profile = load_profile("rep5x_ender3")
    program = random_program(profile, 40)
    joints, filament = program.joints.copy(), program.filament.copy()
    joints[8] = joints[7]
    filament[8] = 5e-17
    still = dataclasses.replace(program, joints=joints, filament=filament)
    moves = make_moves(still, profile, find_dialect(profile.firmware))
    assert 8 not in moves.row
    assert (moves.metric > 0).all()


@pytest.mark.parametrize("turn", [37, 38, 39, 40, 41])
def test_moves_of_few_steps_are_not_joined_across_a_hairpin_of_the_tip(turn: int) -> None:
    """The tip goes out and back while the joints hardly move: joined, out and back would be a heap on a short way."""
    profile = cradle()
    base = random_program(profile, 80)
    joints = np.zeros((80, 5))
    there = np.minimum(np.arange(81), 2 * (turn + 1) - np.arange(81))
    joints[:, 0] = 0.03 * np.arange(1, 81)
    joints[:, 1] = 0.01 * (np.arange(80) % 2)  # too crooked to be merged for short words alone
    joints[:, 4] = np.radians(0.05) * there[1:]
    place = 0.1 * there
    program = dataclasses.replace(
        base,
        joints=joints,
        duration=np.full(80, 0.01),
        filament=np.full(80, 0.003),
        role=np.full(80, Role.NONPLANAR_INFILL),
        layer=np.zeros(80, dtype=np.int64),
        width=np.full(80, 0.4),
        height=np.full(80, 0.2),
        tip_speed=np.full(80, 10.0),
        tip_length=np.full(80, 0.1),
        tip=np.column_stack([place, np.zeros((81, 2))]),
    )
    moves = make_moves(program, profile, find_dialect("marlin"))
    assert len(moves.row) < 40
    assert turn in moves.row
    ends = np.append(0, moves.row + 1)
    np.testing.assert_allclose(np.abs(np.diff(place[ends])), 0.1 * np.diff(ends), atol=1e-12)
