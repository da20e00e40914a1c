"""Fit and placement: against trying every place, and with names for what gives up."""

import re
from dataclasses import replace

import numpy as np
import pytest

from trunnion_core.errors import PlacementError
from trunnion_core.mesh import Mesh
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_kinematics.chain import JointChain
from trunnion_motion.fit import Poses, fits
from trunnion_motion.place import SHIFT_STEP, TURN_STEP_DEG, Placement, place
from trunnion_motion.plan import plan


def slab(x, y, z, tilt=0.0):
    """Corners of a box under the upright tool, and its top corners with the tool leant in x."""
    corners = np.array([[a * x / 2, b * y / 2, c * z] for a in (-1, 1) for b in (-1, 1) for c in (0, 1)])
    upright = np.tile([0.0, 0, 1], (8, 1))
    leant = np.tile([np.sin(tilt), 0, np.cos(tilt)], (8, 1))
    return Poses(np.concatenate([corners, corners]), np.concatenate([upright, leant]))


def moved(poses, x, y):
    return Poses(poses.points + np.array([x, y, 0.0]), poses.tool_axes)


def any_grid_place_holds(poses, profile):
    """The slow road: every turn, every shift, every pose, each with its own inverse solution."""
    chain = JointChain.from_profile(profile)
    bed = profile.bed
    middle = (poses.points[:, :2].min(axis=0) + poses.points[:, :2].max(axis=0)) / 2
    half = bed.diameter / 2 if bed.diameter else max(np.abs([*bed.min, *bed.max]))
    most = int(np.ceil((half + np.abs(middle).max()) / SHIFT_STEP))
    side = np.arange(-most, most + 1) * SHIFT_STEP
    shifts = np.stack(np.meshgrid(side, side, [0.0], indexing="ij"), axis=-1).reshape(-1, 1, 3)
    low, high = profile.array("min"), profile.array("max")
    for turn in range(0, 360, TURN_STEP_DEG):
        turned = Placement(turn, (0.0, 0.0), (middle[0], middle[1])).of(poses)
        points = shifts + turned.points
        if bed.diameter:
            over = np.hypot(points[..., 0], points[..., 1]) <= bed.diameter / 2
        else:
            over = ((points[..., :2] >= bed.min) & (points[..., :2] <= bed.max)).all(axis=2)
        points = points[(over & (points[..., 2] <= bed.height)).all(axis=1)]
        axes = np.broadcast_to(turned.tool_axes, points.shape)
        states = chain.inverse(points.reshape(-1, 3), axes.reshape(-1, 3))
        reached = ((states >= low) & (states <= high)).all(axis=2).any(axis=0).reshape(points.shape[:2])
        if reached.all(axis=1).any():
            return True
    return False


def random_part(rng, profile):
    """Eight leaning poses, as large as the machine takes or a little larger, somewhere near its bed."""
    bed = profile.bed
    half = bed.diameter / 2 if bed.diameter else max(bed.max)
    size = np.array([half, half, 0.5 * bed.height]) * rng.uniform([0.2, 0.1, 0.1], [1.0, 0.7, 2.0])
    points = rng.uniform([-1, -1, 0], [1, 1, 2], (8, 3)) * size
    points += np.append(rng.uniform(-half, half, 2), 0.0)
    lean, bearing = np.radians(rng.uniform(2, rng.choice([25, 50, 75]), 8)), rng.uniform(-np.pi, np.pi, 8)
    return Poses(
        points, np.stack([np.sin(lean) * np.cos(bearing), np.sin(lean) * np.sin(bearing), np.cos(lean)], axis=1)
    )


def test_what_fits_stays_where_it_is():
    found = place(slab(40, 40, 20, 0.4), load_profile("generic_ab_cradle"))
    assert found.turn_deg == 0
    assert found.shift == (0.0, 0.0)


def test_a_part_beside_the_bed_is_brought_back():
    profile = load_profile("generic_3axis")
    poses = moved(slab(60, 40, 20), 130, 0)
    assert not fits(poses, profile).ok
    found = place(poses, profile)
    assert found.turn_deg == 0
    assert found.shift == (-50.0, 0.0)
    assert fits(found.of(poses), profile).ok


