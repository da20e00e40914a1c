"""The five sample parts, as the non-planar half of the slicer sees them."""

from functools import cache

import numpy as np
import pytest

from trunnion import samples
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings
from trunnion_slicer.nonplanar.grid import build_grid
from trunnion_slicer.nonplanar.offset import FLOOR_RAISED
from trunnion_slicer.nonplanar.plan import NonplanarPlan, plan_nonplanar
from trunnion_slicer.section_kernels import twins


@cache
def planned(name: str, layers: int = 1) -> tuple[Mesh, PrintSettings, NonplanarPlan]:
    mesh = samples.make(name)
    settings = PrintSettings(**(samples.settings(name) | {"nonplanar_layers": layers}))
    plan = plan_nonplanar(mesh, settings)
    assert plan is not None
    return mesh, settings, plan


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", samples.names())
def test_the_outermost_beads_lie_on_the_skin(name: str) -> None:
    mesh, _, plan = planned(name)
    grid = build_grid(mesh.triangles[plan.region])
    points = np.concatenate([bead.points for bead in plan.layers[-1].beads])
    triangle, weights = grid.locate(points[:, :2])
    off = np.linalg.norm(np.einsum("nk,nkd->nd", weights, grid.triangles[triangle]) - points, axis=1)
    assert off.max() < 0.03
    assert np.percentile(off, 99) < 0.006


@pytest.mark.parametrize("name", samples.names())
@pytest.mark.parametrize("layers", [1, 3])
def test_the_planar_mesh_is_closed_and_lacks_the_layers(name: str, layers: int) -> None:
    mesh, settings, plan = planned(name, layers)
    faces = np.ascontiguousarray(plan.planar_mesh.faces)
    assert (twins(faces, len(plan.planar_mesh.vertices)) >= 0).all()
    a, b, c = (mesh.triangles[plan.region][:, k] for k in range(3))
    skin = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    taken = (volume(mesh) - volume(plan.planar_mesh)) / (skin * (layers - FLOOR_RAISED) * settings.layer_height)
    # Convex skins lose by curvature: the wheel's rim, with a radius of 3 mm, most.
    assert 1 - 0.08 * layers / 3 - 0.01 < taken < 1.01
    assert len(plan.layers) == layers


@pytest.mark.parametrize("name", samples.names())
def test_no_bead_is_steeper_than_the_threshold_allows(name: str) -> None:
    _, settings, plan = planned(name)
    limit = np.tan(np.radians(settings.max_angle_deg + 4.0))
    for bead in plan.layers[-1].beads:
        step = np.diff(bead.points, axis=0)
        assert (np.abs(step[:, 2]) <= limit * np.linalg.norm(step[:, :2], axis=1) + 1e-6).all()
        lean = np.degrees(np.arccos(np.clip(bead.tool_axes[:, 2], -1, 1)))
        assert lean.max() < settings.max_angle_deg + 4.0


@pytest.mark.parametrize("name", samples.names())
def test_beads_are_of_a_width_that_can_be_laid(name: str) -> None:
    _, settings, plan = planned(name)
    width = np.concatenate([bead.width for bead in plan.layers[-1].beads])
    assert width.min() > 0.4 * settings.extrusion_width
    assert width.max() < 1.6 * settings.extrusion_width


def test_the_wheel_has_patches_at_several_heights() -> None:
    _, _, plan = planned("wheel")
    assert len({round(float(bead.points[:, 2].max()), 1) for bead in plan.layers[-1].beads}) >= 3
