"""The judge's planners of Klipper, RepRapFirmware and grblHAL against oracles and against their rules by hand."""

import numpy as np
import pytest

from trunnion_sim.duet_kernel import duet
from trunnion_sim.toolhead_kernel import grbl, klipper

KLIPPER = np.array(
    [
        (0.4, 0, 0.02, 0.5, 0, 0.014, 40, 0.000000, 12.791451, 2.538199, 0.05753988),
        (0.7821, 0.1182, 0.04, 1, 1.2622, 0.014, 40, 2.538199, 15.866521, 15.586405, 0.04289164),
        (1.1122, 0.3441, 0.06, 1.5, 2.6261, 0.014, 40, 15.586405, 15.586405, 2.780798, 0.04360987),
        (1.3608, 0.6574, 0.08, 2, 2.8378, 0.014, 40, 2.780798, 12.924942, 2.378595, 0.05166832),
        (1.5057, 1.0302, 0.1, 2.5, 1.7026, 0.014, 40, 2.378595, 14.141164, 10.570549, 0.04346456),
        (1.534, 1.4292, 0.12, 3, 0.2642, 0.014, 40, 10.570549, 13.127187, 3.143466, 0.04503860),
        (1.4431, 1.8187, 0.14, 3.5, -0.1549, 0.014, 40, 3.143466, 12.958211, 2.280996, 0.05117028),
        (1.2412, 2.164, 0.16, 4, 0.8306, 0.014, 40, 2.280996, 13.552339, 6.429418, 0.04592890),
        (0.9462, 2.4342, 0.18, 4.5, 2.3146, 0.014, 40, 6.429418, 11.645904, 3.701311, 0.04876166),
        (0.5846, 2.6052, 0.2, 5, 2.9328, 0.014, 40, 3.701311, 13.028458, 2.233971, 0.05024202),
        (0.1886, 2.6616, 0.22, 5.5, 2.1168, 0.014, 40, 2.233971, 13.185765, 4.684472, 0.04857250),
        (-0.2064, 2.5985, 0.24, 6, 0.6168, 0.014, 40, 4.684472, 10.858631, 0.000000, 0.06379196),
        (-0.2064, 2.5985, 0.24, 6, 0.6168, -0.8, 35, 0.000000, 21.908902, 0.000000, 0.04746929),
        (-0.2064, 2.5985, 1.24, 6, 0.6168, 0, 150, 0.000000, 15.000000, 3.000000, 0.10766667),
        (9.7936, 6.5985, 1.24, 6, 0.6168, 0, 150, 3.000000, 81.582220, 19.440212, 0.18327924),
        (12.7936, 6.5985, 0.24, 6, 0.6168, -0.05, 100, 19.440212, 45.676334, 0.000000, 0.10124833),
        (12.7936, 6.5985, 0.24, 6, 0.6168, 0.85, 35, 0.000000, 22.583180, 0.000000, 0.04893022),
        (12.7936, 6.5985, 0.24, 6, 3.6168, 0.01, 50, 0.000000, 42.426407, 0.000000, 0.11313708),
        (12.7936, 6.5985, 0.24, 6, 6.6168, 0.01, 50, 0.000000, 42.426407, 0.000000, 0.11313708),
        (12.7936, 6.5985, 0.24, 6, 9.6168, 0.01, 50, 0.000000, 42.426407, 0.000000, 0.11313708),
        (12.7936, 6.5985, 0.54, 6, 9.6168, 0.2, 60, 0.000000, 13.416408, 13.416408, 0.04472136),
        (12.7936, 6.5985, 0.84, 6, 9.6168, 0.2, 60, 13.416408, 15.000000, 15.000000, 0.02027864),
        (12.7936, 6.5985, 1.14, 6, 9.6168, 0.2, 60, 15.000000, 15.000000, 13.747727, 0.02017424),
        (12.7936, 6.5985, 1.44, 6, 9.6168, 0.2, 60, 13.747727, 13.747727, 3.000000, 0.03582576),
        (13.7936, 6.3985, 1.44, 6.2, 9.6168, 0.033, 80, 3.000000, 49.563387, 49.563387, 0.03880282),
        (14.7936, 6.2985, 1.44, 6.4, 9.6168, 0.033, 80, 49.563387, 60.503456, 60.503456, 0.01743465),
        (15.7936, 6.2985, 1.44, 6.6, 9.6168, 0.033, 80, 60.503456, 60.503456, 60.503456, 0.01652798),
        (16.7936, 6.3985, 1.44, 6.8, 9.6168, 0.033, 80, 60.503456, 60.503456, 60.503456, 0.01661042),
        (17.7936, 6.5985, 1.44, 7, 9.6168, 0.033, 80, 60.503456, 60.503456, 50.056703, 0.01760687),
        (18.7936, 6.8985, 1.44, 7.2, 9.6168, 0.033, 80, 50.056703, 50.056703, 0.000000, 0.04171392),
    ]
)
"""Made by the classes Move and LookAheadQueue (`klippy/toolhead.py`) with an extruder's and two manual steppers' own
check_move and calc_junction, of Kalico 2026.10.0.dev0 (a fork of Klipper that has the same classes): max_velocity 200,
max_accel 1200, square_corner_velocity 6; Z 15 mm/s and 300 mm/s²; extruder 40, 2000, corner 4; GCODE_AXIS A with
LIMIT_VELOCITY 90, LIMIT_ACCEL 500, INSTANTANEOUS_CORNER_VELOCITY 5, and B with 180, 1000 and 8. Columns: X, Y, Z, A, B
after the move, E of it, mm/s asked; entry, cruise and exit along the metric, s."""
LINEAR = np.array([True, True, True, False, False, False])


