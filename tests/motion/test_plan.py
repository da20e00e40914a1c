"""Whole programs: the same trace and plastic on every machine, limits, chords, retractions, events, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trunnion_core.errors import UnreachableError
from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import FIELDS, Toolpath
from trunnion_gcode.dialect import find_dialect
from trunnion_gcode.moves import make_moves
from trunnion_kinematics.chain import JointChain
from trunnion_motion.plan import plan, plan_motion
from trunnion_motion.timelaw import speeds_at

DEGREE = np.radians(1.0)


def ends_of_source_rows(program):
    """Rows of the program at which a row of the toolpath is complete."""
    moving = (program.source >= 0) & (program.role != Role.RETRACT) & (program.role != Role.PRIME)
    rows = np.flatnonzero(moving)
    return rows[np.append(program.source[rows][1:] != program.source[rows][:-1], True)]


def between(program, pieces=10):
    """Joints (n, pieces + 1, k) inside every row."""
    before = np.concatenate([program.start[None], program.joints[:-1]])
    fraction = np.linspace(0, 1, pieces + 1)[:, None]
    return before[:, None] + fraction * (program.joints - before)[:, None]


def angle(a, b):
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1)))


def taken(toolpath, rows):
    return Toolpath(**{name: getattr(toolpath, name)[rows] for name in FIELDS})


def test_every_machine_makes_the_toolpaths_trace(profile, dome, settings):
    program = plan(dome, profile, settings)
    rows = ends_of_source_rows(program)
    assert_array_equal(program.source[rows], np.arange(len(dome)))
    points, axes = JointChain.from_profile(profile).forward(program.joints[rows])
    assert_allclose(points, dome.points, rtol=0, atol=1e-6)
    assert angle(axes, dome.tool_axes).max() < 1e-6


def test_the_poses_given_with_a_program_are_those_of_its_joints(profile, dome, settings):
    result = plan_motion(dome, profile, settings)
    points, axes = JointChain.from_profile(profile).forward(result.program.joints)
    assert_allclose(points, result.tip_points, rtol=0, atol=1e-6)
    assert angle(axes, result.tool_axes).max() < 1e-6
    start, _ = JointChain.from_profile(profile).forward(result.program.start[None])
    assert_allclose(
        result.program.tip_length, np.linalg.norm(np.diff(points, axis=0, prepend=start), axis=1), atol=1e-6
    )


def test_every_machine_feeds_the_same_filament(machines, dome, settings):
    feeds = []
    for profile in machines.values():
        program = plan(dome, profile, settings)
        beads = program.width > 0
        feeds.append(np.bincount(program.source[beads], program.filament[beads], len(dome)))
    for feed in feeds[1:]:
        assert_allclose(feed, feeds[0], rtol=1e-9, atol=1e-15)


def test_the_tip_stays_on_its_chords(profile, dome, settings):
    program = plan(dome, profile, settings)
    inside = between(program)
    n, m, k = inside.shape
    points, _ = JointChain.from_profile(profile).forward(inside.reshape(-1, k))
    points = points.reshape(n, m, 3)
    straight = points[:, :1] + np.linspace(0, 1, m)[:, None] * (points[:, -1:] - points[:, :1])
    stray = np.linalg.norm(points - straight, axis=2).max(axis=1)
    of_toolpath = (program.source >= 0) & (program.role != Role.RETRACT) & (program.role != Role.PRIME)
    first_down = np.flatnonzero(of_toolpath)[0]
    of_toolpath[first_down] = False
    assert stray[of_toolpath].max() <= settings.chord_tolerance * 1.01


def test_travel_does_not_sink_below_its_straight_way(profile, dome, settings):
    program = plan(dome, profile, settings)
    inside = between(program)
    n, m, k = inside.shape
    z = JointChain.from_profile(profile).forward(inside.reshape(-1, k))[0][:, 2].reshape(n, m)
    straight = z[:, :1] + np.linspace(0, 1, m) * (z[:, -1:] - z[:, :1])
    own = (program.role == Role.TRAVEL) & (program.source >= 0)
    assert (z[own] >= straight[own] - settings.chord_tolerance * 1.01).all()
    assert z[program.role == Role.TRAVEL].min() > -0.3


def test_the_end_is_upright_over_the_part(profile, dome, settings):
    """So words mean the same with and without tip control, and the table is level for whoever takes the part off."""
    result = plan_motion(dome, profile, settings)
    program = result.program
    turns = program.joints[-1, list(profile.rotary)] / (2 * np.pi)
    assert_allclose(turns, np.rint(turns), atol=1e-12)
    assert result.tool_axes[-1, 2] == pytest.approx(1.0, abs=1e-12)
    assert not any(finding.code == "parked-tilted" for finding in result.findings)
    last = int(np.flatnonzero(program.source >= 0)[-1])
    turning = (np.diff(program.joints[:, list(profile.rotary)], axis=0) != 0).any(axis=1)
    inside = between(program)[np.flatnonzero(turning[last:]) + last + 1]
    tips = JointChain.from_profile(profile).forward(inside.reshape(-1, inside.shape[2]))[0]
    assert tips[:, 2].min(initial=np.inf) > result.tip_points[: last + 1, 2][program.width[: last + 1] > 0].max() + 5.0


def test_no_joint_leaves_its_limits_or_caps(profile, dome, settings):
    result = plan_motion(dome, profile, settings)
    program, law = result.program, result.law
    assert (program.joints >= profile.array("min") - 1e-6).all()
    assert (program.joints <= profile.array("max") + 1e-6).all()
    steps = np.diff(program.joints, axis=0, prepend=program.start[None])
    fraction = np.linspace(0, 1, 11)
    times, speeds = speeds_at(law, fraction)
    joints = between(program)
    spans = np.diff(times, axis=1)
    moving = program.duration > 0
    velocity = np.diff(joints, axis=1)[moving] / spans[moving][:, :, None]
    assert (np.abs(velocity) <= profile.array("speed") * 1.001).all()
    # Rows that are written as one move are made as one: along its chord.
    ends = make_moves(program, profile, find_dialect(profile.firmware)).row
    first = np.append(0, ends[:-1] + 1)
    together = np.repeat(np.arange(len(ends)), np.diff(np.append(first, len(program))))
    chord, length = np.add.reduceat(steps, first), np.add.reduceat(law.length, first)
    rate = (chord[together] / np.where(length > 0, length, 1.0)[together, None])[moving]
    ramp = np.abs(np.diff(speeds[moving], axis=1) / spans[moving])
    assert (ramp.max(axis=1)[:, None] * np.abs(rate) <= profile.array("acceleration") * 1.001).all()
    assert_allclose(program.duration[moving], times[moving, -1], rtol=1e-9)
    beads = program.width > 0
    assert (program.tip_length[beads] / program.cruise[beads] <= program.tip_speed[beads] * (1 + 1e-9)).all()
    assert (program.cruise <= program.duration * 1.001).all()  # F has four digits
    assert (np.abs(steps[moving]) / program.cruise[moving][:, None] <= profile.array("speed") * (1 + 1e-9)).all()


def test_retractions_bracket_the_travels(profile, dome, settings):
    program = plan(dome, profile, settings)
    role = program.role
    retracts, primes = np.flatnonzero(role == Role.RETRACT), np.flatnonzero(role == Role.PRIME)
    assert len(retracts) == len(primes) + 1
    held = np.cumsum(np.where(program.width > 0, 0.0, program.filament))
    assert_allclose(held[-1], -settings.retract_length)
    assert_allclose(held[program.width > 0], 0.0, atol=1e-12)
    travels = np.flatnonzero((role == Role.TRAVEL) & (np.arange(len(role)) > retracts[0]))
    assert_allclose(held[travels], -settings.retract_length)
    assert (held[: retracts[0]] == 0).all()
    steps = np.diff(program.joints, axis=0, prepend=program.start[None])
    assert (steps[retracts] == 0).all()
    assert (steps[primes] == 0).all()
    acceleration = profile.extruder.acceleration
    speed = min(settings.retract_speed, profile.extruder.speed)
    expected = settings.retract_length / speed + speed / acceleration
    triangle = 2 * np.sqrt(settings.retract_length / acceleration)
    wanted = expected if settings.retract_length > speed**2 / acceleration else triangle
    assert_allclose(program.cruise[retracts], settings.retract_length / speed)
    assert (program.duration[retracts] <= wanted * (1 + 1e-9)).all()  # Marlin starts with the extruder's corner speed
    assert (program.duration[retracts] >= settings.retract_length / speed).all()


def test_links_are_not_retracted(machines, dome, settings):
    linked = replace(dome, role=np.where((dome.role == Role.TRAVEL) & (np.arange(len(dome)) > 0), Role.LINK, dome.role))
    program = plan(linked, machines["ab"], settings)
    assert (program.role == Role.RETRACT).sum() == 1
    assert (program.role == Role.PRIME).sum() == 0


def test_a_platter_with_little_travel_is_rewound_above_the_part(paths, dome, settings):
    profile = paths["bc"](200)
    result = plan_motion(dome, profile, settings)
    program = result.program
    inserted = (program.source < 0) & (program.role == Role.TRAVEL)
    c = np.degrees(np.ptp(program.joints[:, 4]))
    assert c <= 400
    first_bead = np.flatnonzero(program.width > 0)[0]
    rewinding = inserted & (np.arange(len(program)) > first_bead) & (np.arange(len(program)) < len(program) - 1)
    assert rewinding.any()
    turning = np.abs(np.diff(program.joints[:, 4], prepend=0.0)) > 0.02
    printed = np.maximum.accumulate(np.where(program.width > 0, result.tip_points[:, 2], -np.inf))
    fast = rewinding & turning
    assert fast.any()
    assert (result.tip_points[fast, 2] > printed[fast] + 1.5).all()
    assert not result.findings


def test_a_bead_longer_than_the_platters_travel_is_interrupted_and_said(paths, settings):
    """Three turns of a helix need 1080 degrees; the platter has 400."""
    turn = np.linspace(0, 6 * np.pi, 541)
    tilt = 0.5
    around = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    points = 20 * around + np.stack([0 * turn, 0 * turn, 5 + turn / (2 * np.pi)], axis=1)
    axes = np.sin(tilt) * around + [0, 0, np.cos(tilt)]
    helix = paths["rings"]([(points, axes, 0.5, 0)])
    result = plan_motion(helix, paths["bc"](200), settings)
    assert {finding.code for finding in result.findings} == {"rewind-while-printing"}
    program = result.program
    beads = program.width > 0
    whole = plan(helix, paths["bc"](), settings)
    assert_allclose(program.filament[beads].sum(), whole.filament[whole.width > 0].sum(), rtol=1e-12)
    rows = ends_of_source_rows(program)
    tips, _ = JointChain.from_profile(paths["bc"](200)).forward(program.joints[rows])
    assert_allclose(tips, helix.points, atol=1e-6)
    # Every interruption comes back to where the bead was left.
    back = np.flatnonzero(beads[1:] & ~beads[:-1]) + 1
    for row in back[1:]:
        left = np.flatnonzero(beads[:row])[-1]
        assert_allclose(result.tip_points[row - 1], result.tip_points[left], atol=1e-6)


def test_a_vertical_machine_refuses_a_leaning_tool_and_names_the_layer(dome, settings):
    with pytest.raises(UnreachableError, match="of layer 0"):
        plan(dome, load_profile("generic_3axis"), settings)


def test_a_vertical_machine_prints_vertical_paths(dome, settings):
    upright = replace(dome, tool_axes=np.tile([0.0, 0, 1], (len(dome), 1)))
    profile = load_profile("generic_3axis")
    program = plan(upright, profile, settings)
    tips, _ = JointChain.from_profile(profile).forward(program.joints[ends_of_source_rows(program)])
    assert_allclose(tips, upright.points, atol=1e-9)
    assert program.joints[0, 1] > 4, "rises before it moves over the bed"


def test_an_empty_toolpath_is_an_empty_program(machines, dome, settings):
    program = plan(taken(dome, slice(0, 0)), machines["ab"], settings)
    assert len(program) == 0
    assert program.events == ()


def test_the_same_toolpath_gives_the_same_program(machines, dome, settings):
    first, second = (plan(dome, machines["bc_limited"], settings) for _ in range(2))
    for name in ("joints", "duration", "filament", "source", "role"):
        assert_array_equal(getattr(first, name), getattr(second, name))


def test_a_slow_hot_end_slows_the_tip(machines, dome, settings):
    profile = machines["ab"]
    slow = replace(profile, extruder=profile.extruder.model_copy(update={"max_flow": 2.0}))
    program = plan(dome, slow, settings)
    beads = program.width > 0
    flow = program.filament[beads] * slow.filament_area / program.duration[beads]
    assert flow.max() <= 2.0 * 1.01
    assert program.duration.sum() > plan(dome, profile, settings).duration.sum()


def test_axes_that_starve_the_hot_end_are_named(paths, settings):
    """Near the pole the platter of a B-C table cannot follow, so the flow falls."""
    profile = paths["bc"](extruder={"min_flow": 1.0})
    rings = [(*paths["ring"](r, 10.0, r / 40, 90), 0.5, 0) for r in (1.0, 20.0)]
    result = plan_motion(paths["rings"](rings), profile, settings)
    found = [finding for finding in result.findings if finding.code == "flow-below-minimum"]
    assert found
    assert {finding.axis for finding in found} == {"C"}
    assert all(finding.value < finding.limit == 1.0 for finding in found)
    assert all(np.hypot(*finding.point[:2]) < 2 for finding in found)


def test_heat_fan_and_layer_marks_come_in_order(paths, machines):
    settings = PrintSettings(
        first_layer_temperature=220, temperature=205, bed_temperature=60, first_layer_bed_temperature=65
    )
    path = paths["dome"](layers=3, pitch=6, n=24)
    program = plan(path, machines["ab"], settings)
    kinds = [(event.kind, event.value) for event in program.events]
    assert kinds[:5] == [
        ("bed_temperature", 65),
        ("wait_bed", 65),
        ("nozzle_temperature", 220),
        ("wait_nozzle", 220),
        ("layer", 0),
    ]
    assert kinds[5:] == [
        ("nozzle_temperature", 205),
        ("bed_temperature", 60),
        ("fan", 1.0),
        ("layer", 1),
        ("layer", 2),
    ]
    rows = [event.row for event in program.events]
    assert rows == sorted(rows)
    for event in program.events:
        if event.kind == "layer":
            assert program.layer[event.row] == event.value
            assert event.row == 0 or program.layer[event.row - 1] < event.value
