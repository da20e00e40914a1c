"""Bodies of the machine against each other: distances by another road, who carries what, and nothing missed."""

import math
import tomllib

import numpy as np
import pytest
from collision_oracle import BLOCK, NOZZLE, Motion, Oracle, box, machine, machine_scene, names_hit, run
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from trunnion_core.profile import Joint, MachineProfile, load_profile, profile_from_file, shipped_profiles
from trunnion_core.profile_file import ProfileFile
from trunnion_core.solid_tables import BoxTable, CylinderTable, HullTable, SolidTable
from trunnion_sim.chain import joint_matrices
from trunnion_sim.collision.distance import CONTACT, depth, proven_distance
from trunnion_sim.collision.pairs import approach, make_pairs
from trunnion_sim.collision.place import Bodies, Chain
from trunnion_sim.collision.scene import make_scene
from trunnion_sim.collision.solids import ball_of, rows_of, signed_distance


def still(seed: int, *solids: SolidTable) -> tuple:
    """Two solids placed at random: rows, their placements, the tables of hulls."""
    rng = np.random.default_rng(seed)
    rows, corners, faces = rows_of(solids)
    turns = [Rotation.from_quat(rng.normal(size=4)).as_matrix() for _ in solids]
    return rows, turns, [rng.uniform(-14, 14, 3), rng.uniform(-4, 4, 3)], corners, faces


def measured(rows, turns, places, corners) -> tuple[float, np.ndarray, np.ndarray]:
    n, place = np.zeros(3), np.zeros(3)
    gap = proven_distance(rows[0], turns[0], places[0], rows[1], turns[1], places[1], corners, 1e300, 1.0, n, place)
    return gap, n, place


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.tuples(*[st.floats(0.2, 9)] * 6))
def test_distance_between_boxes_is_the_least_squares_one(seed, sizes):
    """Points of two boxes are linear in their coordinates, so the nearest two are a bounded least-squares problem."""
    solids = [BoxTable(shape="box", name="b", min=(0, 0, 0), max=size) for size in (sizes[:3], sizes[3:])]
    rows, turns, places, corners, _ = still(seed, *solids)
    best = lsq_linear(np.hstack([turns[0], -turns[1]]), places[1] - places[0], (0, np.array(sizes)), tol=1e-14)
    expected = math.sqrt(2 * best.cost)
    gap, n, place = measured(rows, turns, places, corners)
    if expected > 1.01 * CONTACT:
        assert gap == pytest.approx(expected, abs=1e-5)
        assert np.linalg.norm(n) == pytest.approx(1)
    else:
        assert gap < CONTACT
        for row, turn, at in zip(rows, turns, places, strict=True):
            assert signed_distance(row, np.empty((0, 4)), *(turn.T @ (place - at))) < 1.01 * CONTACT


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.3, 8), st.floats(1, 20))
def test_a_cylinder_is_as_far_as_the_prism_around_it_says(seed, radius, length):
    """A prism of 60 sides holds the cylinder and is held by one 0.14 % wider: the distances bracket."""
    angle = np.arange(60) * np.pi / 30
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    other = BoxTable(shape="box", name="b", min=(-3, -2, -1), max=(3, 2, 1))
    gaps = []
    for wide in (radius, radius / math.cos(math.pi / 60)):
        ends = [np.column_stack([wide * ring, np.full(60, z)]) for z in (0.0, length)]
        prism = HullTable(shape="hull", name="p", points=tuple(map(tuple, np.concatenate(ends).tolist())))
        gaps.append(measured(*still(seed, prism, other)[:4])[0])
    cylinder = CylinderTable(shape="cylinder", name="c", bottom=0, top=length, diameter=2 * radius)
    gap = measured(*still(seed, cylinder, other)[:4])[0]
    if gaps[1] > CONTACT:
        assert gaps[1] - 1e-6 <= gap <= gaps[0] + 1e-6


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.tuples(*[st.floats(0.3, 8)] * 2), st.tuples(*[st.floats(1, 15)] * 2))
def test_distance_between_cylinders_is_that_of_fcl(seed, radii, lengths):
    fcl = pytest.importorskip("fcl")
    shapes = zip(radii, lengths, strict=True)
    ends = [(radius, -length / 2, length / 2) for radius, length in shapes]
    solids = [
        CylinderTable(shape="cylinder", name="c", bottom=low, top=high, diameter=2 * radius)
        for radius, low, high in ends
    ]
    rows, turns, places, corners, _ = still(seed, *solids)
    objects = [
        fcl.CollisionObject(fcl.Cylinder(radius, high - low), fcl.Transform(turn, at))
        for (radius, low, high), turn, at in zip(ends, turns, places, strict=True)
    ]
    expected = fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult())
    gap = measured(rows, turns, places, corners)[0]
    if expected > CONTACT + 1e-3:
        assert gap == pytest.approx(expected, abs=1e-3)
    elif expected < CONTACT - 1e-3:
        assert gap < CONTACT


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_what_is_said_to_be_the_depth_sets_two_boxes_free(seed):
    rng = np.random.default_rng(seed)
    solids = [BoxTable(shape="box", name="b", min=tuple(-size), max=tuple(size)) for size in rng.uniform(1, 6, (2, 3))]
    rows, turns, places, corners, _ = still(seed, *solids)
    places[0] = places[1] + rng.uniform(-1, 1, 3)
    n = np.array([0.0, 0.0, 1.0])
    deep = depth(rows[0], turns[0], places[0], rows[1], turns[1], places[1], corners, n)
    assert deep > 0
    ways = Rotation.random(50, random_state=seed).apply([0.0, 0.0, 1.0])
    for way in ways:
        places_less = [places[0] + way * deep * 0.98, places[1]]
        assert measured(rows, turns, places_less, corners)[0] < CONTACT


