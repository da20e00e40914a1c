"""Collision along the motion: exact distances, nothing missed against a dense oracle, no alarm where there is none."""

import math
import tomllib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from trunnion_core.profile import MachineProfile, profile_from_file, shipped_profiles
from trunnion_core.profile_file import ProfileFile
from trunnion_sim.chain import forward, side_matrices
from trunnion_sim.collision.scene import CELL, make_scene
from trunnion_sim.collision.solids import signed_distance
from trunnion_sim.collision.sweep import PRESS, Hits, sweep

NOZZLE = {"shape": "cone", "name": "nozzle", "bottom": 0, "top": 6, "bottom_diameter": 0.8, "top_diameter": 7}
BLOCK = {"shape": "box", "name": "block", "min": [-10, -8, 6], "max": [10, 8, 16]}


def machine(*bodies: dict[str, object], clamps: tuple[dict[str, object], ...] = ()) -> MachineProfile:
    data = tomllib.loads(shipped_profiles()["generic_ab_cradle"].read_text())
    data["tool"]["body"] = list(bodies)
    data["work"]["body"] = list(clamps)
    data["work"]["bed"] = {"shape": "rectangle", "min": [-16, -16], "max": [16, 16], "height": 100, "thickness": 3}
    return profile_from_file(ProfileFile.model_validate(data), "test")


def upright(points: list[list[float]]) -> np.ndarray:
    """Joints of the cradle with both rotaries at zero: the linear joints are the tip itself."""
    return np.column_stack([np.array(points, dtype=float), np.zeros((len(points), 2))])


def run(profile: MachineProfile, joints: np.ndarray, width: np.ndarray, height: float = 0.3) -> Hits:
    points, axes = forward(profile, joints)
    n = len(joints)
    return sweep(make_scene(profile), joints, points, axes, width, np.full(n, height), np.ones(n, dtype=bool))


