"""Collision along the motion: exact distances, nothing missed against a dense oracle, no alarm where there is none."""

import math
from itertools import pairwise

import numpy as np
import pytest
from collision_oracle import BLOCK, NOZZLE, Motion, Oracle, box, machine, names_hit, printed_scene, run, signed
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.profile import MachineProfile
from trunnion_core.solid_tables import BoxTable, ConeTable, HullTable
from trunnion_sim.chain import forward, side_matrices
from trunnion_sim.collision.solids import rows_of, signed_distance

NUMBER = st.floats(-30, 30)


def upright(points: list[list[float]]) -> np.ndarray:
    """Joints of the cradle with both rotaries at zero: the linear joints are the tip itself."""
    return np.column_stack([np.array(points, dtype=float), np.zeros((len(points), 2))])


def mid_air(points: list[list[float]]) -> Motion:
    return Motion(upright(points), np.zeros(len(points)))


@settings(max_examples=200, deadline=None)
@given(st.tuples(*[st.floats(0.01, 10.0)] * 3, st.floats(0.5, 20)), st.tuples(NUMBER, NUMBER, NUMBER))
def test_distance_to_a_cone_is_that_to_its_outline(shape, point):
    r0, r1, shift, height = shape
    cone = ConeTable(
        shape="cone",
        name="cone",
        bottom=1.0,
        top=1.0 + height,
        bottom_diameter=2 * r0,
        top_diameter=2 * r1,
        center=(shift, -shift),
    )
    rows, _, faces = rows_of([cone])
    assert signed_distance(rows[0], faces, *point) == pytest.approx(signed(cone, np.array([point]))[0], abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.tuples(*[st.floats(0.5, 10.0)] * 3), st.tuples(NUMBER, NUMBER, NUMBER))
def test_distance_to_a_box_is_that_of_its_faces(size, point):
    solid = BoxTable(shape="box", name="box", min=(-1, -2, -3), max=size)
    rows, _, faces = rows_of([solid])
    assert signed_distance(rows[0], faces, *point) == pytest.approx(signed(solid, np.array([point]))[0], abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 1000), st.tuples(NUMBER, NUMBER, NUMBER))
def test_a_hull_is_left_where_its_box_would_be_and_never_said_to_be_farther(seed, point):
    """Of a box's corners, with points inside thrown in: its sign and depth are the box's, its distance at most that."""
    rng = np.random.default_rng(seed)
    solid = BoxTable(shape="box", name="box", min=(-1, -2, -3), max=tuple(rng.uniform(1, 9, 3)))
    corners = np.array(np.meshgrid(*zip(solid.min, solid.max, strict=True))).reshape(3, -1).T
    points = np.concatenate([corners, rng.uniform(solid.min, solid.max, (20, 3))])
    rows, kept, faces = rows_of([HullTable(shape="hull", name="hull", points=tuple(map(tuple, points)))])
    assert len(kept) == 8
    assert len(faces) == 6
    exact, found = signed(solid, np.array([point]))[0], signed_distance(rows[0], faces, *point)
    assert found == pytest.approx(exact, abs=1e-9) if exact < 0 else 0 <= found <= exact + 1e-9


def test_travel_through_a_wall_is_found_where_it_stands():
    """A wall 5 mm high along Y; the nozzle crosses it at z = 2 in one move of 20 mm."""
    profile = machine(NOZZLE)
    walls = [p for z in np.arange(0.3, 5.1, 0.3) for p in ([0, -8, z], [0, 8, z], [0, 8, 12], [0, -8, 12])]
    path = [[-10, -8, 12], *walls, [-10, 0, 12], [-10, 0, 2], [10, 0, 2]]
    on_wall = [a[0] == b[0] == 0 and a[2] == b[2] < 6 for a, b in pairwise(path)]
    width = np.where(on_wall, 0.4, 0.0)
    hits = run(profile, Motion(upright(path), np.append(0.0, width)))
    assert set(hits.rows) == {len(path) - 1}
    assert abs(hits.points[0, 0]) <= 0.4
    # the wall's side is entered up to the tip's plane, from the tip's height of 2 mm to its own 5.1 mm
    assert hits.depth[0] > 0.3