def random_machine(rng: np.random.Generator) -> tuple[list[Joint], Chain, Bodies]:
    """Three linear and two rotary joints in any order on any side, in any direction, and a box on every link."""
    kinds = rng.permutation([False, False, False, True, True])
    joints = []
    for letter, rotary in zip("XYZAB", kinds.tolist(), strict=True):
        axis = rng.normal(size=3)
        values = dict.fromkeys(("speed", "acceleration", "jerk", "corner_speed", "home", "steps_per_unit"), 1.0)
        side = "work" if rng.random() < 0.5 else "tool"
        point = rng.uniform(-20, 20, 3) * rotary
        joints.append(Joint(letter, side, rotary, axis / np.linalg.norm(axis), point, -1.0, 1.0, **values))
    work = np.array([joint.side == "work" for joint in joints])
    chain = Chain(
        work, kinds, np.stack([j.axis for j in joints]), np.stack([j.point for j in joints]), rng.uniform(-5, 5, 3)
    )
    carried = [np.zeros(5, bool)] + [(work == work[k]) & (np.arange(5) <= k) for k in range(5)]
    solids = [BoxTable(shape="box", name="b", min=(0, 0, 0), max=tuple(rng.uniform(1, 9, 3))) for _ in carried]
    rows, corners, faces = rows_of(solids)
    balls = [ball_of(row, corners) for row in rows]
    bodies = Bodies(
        rows,
        corners,
        faces,
        np.array([ball[0] for ball in balls]),
        np.array([ball[1] for ball in balls]),
        Rotation.random(6, random_state=rng.integers(1 << 30)).as_matrix(),
        rng.uniform(-20, 20, (6, 3)),
        np.array(carried),
        np.zeros(6, bool),
    )
    return joints, chain, bodies


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6))
def test_no_row_uses_up_more_of_a_gap_than_is_said(seed: int) -> None:
    """The bound that everything rests on, on machines of every build: corners of two boxes, placed by 4x4 matrices."""
    rng = np.random.default_rng(seed)
    joints, chain, bodies = random_machine(rng)
    a, b = rng.choice(6, 2, replace=False).tolist()
    before, after = rng.uniform(-1, 1, (2, 5)) * np.where(chain.rotary, 2.0, 20.0)
    pairs = make_pairs(np.array([[a, b]]), chain, bodies, np.maximum(np.abs(before), np.abs(after)))
    n = Rotation.random(random_state=rng.integers(1 << 30)).apply([0.0, 0.0, 1.0])
    used = approach(before, after, 0, pairs, n, np.empty(2))

    def gap(share: float) -> float:
        q = before + share * (after - before)
        reach = []
        for one, other in ((a, b), (b, a)):
            matrix = np.eye(4)
            for j, joint in enumerate(joints):
                if bodies.carried[one, j] and not bodies.carried[other, j]:
                    matrix = matrix @ joint_matrices(joint, q[j : j + 1])[0]
            corners = np.array(np.meshgrid(*zip(bodies.rows[one, 1:4], bodies.rows[one, 4:7], strict=True)))
            placed = corners.reshape(3, -1).T @ bodies.turns[one].T + bodies.places[one]
            reach.append((placed @ matrix[:3, :3].T + matrix[:3, 3]) @ n)
        return float(reach[0].min() - reach[1].max())

    start = gap(0.0)
    for share in rng.uniform(0, 1, 5):
        assert gap(share) >= start - share * used - 1e-9


