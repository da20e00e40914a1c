"""Narrow places: single beads along their middle, with the volume of the place."""

import manifold3d as m3
import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, MultiPolygon, Point, Polygon, box

from trunnion_core.bead import bead_area
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.planar import planar_layers
from trunnion_slicer.thin import middle_lines

DENSE = PrintSettings(layer_height=0.3, fill_density=100, skirts=0)


def extruded(outline: m3.CrossSection, height: float) -> tuple[Mesh, float]:
    solid = m3.Manifold.extrude(outline, height)
    data = solid.to_mesh64()
    mesh = Mesh(np.array(data.vert_properties[:, :3], dtype=np.float64), np.array(data.tri_verts, dtype=np.int64))
    return mesh, solid.volume()


def laid(mesh: Mesh) -> float:
    total = 0.0
    for layer in planar_layers(mesh, DENSE):
        for bead in layer.beads:
            length = np.linalg.norm(np.diff(bead.points, axis=0), axis=1)
            total += float((length * bead_area(bead.width, bead.height)[1:]).sum())
    return total


def test_the_middle_of_a_strip_is_its_middle() -> None:
    ((line, wide),) = middle_lines(MultiPolygon([box(0, 0, 20, 0.5)]), 0.4)
    assert np.abs(line[:, 1] - 0.25).max() < 0.02
    assert np.ptp(line[:, 0]) == pytest.approx(19.5, abs=0.3)
    assert wide == pytest.approx(0.5, abs=0.04)


def test_the_middle_of_a_thin_ring_closes() -> None:
    ring = Point(0, 0).buffer(5, 64) - Point(0, 0).buffer(4.6, 64)
    lines = middle_lines(MultiPolygon([ring]), 0.4)
    assert sum(LineString(line).length for line, _ in lines) == pytest.approx(2 * np.pi * 4.8, rel=0.01)
    assert (lines[0][0][0] == lines[0][0][-1]).all()


def test_a_wedge_gets_a_bead_that_grows_with_it() -> None:
    ((line, wide),) = middle_lines(MultiPolygon([Polygon([(0, 0), (20, 0), (20, 0.8)])]), 0.4)
    across = 0.8 * line[:, 0] / 20
    body = (line[:, 0] > 6) & (line[:, 0] < 19)
    assert body.sum() > 8
    assert wide[body] == pytest.approx(across[body], abs=0.05)


def test_branches_meet_but_corners_have_no_forks() -> None:
    cross = shapely.union_all([box(-5, -0.25, 5, 0.25), box(-0.25, -5, 0.25, 5)])
    lines = middle_lines(MultiPolygon([cross]), 0.4)
    assert sum(LineString(line).length for line, _ in lines) == pytest.approx(19, abs=0.7)
    assert len(lines) <= 4


@pytest.mark.parametrize("thickness", [0.25, 0.4, 0.6, 1.15, 1.25, 1.7, 1.9, 2.1, 3.0])
def test_a_rib_of_any_thickness_has_its_volume(thickness: float) -> None:
    mesh, volume = extruded(m3.CrossSection.square((30, thickness)), 3)
    assert laid(mesh) == pytest.approx(volume, rel=0.09)


@pytest.mark.parametrize("thickness", [0.3, 0.5, 1.2])
def test_a_thin_tube_has_its_volume(thickness: float) -> None:
    mesh, volume = extruded(m3.CrossSection.circle(6, 96) - m3.CrossSection.circle(6 - thickness, 96), 1.5)
    assert laid(mesh) == pytest.approx(volume, rel=0.08)


def test_a_thin_wall_is_an_outer_wall() -> None:
    mesh, _ = extruded(m3.CrossSection.square((30, 0.5)), 3)
    for layer in planar_layers(mesh, DENSE):
        assert [bead.role for bead in layer.beads] == [Role.OUTER_WALL]


def test_no_thin_beads_where_walls_and_infill_fit() -> None:
    mesh, _ = extruded(m3.CrossSection.square((20, 20)) + m3.CrossSection.circle(8, 96).translate((10, 20)), 3)
    for layer in planar_layers(mesh, DENSE):
        for bead in layer.beads:
            length = np.linalg.norm(np.diff(bead.points, axis=0), axis=1)
            whole = bead.width[1:] > bead.width.max() - 1e-9  # but for the wedges of its turns
            assert bead.closed or length[whole].sum() > 0.9 * length.sum()
            assert length.sum() > 10
