"""Smoothed axes never bring the head nearer than the normals do where these were clear: by a wall, and in general."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trunnion_core.mesh import Mesh
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_slicer.nonplanar import beads
from trunnion_slicer.nonplanar.access import Reach, reachable
from trunnion_slicer.nonplanar.clear import EASE, Gap, kept_clear
from trunnion_slicer.nonplanar.normals import face_normals
from trunnion_slicer.nonplanar.plan import plan_nonplanar

SETTINGS = PrintSettings(layer_height=0.3, extrusion_width=0.4)
LENGTH, WIDTH, TILT = 30.0, 16.0, 0.2
"""mm along the wall and from it, and rad by which plate and wall are tilted about x."""
BEND = 9.5
"""mm: where a skin bends up, 5 mm from a wall."""


def beside_a_wall() -> tuple[Reach, np.ndarray]:
    """A tilted plate with a wall 6 mm high along its upper side, and the plate's normal."""
    from manifold3d import Manifold

    solid = Manifold.cube([LENGTH, WIDTH, 4.0]) + Manifold.cube([LENGTH, 2.0, 10.0]).translate([0.0, WIDTH, 0.0])
    out = solid.rotate([np.degrees(TILT), 0.0, 0.0]).to_mesh64()
    mesh = Mesh(np.array(out.vert_properties)[:, :3].copy(), np.array(out.tri_verts, dtype=np.int64))
    normal = np.array([0.0, -np.sin(TILT), np.cos(TILT)])
    facing, _ = face_normals(mesh.vertices, mesh.faces)
    plate = (facing @ normal > 0.999) & ((mesh.triangles @ normal).max(axis=1) < 5.0)
    reach = reachable(mesh, plate, SETTINGS, load_profile("open5x_voron0").tool_bodies[:2])
    assert reach.findings
    return reach, normal


def on_plate(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points (n, 3) mm on the plate, `y` along its slope."""
    c, s = np.cos(TILT), np.sin(TILT)
    return np.column_stack([x, y * c - 4 * s, y * s + 4 * c])


def leant(normal: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Axes (n, 3) leant towards the wall."""
    angle = TILT - np.radians(degrees)
    return np.column_stack([np.zeros_like(angle), -np.sin(angle), np.cos(angle)])


def test_an_axis_beside_a_wall_goes_back_as_far_as_it_must() -> None:
    """A path that comes near the wall and leaves it again, the tool leant towards the wall by two degrees all along."""
    reach, normal = beside_a_wall()
    assert reach.scene is not None
    gap: Gap = partial(reach.scene.gap, depth=0.0)
    x = np.arange(2.0, LENGTH - 2, 0.2)
    normals, axes = np.tile(normal, (len(x), 1)), leant(normal, np.full(len(x), 2.0))
    y = np.linspace(8.0, WIDTH, len(x))
    clear_of = y[gap(on_plate(np.full(len(x), LENGTH / 2), y), normals, 0.1) >= 0.02].max()
    points = on_plate(x, clear_of - 0.012 * (x - LENGTH / 2) ** 2)
    touching = gap(points, axes, 0.5) < -0.01
    assert 10 < touching.sum() < 0.9 * len(x)
    clear = kept_clear(points, axes, normals, np.array([0, len(x)]), gap)
    assert gap(points, clear, 0.0).min() >= -1.1e-6
    kept = np.degrees(np.arccos(np.clip((clear * normals).sum(axis=1), -1, 1)))
    assert kept.max() == pytest.approx(2.0, abs=1e-6)
    assert (np.abs(np.diff(kept)) < 1.6 * 2.0 * 0.21 / EASE + 1e-9).all()
    # As far as needed and no farther: a fifth of a degree more would touch, away from where it is eased in and out.
    deepest = int(np.argmin(kept))
    more = leant(normal, np.array([kept[deepest] + 0.2]))
    assert gap(points[deepest : deepest + 1], more, 0.0)[0] < 0


def test_axes_that_touch_nothing_stay_as_they_are() -> None:
    reach, normal = beside_a_wall()
    assert reach.scene is not None
    x = np.arange(2.0, 12.0, 0.2)
    points = on_plate(x, np.full(len(x), 2.0))
    axes = leant(normal, np.full(len(x), 2.0))
    gap: Gap = partial(reach.scene.gap, depth=0.0)
    assert (kept_clear(points, axes, np.tile(normal, (len(x), 1)), np.array([0, len(x)]), gap) == axes).all()


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10_000), closed=st.booleans())
def test_no_row_is_nearer_than_with_its_normal_unless_it_is_clear(seed: int, closed: bool) -> None:
    """Against clearances that rise and fall with place and lean, normals touching in some places."""
    random = np.random.default_rng(seed)
    n = 80
    points = np.cumsum(random.normal(0, 0.15, (n, 3)), axis=0)
    if closed:
        points[-1] = points[0]
    normals = np.array([0.0, 0.0, 1.0]) + random.normal(0, 0.1, (n, 3))
    axes = normals + random.normal(0, 0.03, (n, 3))
    normals, axes = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (normals, axes))
    wave, push, shift = random.normal(0, 0.5, 3), random.normal(0, 4, 3), random.normal(0.2, 0.3)

    def gap(at: np.ndarray, towards: np.ndarray, far: float) -> np.ndarray:
        return np.minimum(np.asarray(np.sin(at @ wave) * 0.3 + towards[:, :2] @ push[:2] * 0.5 + shift), far)

    clear = kept_clear(points, axes, normals, np.array([0, 30, n]) if not closed else np.array([0, n]), gap)
    worst = np.minimum(gap(points, normals, 0.0), 0.0)
    assert (gap(points, clear, 0.0) >= worst - 1.1e-6).all()
    assert_allclose(np.linalg.norm(clear, axis=1), 1.0, atol=1e-9)
    lean = np.linalg.norm(clear - normals, axis=1)
    assert (lean <= np.linalg.norm(axes - normals, axis=1) + 1e-9).all()