def test_klipper_moves_as_klippers_own_classes():
    """Beads on five axes, a retraction, a lift, a travel, a wipe, a prime, then plastic in a turn and in a climb."""
    places = np.vstack([np.zeros(5), KLIPPER[:, :5]])
    delta = np.column_stack([np.diff(places, axis=0), KLIPPER[:, 5]])
    n = len(delta)
    speed, acceleration = np.array([200.0, 180, 15, 90, 180, 40]), np.array([1500.0, 1200, 300, 500, 1000, 2000])
    corner = np.array([8.0, 6, 0.5, 5, 8, 4])
    _, _, entry, cruise, leave, _, duration = klipper(
        delta, LINEAR, 2, KLIPPER[:, 6], np.zeros(n, bool), speed, acceleration, corner, 200.0, 1200.0, 6.0
    )
    found = np.column_stack([entry, cruise, leave])
    np.testing.assert_allclose(found, KLIPPER[:, 7:10], atol=2e-6)
    np.testing.assert_allclose(duration, KLIPPER[:, 10], atol=2e-8)


def on_duet(delta, feed, path=(np.inf, np.inf, np.inf), slowest=0.5, drive=np.inf):
    """Limits of every column: 100 units/s, 1000 units/s², 8 units/s at corners."""
    delta = np.array(delta, dtype=float)
    n = len(delta)
    table = [np.full((1, 6), value) for value in (100.0, 1000.0, 8.0)]
    plane = np.array([True, True, False, False, False, False])
    return duet(
        delta, LINEAR, plane, np.full(n, feed), np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, np.int64),
        *table, np.array([path]), np.array([[slowest]]), 40, np.full(n, drive),
    )  # fmt: skip


BEAD, ACROSS = [10, 0, 0, 0, 0, 0.4], [0, 10, 0, 0, 0, 0.4]
TURN, CLIMB = [0, 0, 0, 0, 10, 0.4], [0, 0, 1, 0, 0, 0.04]


def test_a_duet_turns_a_corner_at_its_jerk():
    """X falls from v to nothing and Y rises to v: M566 480 mm/min is 8 mm/s (`DDA::MatchSpeeds`)."""
    assert on_duet([BEAD, ACROSS], 50)[4][0] == pytest.approx(8.0)


@pytest.mark.parametrize("other", [TURN, CLIMB, [10, 0, 0, 0, 0, 0], [10, 0, 0, 0, 0, -0.4]])
def test_a_duet_stops_between_kinds_of_moves(other):
    """Jerk policy 0: printing and not, X or Y moving and not (`DDA::InitStandardMove`, 3.6)."""
    assert on_duet([BEAD, other], 5)[4][0] == 0.0


@pytest.mark.parametrize("pair", [(BEAD, [10, 0, 0.1, 0, 1, 0.4]), (TURN, CLIMB), (CLIMB, [0, 0, 1, 0, 1, 0.04])])
def test_a_duet_melds_moves_of_one_kind(pair):
    """A bead that only turns and one that only climbs are alike to it: neither moves X or Y."""
    assert on_duet(pair, 1)[4][0] > 0.0


def test_a_duet_limits_paths_of_x_and_y_only():
    acceleration = on_duet([BEAD, [10, 0, 0, 0, 0, 0], CLIMB, TURN], 50, path=(300.0, 500.0, np.inf))[5]
    np.testing.assert_allclose(acceleration, [300.0, 500.0, 1000.0, 1000.0])


def test_a_duet_slows_ramps_down_for_its_own_advance():
    """BEAD has 0.04 mm of filament to a mm: 20 mm/s² of filament are 500 along the way."""
    np.testing.assert_allclose(on_duet([BEAD, [10, 0, 0, 0, 0, 0]], 50, drive=20.0)[5], [500.0, 1000.0])


def test_a_duet_creeps_no_slower_than_it_was_told():
    assert on_duet([BEAD], 0.1)[3][0] == pytest.approx(0.5)
    assert on_duet([BEAD], 0.1, slowest=0.05)[3][0] == pytest.approx(0.1)


def grbl_law(delta, feed, inverse=True):
    delta = np.array(delta, dtype=float)
    n = len(delta)
    limits = np.full(6, 100.0), np.full(6, 1000.0)
    return grbl(delta, np.full(n, feed), np.full(n, inverse), np.zeros(n, bool), *limits, 0.01, 35)


def test_grbl_turns_a_corner_of_mixed_units_by_its_deviation():
    """3 mm and 4 degrees are 5 units; a right angle: a = 1000 * sqrt(2), half its sine sqrt(1/2) (`planner.c`)."""
    length, asked, _, _, leave, _, _ = grbl_law([[10, 0, 0, 0, 0, 0], [0, 0, 0, 10, 0, 0], [0, 3, 0, 0, 4, 0]], 5)
    sine = np.sqrt(0.5)
    assert leave[0] == pytest.approx(np.sqrt(1000 * np.sqrt(2) * 0.01 * sine / (1 - sine)))
    assert (length[2], asked[2]) == pytest.approx((5.0, 25.0))


def test_grbl_creeps_no_slower_than_a_unit_a_minute():
    """MINIMUM_FEED_RATE."""
    assert grbl_law([[0.01, 0, 0, 0, 0, 0]], 0.001)[3][0] == pytest.approx(1 / 60)