def test_a_long_part_is_turned_to_the_long_side(paths):
    linear = paths["linear"]
    profile = paths["machine"](
        [
            linear("X", "tool", [1, 0, 0], -40, 40),
            linear("Y", "tool", [0, 1, 0], -150, 150),
            linear("Z", "tool", [0, 0, 1], 0, 100),
        ]
    )
    found = place(slab(150, 30, 10), profile)
    assert abs(found.turn_deg) in (70, 75, 80)
    assert fits(found.of(slab(150, 30, 10)), profile).ok
    exact = [
        fits(Placement(turn, (0.0, 0.0), (0.0, 0.0)).of(slab(150, 30, 10)), profile).ok for turn in range(0, 95, 5)
    ]
    assert exact.index(True) * 5 == abs(found.turn_deg)


@pytest.mark.parametrize("kind", ["ab", "bc"])
@pytest.mark.parametrize("seed", range(6))
def test_a_place_is_found_exactly_when_trying_every_place_finds_one(machines, kind, seed):
    """A machine so tight that only few places hold, or none."""
    rng = np.random.default_rng(seed)
    profile = machines[kind]
    low, high = rng.uniform(14, 36, 2)
    joints = tuple(replace(joint, min=-low, max=high) if joint.letter in "XY" else joint for joint in profile.joints)
    tight = replace(profile, joints=joints)
    points = rng.uniform(-25, 25, (6, 3)) + np.append(rng.uniform(-30, 30, 2), 30)
    axes = rng.normal(size=(6, 3)) * (0.2 if kind == "ab" else 0.4) + [0, 0, 1]
    poses = Poses(points, axes / np.linalg.norm(axes, axis=1, keepdims=True))
    try:
        found = place(poses, tight)
    except PlacementError:
        assert not any_grid_place_holds(poses, tight)
    else:
        assert fits(found.of(poses), tight).ok


@pytest.mark.parametrize("name", ["generic_ab_cradle", "open5x_prusa_i3", "open5x_voron0", "rep5x_ender3"])
def test_on_every_machine_random_parts_find_a_place_whenever_trying_every_place_does(name):
    profile = load_profile(name)
    found = []
    for seed in range(14):
        poses = random_part(np.random.default_rng([seed, 3]), profile)
        holds = any_grid_place_holds(poses, profile)
        try:
            there = place(poses, profile)
        except PlacementError as error:
            refused = str(error)
        else:
            assert fits(there.of(poses), profile).ok
            found.append(seed)
            continue
        assert not holds
        assert re.search(r"point \(.*\) mm with tool axis \(.*\).*: joint [A-Z] |lie beside or above", refused)
    assert 4 <= len(found) <= 10  # neither road is asked for the obvious only


def test_of_a_part_beside_the_bed_the_joint_is_named_that_gives_up_on_it():
    beside = moved(slab(20, 20, 10, np.radians(75)), 300, 0)
    with pytest.raises(PlacementError, match=r"in the middle of the bed: point .* joint B would need"):
        place(beside, load_profile("generic_ab_cradle"))


def test_what_cannot_fit_names_joint_and_place():
    profile = load_profile("generic_ab_cradle")
    steep = slab(20, 20, 10, np.radians(75))
    fit = fits(steep, profile)
    assert {finding.axis for finding in fit.findings} == {"B"}
    assert all(finding.point is not None for finding in fit.findings)
    with pytest.raises(PlacementError, match="joint B would need"):
        place(steep, profile)


def test_a_part_too_tall_is_off_bed():
    fit = fits(slab(20, 20, 300), load_profile("generic_ab_cradle"))
    assert "off-bed" in {finding.code for finding in fit.findings}


def test_the_poses_of_a_mesh_are_its_vertices_and_flat_normals():
    pyramid = Mesh(
        np.array([[-10.0, -10, 0], [10, -10, 0], [10, 10, 0], [-10, 10, 0], [0, 0, 5]]),
        np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]]),
    )
    assert len(Poses.of_mesh(pyramid, np.radians(20)).points) == 5
    poses = Poses.of_mesh(pyramid, np.radians(30))
    assert len(poses.points) == 10
    tilt = np.degrees(np.arccos(poses.tool_axes[5:, 2]))
    assert tilt.max() < 30
    np.testing.assert_allclose(poses.tool_axes[9], [0, 0, 1], atol=1e-12)


def test_a_toolpath_that_fits_can_be_planned(profile, dome):
    assert fits(Poses.of_toolpath(dome), profile).ok
    assert len(plan(dome, profile, PrintSettings())) > len(dome)