def cradle_with(carried_by: str, low: list[float], high: list[float], *tool: dict[str, object]) -> MachineProfile:
    """The cradle with a beam."""
    return machine(*tool, bodies=({"carried_by": carried_by, "solid": box("beam", low, high)},))


def moves(*joints: list[float]) -> Motion:
    """Rows in mid-air; X, Y, Z in mm, A, B in degrees."""
    values = np.array(joints, dtype=float)
    values[:, 3:] = np.radians(values[:, 3:])
    return Motion(values, np.zeros(len(values)))


@pytest.mark.parametrize("carrier", ["frame", "X", "Y", "Z", "A", "B"])
def test_a_beam_moves_with_the_joints_that_carry_it(carrier: str) -> None:
    """Each joint on its own: the head goes to the beam, or the beam comes along, or the plate turns into it."""
    beside = cradle_with(carrier, [25, -5, 4], [35, 5, 10], NOZZLE)
    head_meets = {row for row, pair in names_hit(beside, moves([0, 0, 6, 0, 0], [30, 0, 6, 0, 0])) if "nozzle" in pair}
    assert bool(head_meets) is (carrier in ("frame", "A", "B"))
    # 40 mm above the axes, an edge of the plate rises by 3 mm on its way over them
    over = cradle_with(carrier, [-40, -5, 2], [40, 5, 6])
    plate_meets = names_hit(over, moves([0, 0, 0, 0, 0], [0, 0, 0, 40, 0]))
    assert bool(plate_meets) is (carrier in ("frame", "X", "Y", "Z"))
    across = cradle_with(carrier, [-5, -40, 2], [5, 40, 6])
    plate_meets = names_hit(across, moves([0, 0, 0, 0, 0], [0, 0, 0, 0, -40]))
    assert bool(plate_meets) is (carrier in ("frame", "X", "Y", "Z", "A"))


@pytest.mark.parametrize(("carrier", "follows"), [("frame", ""), ("X", "X"), ("Y", "XY"), ("Z", "XYZ"), ("A", "")])
def test_a_beam_meets_the_part_as_far_as_it_is_printed(carrier: str, follows: str) -> None:
    """A column of plastic 12 mm high at the origin, a beam 4 mm above the plate at X = 30: who brings it there?"""
    profile = cradle_with(carrier, [25, -5, 4], [35, 5, 10])
    column = [[0, 0, z] for z in np.arange(0.3, 12, 0.3)]
    path = [[1.5, 0, 0.3], *(p for c in column for p in (c, [1.5, 0, c[2]])), [1.5, 0, 60]]
    width = np.append(np.append(0.0, np.full(len(path) - 2, 0.4)), [0.0, 0.0])

    def brought(x: float, z: float) -> bool:
        joints = np.column_stack([np.array([*path, [x, 0, z]], dtype=float), np.zeros((len(path) + 1, 2))])
        hits = names_hit(profile, Motion(joints, width))
        return any(row == len(path) and "the part" in pair for row, pair in hits)

    assert brought(-30, 0 if follows == "XYZ" else 60) == (follows != "")
    assert brought(-30, 60) == (follows in ("X", "XY"))


def test_a_turning_table_brings_the_part_to_a_fixed_beam() -> None:
    profile = cradle_with("frame", [-150, 60, 20], [150, 80, 40])
    wide = tomllib.loads(shipped_profiles()["generic_ab_cradle"].read_text())
    wide["tool"]["body"] = []
    wide["body"] = [{"carried_by": "frame", "solid": box("beam", [-150, 60, 20], [150, 80, 40])}]
    assert not names_hit(profile, moves([0, 0, 100, 0, 0], [50, 50, 90, 0, 0]))
    hits = run(
        profile_from_file(ProfileFile.model_validate(wide), "test"), moves([0, 0, 100, 0, 0], [0, 0, 100, 50, 0])
    )
    assert set(hits.rows) == {1}


