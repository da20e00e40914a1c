"""Cross-sections: two roads to the area, the symbolic rule at coplanar vertices, holes, speed-neutral exactness."""

import manifold3d as m3
import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from trunnion_core.errors import MeshError
from trunnion_core.mesh import Mesh
from trunnion_slicer.sections import SIMPLIFY, contours, sections


def to_mesh(solid: m3.Manifold) -> Mesh:
    data = solid.to_mesh64()
    return Mesh(np.array(data.vert_properties[:, :3], dtype=np.float64), np.array(data.tri_verts, dtype=np.int64))


def ring_area(ring: np.ndarray) -> float:
    x, y = ring.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


@st.composite
def solids(draw: st.DrawFn) -> m3.Manifold:
    """Unions and differences of turned boxes, cylinders and balls."""
    solid = m3.Manifold.cube((20, 15, 10), True)
    for _ in range(draw(st.integers(1, 4))):
        place = [draw(st.floats(-8, 8)) for _ in range(3)]
        turn = [draw(st.floats(0, 180)) for _ in range(3)]
        kind = draw(st.sampled_from(["cube", "cylinder", "sphere"]))
        size = draw(st.floats(1, 6))
        tool = {
            "cube": m3.Manifold.cube((size, size, 2 * size), True),
            "cylinder": m3.Manifold.cylinder(4 * size, size, size / 2, 24, True),
            "sphere": m3.Manifold.sphere(size, 24),
        }[kind]
        tool = tool.rotate(turn).translate(place)
        solid = solid + tool if draw(st.booleans()) else solid - tool
    return solid


@settings(max_examples=30, deadline=None)
@given(solids(), st.lists(st.floats(-9, 9), min_size=1, max_size=5))
def test_areas_agree_with_manifolds_own_slices(solid: m3.Manifold, heights: list[float]) -> None:
    mesh = to_mesh(solid)
    # on a face's own plane ours is the section just below, manifold3d's the one just above
    assume(np.abs(mesh.vertices[:, 2] - np.array(heights)[:, None]).min(initial=1.0) > 1e-6)
    points, starts, planes = contours(mesh, np.array(heights))
    exact = np.zeros(len(heights))
    for i, plane in enumerate(planes):
        exact[plane] += ring_area(points[starts[i] : starts[i + 1]])
    found = sections(mesh, np.array(heights))
    for height, area, section in zip(heights, exact, found, strict=True):
        other = solid.slice(height)
        assert area == pytest.approx(other.area(), abs=1e-4)
        perimeter = sum(
            float(np.linalg.norm(np.diff(ring, axis=0, append=ring[:1]), axis=1).sum()) for ring in other.to_polygons()
        )
        assert section.is_valid
        assert section.area == pytest.approx(other.area(), abs=SIMPLIFY * perimeter + 1e-3)


def test_sections_on_faces_edges_and_vertices_are_those_just_below() -> None:
    mesh = to_mesh(m3.Manifold.cube((10, 10, 2)) + m3.Manifold.cube((4, 10, 6)))
    bottom, shoulder, top, over = sections(mesh, np.array([0.0, 2.0, 6.0, 6.001]))
    assert bottom.is_empty
    assert shoulder.area == pytest.approx(100)
    assert top.area == pytest.approx(40)
    assert over.is_empty


def test_heights_may_come_in_any_order() -> None:
    mesh = to_mesh(m3.Manifold.cylinder(10, 10, 0, 64))
    heights = np.array([8.0, 1.0, 5.0, 1.0])
    areas = [section.area for section in sections(mesh, heights)]
    assert areas[1] == areas[3]
    assert areas[1] > areas[2] > areas[0]


def test_holes_and_islands_inside_holes_are_told_apart() -> None:
    tube = m3.Manifold.cylinder(5, 12, 12, 64) - m3.Manifold.cylinder(5, 8, 8, 64)
    nested = tube + (m3.Manifold.cylinder(5, 5, 5, 64) - m3.Manifold.cylinder(5, 2, 2, 64))
    (section,) = sections(to_mesh(nested), np.array([2.5]))
    assert sorted(len(island.interiors) for island in section.geoms) == [1, 1]
    assert all(island.exterior.is_ccw for island in section.geoms)
    assert not any(hole.is_ccw for island in section.geoms for hole in island.interiors)


def test_simplifying_thins_a_dense_contour_but_keeps_it_in_place() -> None:
    mesh = to_mesh(m3.Manifold.cylinder(2, 10, 10, 4096))
    (section,) = sections(mesh, np.array([1.0]))
    ring = np.asarray(section.geoms[0].exterior.coords)
    assert len(ring) < 250
    assert np.abs(np.linalg.norm(ring, axis=1) - 10).max() < SIMPLIFY


def test_a_mesh_with_a_hole_is_refused_with_the_place() -> None:
    mesh = to_mesh(m3.Manifold.cube((10, 10, 10)))
    with pytest.raises(MeshError, match=r"has no neighbour, a solid should be closed"):
        sections(Mesh(mesh.vertices, mesh.faces[1:]), np.array([5.0]))


def test_sections_of_a_prism_are_the_same_vertex_by_vertex() -> None:
    outline = m3.CrossSection.circle(10, 64) - m3.CrossSection.square((4, 6), True).rotate(20)
    first, *others = sections(to_mesh(m3.Manifold.extrude(outline, 10)), np.linspace(0.3, 9.7, 20))
    assert sum(len(ring) for ring in outline.to_polygons()) == len(shapely.get_coordinates(first)) - 2
    assert all(first.equals_exact(other, 1e-9) for other in others)