def outline_distance(row: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distance by another road: the revolved outline as a polygon, its edges and the crossing rule in 2D."""
    if row[0] == 1:
        outside = np.maximum(np.maximum(row[1:4] - points, points - row[4:7]), 0)
        depth = np.minimum(points - row[1:4], row[4:7] - points).min(axis=1)
        return np.where(depth > 0, -depth, np.linalg.norm(outside, axis=1))
    rho = np.hypot(points[:, 0] - row[1], points[:, 1] - row[2])
    outline = np.array([[-row[5], row[3]], [row[5], row[3]], [row[6], row[4]], [-row[6], row[4]]])
    p = np.column_stack([rho, points[:, 2]])
    distance = np.full(len(p), np.inf)
    inside = np.ones(len(p), dtype=bool)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        edge = b - a
        if not edge.any():
            continue
        t = np.clip((p - a) @ edge / (edge @ edge), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(p - a - t[:, None] * edge, axis=1))
        inside &= edge[0] * (p[:, 1] - a[1]) - edge[1] * (p[:, 0] - a[0]) >= 0
    return np.where(inside, -distance, distance)


@settings(max_examples=200, deadline=None)
@given(
    st.tuples(*[st.floats(0.01, 10.0)] * 3, st.floats(0.5, 20)),
    st.tuples(*[st.floats(-30, 30)] * 3),
)
def test_distance_to_a_cone_is_that_to_its_outline(shape, point):
    r0, r1, shift, height = shape
    row = np.array([0.0, shift, -shift, 1.0, 1.0 + height, r0, r1, 0.0])
    expected = outline_distance(row, np.array([point]))[0]
    assert signed_distance(row, *point) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.tuples(*[st.floats(0.5, 10.0)] * 3), st.tuples(*[st.floats(-30, 30)] * 3))
def test_distance_to_a_box_is_that_of_its_faces(size, point):
    row = np.array([1.0, -1.0, -2.0, -3.0, size[0], size[1], size[2], 0.0])
    expected = outline_distance(row, np.array([point]))[0]
    assert signed_distance(row, *point) == pytest.approx(expected, abs=1e-9)


def test_travel_through_a_wall_is_found_where_it_stands():
    """A wall 5 mm high along Y; the nozzle crosses it at z = 2 in one move of 20 mm."""
    profile = machine(NOZZLE)
    walls = [p for z in np.arange(0.3, 5.1, 0.3) for p in ([0, -8, z], [0, 8, z], [0, 8, 12], [0, -8, 12])]
    path = [[-10, -8, 12], *walls, [-10, 0, 12], [-10, 0, 2], [10, 0, 2]]
    on_wall = [a[0] == b[0] == 0 and a[2] == b[2] < 6 for a, b in pairwise(path)]
    width = np.where(on_wall, 0.4, 0.0)
    hits = run(profile, upright(path), np.append(0.0, width))
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
    hits = run(profile, upright(path), width)
    assert len(hits.rows) == 0


def test_a_tilted_head_over_the_bed_is_found_and_a_raised_one_is_not():
    profile = machine(NOZZLE, {"shape": "cylinder", "name": "head", "bottom": 8, "top": 40, "diameter": 60})
    low = np.array([[0, 0, 60, 0, 0], [0, 0, 1, math.radians(40), 0]], dtype=float)
    # at A = 40 degrees the tip is brought back over the part's origin by the linear joints
    for joints, hit in ((low, True), (low + np.array([0, 0, 40, 0, 0]), False)):
        tips, _ = forward(profile, joints)
        moved = joints.copy()
        moved[1, :3] -= side_matrices(profile, joints, "work")[1, :3, :3] @ (tips[1] - [0, 0, tips[1, 2]])
        hits = run(profile, moved, np.zeros(2))
        assert bool(len(hits.rows)) is hit


def test_clamps_stand_on_the_bed():
    clamp = {"shape": "box", "name": "clamp", "min": [8, -4, 0], "max": [14, 4, 6]}
    profile = machine(NOZZLE, clamps=(clamp,))
    hits = run(profile, upright([[-10, 0, 10], [-10, 0, 3], [7, 0, 3]]), np.zeros(3))
    assert hits.rows.tolist() == [2]
    assert hits.points[0, 0] == pytest.approx(8, abs=CELL)
    assert not len(run(profile, upright([[-10, 0, 10], [-10, 0, 7], [12, 0, 7]]), np.zeros(3)).rows)


def random_clamps(rng: np.random.Generator) -> tuple[dict[str, object], ...]:
    low = rng.uniform(-14, 8, (4, 2))
    high = low + rng.uniform(1, 6, (4, 2))
    top = rng.uniform(1, 9, 4)
    return tuple(
        {"shape": "box", "name": "clamp", "min": [*a, 0], "max": [*b, z]}
        for a, b, z in zip(low, high, top, strict=True)
    )


def dense_oracle(profile: MachineProfile, joints: np.ndarray, step: float) -> np.ndarray:
    """(rows, bodies) deepest entry in mm by brute force: poses `step` apart, columns sampled as finely as cells."""
    scene = make_scene(profile)
    i, j = np.nonzero(scene.ground > -100)
    tops = scene.ground[i, j].astype(float)
    levels = np.arange(0, tops.max() - scene.floor + CELL, CELL)
    z = np.minimum(scene.floor + levels[None, :], tops[:, None])
    across = scene.corner + np.column_stack([i, j]) * CELL
    columns = np.column_stack([np.repeat(across, len(levels), axis=0), z.ravel()])
    columns = np.unique(columns, axis=0)
    tree = cKDTree(columns)
    worst = np.full((len(joints), len(scene.bodies)), np.inf)
    for row in range(1, len(joints)):
        far = np.linalg.norm(joints[row, :3] - joints[row - 1, :3])
        far += 80 * np.abs(joints[row, 3:] - joints[row - 1, 3:]).sum()
        for t in np.linspace(0, 1, 2 + int(far / step)):
            q = (joints[row - 1] + t * (joints[row] - joints[row - 1]))[None]
            work, tool = side_matrices(profile, q, "work")[0], side_matrices(profile, q, "tool")[0]
            turn = work[:3, :3].T @ tool[:3, :3] @ scene.turns[0]
            tip = work[:3, :3].T @ (tool[:3, 3] + tool[:3, :3] @ profile.tip - work[:3, 3]) - profile.origin
            for b, body in enumerate(scene.bodies):
                near = columns[tree.query_ball_point(tip + turn @ scene.middles[b], scene.radii[b])]
                local = (near - tip) @ turn
                local = local[local[:, 2] > PRESS]
                if len(local):
                    worst[row, b] = min(worst[row, b], outline_distance(body, local).min())
    return worst


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_missed_against_a_dense_oracle(seed):
    """Random clamps, random tilted moves in mid-air and through things: the same rows and bodies, the same depth."""
    rng = np.random.default_rng(seed)
    clamps = random_clamps(rng)
    profile = machine(NOZZLE, BLOCK, clamps=clamps)
    joints = np.column_stack([rng.uniform(-12, 12, (4, 2)), rng.uniform(1, 14, 4), rng.uniform(-0.15, 0.15, (4, 2))])
    expected = dense_oracle(profile, joints, 0.1)
    found = np.full_like(expected, np.inf)
    hits = run(profile, joints, np.zeros(4))
    found[hits.rows, hits.body] = -hits.depth
    surely, surely_not = expected < -0.1, expected > 0.1
    assert np.isfinite(found[surely]).all()
    assert not np.isfinite(found[surely_not]).any()
    np.testing.assert_allclose(found[surely], expected[surely], atol=0.15)


def with_body(carried_by: str, low: list[float], high: list[float]) -> MachineProfile:
    """The cradle without a nozzle, and one beam."""
    shipped = tomllib.loads(shipped_profiles()["generic_ab_cradle"].read_text())
    shipped["tool"]["body"] = []
    solid = {"shape": "box", "name": "beam", "min": low, "max": high}
    shipped["body"] = [{"carried_by": carried_by, "solid": solid}]
    return profile_from_file(ProfileFile.model_validate(shipped), "test")


@pytest.mark.parametrize(("carrier", "follows"), [("frame", ""), ("X", "X"), ("Y", "XY"), ("Z", "XYZ")])
def test_a_beam_moves_with_the_joints_that_carry_it(carrier: str, follows: str) -> None:
    """A column of plastic 12 mm high at the origin, a beam 4 mm above the plate at X = 30: who brings it there?"""
    profile = with_body(carrier, [25, -5, 4], [35, 5, 10])
    column = [[0, 0, z] for z in np.arange(0.3, 12, 0.3)]
    path = [[1.5, 0, 0.3], *(p for c in column for p in (c, [1.5, 0, c[2]])), [1.5, 0, 60]]
    width = np.append(np.append(0.0, np.full(len(path) - 2, 0.4)), 0.0)
    away = {"X": [-30, 0, 0], "XY": [-30, 0, 0], "XYZ": [-30, 0, 0], "": [-30, 0, 60]}[follows]
    hits = run(profile, upright([*path, away]), np.append(width, 0.0))
    assert (len(path) in hits.rows) == (follows != "")
    high = run(profile, upright([*path, [-30, 0, 60]]), np.append(width, 0.0))
    assert (len(path) in high.rows) == (follows in ("X", "XY"))


def test_a_tilting_table_brings_the_part_to_a_fixed_beam() -> None:
    profile = with_body("frame", [-150, 60, 20], [150, 80, 40])
    still = upright([[0, 0, 100], [0, 0, 100]])
    tilted = still.copy()
    tilted[1, 3] = np.radians(50)
    assert not len(run(profile, upright([[0, 0, 100], [50, 50, 90]]), np.zeros(2)).rows)
    hits = run(profile, tilted, np.zeros(2))
    assert set(hits.rows) == {1}


def test_what_moves_with_the_part_is_no_body_of_the_frame() -> None:
    with pytest.raises(ValueError, match="carried_by is A, should be one of frame, X, Y, Z"):
        with_body("A", [0, 0, 0], [1, 1, 1])