def test_beads_beside_a_wall_are_nowhere_nearer_than_with_their_normals(monkeypatch: pytest.MonkeyPatch) -> None:
    """A skin that ends before a wall, with a smoothing that leans every tool towards it."""
    from manifold3d import CrossSection, Manifold

    x = np.linspace(0.0, 14.0, 29)
    top = np.column_stack([x, 3.0 + np.tan(np.radians(18.0)) * np.maximum(x - BEND, 0.0)])
    section = CrossSection([np.vstack([[0.0, 0.0], [16.0, 0.0], [16.0, 13.0], [14.0, 13.0], top[::-1]])])
    out = Manifold.extrude(section, 8.0).rotate([90.0, 0.0, 0.0]).to_mesh64()
    mesh = Mesh(np.array(out.vert_properties)[:, :3].copy(), np.array(out.tri_verts, dtype=np.int64))
    seen = []

    def watched(points: np.ndarray, axes: np.ndarray, normals: np.ndarray, starts: np.ndarray, gap: Gap) -> np.ndarray:
        clear = kept_clear(points, axes, normals, starts, gap)
        least = np.minimum(gap(points, normals, 0.0), 0.0) - 1.1e-6
        seen.append([(gap(points, tried, 0.0) < least).sum() for tried in (axes, clear)])
        return clear

    def towards_the_wall(points: np.ndarray, normals: np.ndarray, *rest: object) -> np.ndarray:
        axes = normals + np.array([0.1, 0.0, 0.0])
        return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))

    monkeypatch.setattr(beads, "kept_clear", watched)
    monkeypatch.setattr(beads, "smoothed", towards_the_wall)
    head = load_profile("open5x_voron0").tool_bodies[:2]
    assert plan_nonplanar(mesh, SETTINGS, head) is not None
    before, after = np.sum(seen, axis=0)
    assert before > 0
    assert after == 0
