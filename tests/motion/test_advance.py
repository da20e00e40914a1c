"""Pressure advance in the filament: E + K dE/dt at every row's end, nothing gained or lost, the same motion."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_kinematics.chain import JointChain
from trunnion_motion.plan import plan_motion

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
K = 0.05
FIRMWARES = ("marlin", "reprapfirmware", "grblhal", "klipper", "linuxcnc")


def on(firmware: str, seconds: float, machine: str = "open5x_voron0"):
    profile = load_profile(machine)
    extruder = profile.extruder.model_copy(update={"pressure_advance": seconds})
    return dataclasses.replace(profile, firmware=firmware, extruder=extruder)


def beads(*points_and_axes, speed) -> Toolpath:
    """Beads one after the other, each reached by a travel; `speed` (n,) mm/s along all of them."""
    points, axes = (np.concatenate(part) for part in zip(*points_and_axes, strict=True))
    travel = np.concatenate([np.arange(len(part)) == 0 for part, _ in points_and_axes])
    layer = np.concatenate([np.full(len(part), k) for k, (part, _) in enumerate(points_and_axes)])
    return Toolpath(
        points=points,
        tool_axes=axes,
        width=np.where(travel, 0.0, 0.4),
        height=np.where(travel, 0.0, 0.3),
        role=np.where(travel, int(Role.TRAVEL), int(Role.NONPLANAR_OUTER_WALL)),
        layer=layer,
        speed=np.where(travel, 150.0, speed),
    )


def ring(z=3.0, n=90):
    """Most of a circle about the platter's axis, the tool leaning outwards: only the platter turns."""
    angle = np.linspace(0, 1.8 * np.pi, n + 1)
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n + 1)])
    return 15.0 * out + [0, 0, z], 0.5 * out + [0, 0, np.sqrt(0.75)]


def line(z, n=4):
    """A straight line, the tool upright."""
    points = np.column_stack([np.linspace(-20, 20, n + 1), np.full(n + 1, 5.0), np.full(n + 1, z)])
    return points, np.tile([0.0, 0.0, 1.0], (n + 1, 1))