@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_a_touch_in_the_middle_of_a_fast_turn_is_found(angle: float) -> None:
    """A finger on the plate sweeps past a thin post within one row, and is clear of it at both ends."""
    profile = machine(
        clamps=(box("finger", [-1, -1, 0], [1, 1, 20]),),
        bodies=({"carried_by": "frame", "solid": box("post", [-0.5, -1, 19], [0.5, 1, 40])},),
    )
    swing = moves([0, 0, 90, 0, -angle - 25], [0, 0, 90, 0, 55 - angle])
    found = names_hit(profile, swing)
    assert {tuple(sorted(pair)) for _, pair in found} == {("finger", "post")}
    gone = machine(
        clamps=(box("finger", [-1, -1, 0], [1, 1, 20]),),
        bodies=({"carried_by": "frame", "solid": box("post", [-0.5, -1, 20.1], [0.5, 1, 40])},),
    )
    assert names_hit(gone, swing) == {}


def test_what_is_named_in_touches_is_not_tested_and_everything_else_is() -> None:
    beam = {"carried_by": "X", "solid": box("beam", [-5, -20, 10], [5, 20, 14]), "touches": ["block"]}
    motion = moves([0, 0, 0.5, 0, 0], [0, 0, 4, 0, 0])
    assert {pair for _, pair in names_hit(machine(BLOCK, bodies=(beam,)), motion)} == set()
    assert {pair for _, pair in names_hit(machine(BLOCK, bodies=({**beam, "touches": []},)), motion)} == {
        frozenset(("beam", "block"))
    }
    with pytest.raises(ValueError, match="beam: touches bloc, which is no body; did you mean 'block'"):
        machine(BLOCK, bodies=({**beam, "touches": ["bloc"]},))
    with pytest.raises(ValueError, match="carried_by is Q, should be one of frame, X, Y, Z, A, B"):
        machine(BLOCK, bodies=({**beam, "carried_by": "Q"},))


def test_bodies_on_one_link_are_no_pair_and_every_other_two_are() -> None:
    scene = make_scene(machine(NOZZLE, BLOCK, clamps=(box("clamp", [0, 0, 0], [1, 1, 1]),)))
    pairs = {frozenset((scene.names[a], scene.names[b])) for a, b in scene.pairs.tolist()}
    assert pairs == {frozenset((a, b)) for a in ("nozzle", "block") for b in ("clamp", "bed", "the part")}


@pytest.mark.parametrize("kind", range(4))
def test_nothing_is_missed_against_a_dense_oracle(kind: int) -> None:
    """Beams, tables, posts, clamps, head and part on four kinds of machine, the rotaries turning fast."""
    profile, motion = machine_scene(np.random.default_rng(kind + 100), kind)
    expected, found = Oracle(profile, motion, 1.0).worst(0.5), names_hit(profile, motion)
    assert {key for key, least in expected.items() if least < 0} <= set(found)
    assert {key for key in found if expected.get(key, 1.0) > 0.7 + 0.25} == set()


@pytest.mark.parametrize("name", shipped_profiles())
def test_a_shipped_machine_is_free_at_home_and_turns_all_the_way_with_the_head_away(name: str) -> None:
    """What touches while nothing is near the part is a wrong profile, or is missing from `touches`."""
    profile = load_profile(name)
    away = profile.array("home")
    turned = np.clip(profile.array("max"), None, 2 * np.pi), np.clip(profile.array("min"), -2 * np.pi, None)
    for j, joint in enumerate(profile.joints):
        if not joint.rotary and abs(joint.axis[2]) > 0.9:
            away[j] = joint.max
    poses = [profile.array("home"), away]
    for first in turned:
        for second in turned:
            pose = away.copy()
            for j, ends in zip(profile.rotary, (first, second), strict=False):
                pose[j] = ends[j]
            poses += [pose, away]
    found = names_hit(profile, Motion(np.stack(poses), np.zeros(len(poses))))
    assert found == {}