def test_printing_a_block_layer_by_layer_is_no_collision():
    profile = machine(NOZZLE, BLOCK)
    path = [
        [x, y, z]
        for z in np.arange(0.3, 4, 0.3)
        for k, y in enumerate(np.arange(-5, 5, 0.336))
        for x in ((-5, 5) if k % 2 == 0 else (5, -5))
    ]
    width = np.full(len(path), 0.4)
    width[0] = 0
    hits = run(profile, Motion(upright(path), width))
    assert len(hits.rows) == 0


def test_a_tilted_head_over_the_bed_is_found_and_a_raised_one_is_not():
    profile = machine(NOZZLE, {"shape": "cylinder", "name": "head", "bottom": 8, "top": 40, "diameter": 60})
    low = np.array([[0, 0, 60, 0, 0], [0, 0, 1, math.radians(40), 0]], dtype=float)
    # at A = 40 degrees the tip is brought back over the part's origin by the linear joints
    for joints, hit in ((low, True), (low + np.array([0, 0, 40, 0, 0]), False)):
        tips, _ = forward(profile, joints)
        moved = joints.copy()
        moved[1, :3] -= side_matrices(profile, joints, "work")[1, :3, :3] @ (tips[1] - [0, 0, tips[1, 2]])
        hits = run(profile, Motion(moved, np.zeros(2)))
        assert bool(len(hits.rows)) is hit


def test_clamps_stand_on_the_bed():
    profile = machine(NOZZLE, clamps=(box("clamp", [8, -4, 0], [14, 4, 6]),))
    hits = run(profile, mid_air([[-10, 0, 10], [-10, 0, 3], [7, 0, 3]]))
    assert hits.rows.tolist() == [2]
    # at the clamp's top the cone reaches from the tip at X = 7 to 8.95
    assert 8 <= hits.points[0, 0] <= 8.95
    assert not len(run(profile, mid_air([[-10, 0, 10], [-10, 0, 7], [12, 0, 7]])).rows)


def test_the_nozzle_may_press_on_the_plate_and_not_run_into_it():
    """A bead's own squeeze is allowed, as on plastic; the block may not touch the plate at all."""
    profile = machine(NOZZLE)
    for z, hit in ((0.05, False), (-0.05, False), (-0.2, True)):
        assert bool(names_hit(profile, mid_air([[0, 0, 5], [0, 0, z], [5, 0, z]]))) is hit
    low = machine({**NOZZLE, "bottom": 0.2}, box("block", [-4, -4, 0.15], [4, 4, 9]))
    assert {min(pair) for _, pair in names_hit(low, mid_air([[0, 0, 5], [0, 0, -0.16]]))} == {"bed"}


@pytest.mark.parametrize("seed", [101, 102, 103])
def test_nothing_is_missed_against_a_dense_oracle(seed):
    """Random walls and clamps, random tilted moves in mid-air and through things: the same rows and bodies."""
    profile, motion = printed_scene(np.random.default_rng(seed))
    compare(profile, motion, apart=0.4, step=0.2)


def compare(profile: MachineProfile, motion: Motion, apart: float, step: float) -> None:
    """What the oracle finds is found, and what is found is near enough to something for the oracle to say so."""
    expected, found = Oracle(profile, motion, apart).worst(step), names_hit(profile, motion)
    assert {key for key, least in expected.items() if least < 0} <= set(found)
    assert {key for key in found if expected.get(key, 1.0) > apart + step} == set()


def test_a_hull_is_met_where_it_is_and_passes_where_its_box_would_not():
    """A wedge in the head over a clamp: the thin end passes, the thick end runs into it."""
    wedge = [[-10, y, 9] for y in (-5, 5)] + [[10, y, z] for y in (-5, 5) for z in (3, 9)]
    head = {"shape": "hull", "name": "wedge", "points": [*wedge, [0, 0, 8]]}
    profile = machine(NOZZLE, head, clamps=(box("clamp", [-14, -8, 0], [-8, -6, 7]),))
    assert names_hit(profile, mid_air([[0, -30, 2], [-6, -10.5, 2]])) == {}
    found = names_hit(profile, mid_air([[0, -30, 2], [-20, -10.5, 2]]))
    assert {pair for _, pair in found} == {frozenset(("wedge", "clamp"))}