RING = beads(ring(), ring(3.3), speed=np.tile(np.where(np.arange(91) // 30 % 2, 10.0, 30.0), 2))
MIXED = beads(
    line(3.0), ring(), line(3.3), speed=np.concatenate([np.full(5, 40.0), np.full(91, 25.0), np.full(5, 40.0)])
)


def completed(program):
    """Rows that complete a row of the toolpath."""
    rows = np.flatnonzero((program.source >= 0) & (program.role != Role.RETRACT) & (program.role != Role.PRIME))
    return rows[np.append(np.diff(program.source[rows]) != 0, True)]


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_nothing_is_gained_or_lost_and_the_machine_moves_as_without(firmware):
    plain, baked = (plan_motion(RING, on(firmware, seconds), SETTINGS) for seconds in (0.0, K))
    assert (plain.program.advance, baked.program.advance) == (0.0, K)
    assert baked.program.filament.sum() == pytest.approx(plain.program.filament.sum(), abs=1e-9)
    assert baked.law.total == pytest.approx(plain.law.total, rel=2e-3)
    assert_allclose(
        baked.program.joints[completed(baked.program)], plain.program.joints[completed(plain.program)], atol=1e-12
    )
    points, axes = JointChain.from_profile(on(firmware, K)).forward(baked.program.joints)
    assert_allclose(points, baked.tip_points, atol=1e-9)
    assert_allclose(axes, baked.tool_axes, atol=1e-9)
    total = np.cumsum(plain.program.filament)[completed(plain.program)]
    travels = np.flatnonzero(baked.program.role[completed(baked.program)] == Role.TRAVEL)
    assert_allclose(np.cumsum(baked.program.filament)[completed(baked.program)][travels], total[travels], atol=1e-9)


@pytest.mark.parametrize("firmware", ["marlin", "grblhal", "reprapfirmware"])
def test_the_drive_is_ahead_by_k_times_the_rate(firmware):
    """At the ends of the toolpath's rows, where the executed law says how fast the tip is, and it goes on like that."""
    plain, baked = (plan_motion(RING, on(firmware, seconds), SETTINGS) for seconds in (0.0, K))
    done, before = completed(baked.program), completed(plain.program)
    law = baked.law
    steady = (law.peak - np.minimum(law.entry, law.leave) < 0.01 * law.peak)[done]
    bead = (baked.program.width[done] > 0) & steady & np.append(steady[1:], False)
    laid = plain.program.width > 0
    fed, way = (
        np.bincount(plain.program.source[laid], weights=amount[laid], minlength=len(RING))[bead]
        for amount in (plain.program.filament, plain.program.tip_length)
    )
    lead = np.cumsum(baked.program.filament)[done] - np.cumsum(plain.program.filament)[before]
    assert bead.sum() > 100
    assert_allclose(lead[bead], K * fed / way * law.leave[done][bead], rtol=0.025)
    assert lead.max() > 0.04


def test_ramps_are_cut_so_that_filament_can_follow_them():
    plain, baked = (plan_motion(RING, on("marlin", seconds), SETTINGS) for seconds in (0.0, K))
    assert len(plain.program) < len(baked.program) < 1.5 * len(plain.program)
    share = baked.law.peak - np.minimum(baked.law.entry, baked.law.leave)
    laid = (baked.program.width > 0) & (baked.law.length > 0.02)
    assert share[laid].max() < 0.35 * 30.0


def test_firmware_that_applies_it_is_left_to_it():
    toolpath = beads(line(3.0), speed=40.0)
    plain, handed = (plan_motion(toolpath, on("marlin", seconds), SETTINGS).program for seconds in (0.0, K))
    assert handed.advance == 0.0
    assert_array_equal(handed.filament, plain.filament)


def of_the_firmware(result, profile):
    """(n,) mm that RepRapFirmware adds to its rows of X and Y: K times what the filament's speed changes within."""
    program, law = result.program, result.law
    if profile.firmware != "reprapfirmware":
        return np.zeros(len(program))
    step = np.abs(np.diff(program.joints, axis=0, prepend=program.start[None]))
    across = (step[:, [profile.letters.index(letter) for letter in "XY"]] > 1e-4).any(axis=1)
    helped = across & (program.width > 0) & (law.length > 0)
    return np.where(
        helped, K * program.filament * (law.leave - law.entry) / np.where(law.length > 0, law.length, 1.0), 0.0
    )


def test_duets_feed_forwards_where_x_or_y_moves():
    """Their planner stops where filament turns back in such moves; what is left over the retraction takes."""
    profile = on("reprapfirmware", K)
    plain = plan_motion(MIXED, on("reprapfirmware", 0.0), SETTINGS).program
    result = plan_motion(MIXED, profile, SETTINGS)
    program = result.program
    assert program.advance == K
    step = np.abs(np.diff(program.joints, axis=0, prepend=program.start[None]))
    xy = [profile.letters.index(letter) for letter in "XY"]
    bead = program.width > 0
    across = bead & (step[:, xy] > 1e-4).any(axis=1)
    assert program.filament[across].min() >= 1e-5
    assert program.filament[bead & ~across].min() < 0
    total = np.cumsum(program.filament + of_the_firmware(result, profile))
    nominal = np.cumsum(plain.filament)
    assert_allclose(total[program.role == Role.RETRACT], nominal[plain.role == Role.RETRACT], atol=1e-5)


@pytest.mark.parametrize("firmware", ["marlin", "grblhal"])
def test_a_long_lag_does_not_slow_the_machine_down(firmware):
    """What its drive cannot do at a corner without slowing down stays undone."""
    plain, baked = (plan_motion(RING, on(firmware, seconds), SETTINGS) for seconds in (0.0, 0.6))
    assert baked.law.total == pytest.approx(plain.law.total, rel=5e-3)
    assert baked.program.filament.sum() == pytest.approx(plain.program.filament.sum(), abs=1e-9)


def test_events_stay_before_their_rows():
    settings = SETTINGS.model_copy(update={"fan_speed": 100.0, "disable_fan_first_layers": 1})
    plain, baked = (plan_motion(RING, on("grblhal", seconds), settings).program for seconds in (0.0, K))
    assert [event.kind for event in baked.events] == [event.kind for event in plain.events]
    assert [baked.source[event.row] for event in baked.events] == [plain.source[event.row] for event in plain.events]
    assert_array_equal(*(program.layer[[event.row for event in program.events]] for program in (plain, baked)))


def test_without_retractions_the_last_bead_takes_what_is_left_over():
    settings = SETTINGS.model_copy(update={"retract_length": 0.0})
    for firmware in FIRMWARES:
        plain, baked = (plan_motion(MIXED, on(firmware, k), settings) for k in (0.0, K))
        if baked.program.advance > 0:
            fed = baked.program.filament + of_the_firmware(baked, on(firmware, K))
            assert fed.sum() == pytest.approx(plain.program.filament.sum(), abs=1e-5)
