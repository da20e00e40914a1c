"""A solid mesh and heights become plane cross-sections: islands with their holes.

One pass over the triangles emits a segment for every plane a triangle spans, and since every segment leaves its
triangle through a known edge, the next segment of the contour is the neighbour's at the same plane: contours are
linked by counting, never by comparing points. A vertex exactly on a plane counts as above it, so a plane never
touches a vertex, an edge or a face, and every contour is closed. Contours run with the solid on their left; islands
and holes follow from the positive-winding rule.
"""

from collections.abc import Sequence
from typing import Any

import manifold3d
import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import MeshError
from trunnion_core.mesh import Mesh

SIMPLIFY = 0.0125
"""mm. How far simplifying may move a contour: below the resolution of any printer, ten times fewer vertices."""

SMALLEST_ISLAND = 1e-4
"""mm². Islands and holes below this are rounding."""


def sections(mesh: Mesh, heights: FloatArray) -> list[MultiPolygon]:
    """The cross-section at every height, in the order of `heights`; an empty MultiPolygon where there is none.

    heights (n,) mm, in any order. Vertices are simplified by at most SIMPLIFY. Shells run counter-clockwise, holes
    clockwise. Raises MeshError when an edge has no partner: the mesh is not closed.
    """
    points, starts, planes = contours(mesh, heights)
    rings: list[list[FloatArray]] = [[] for _ in heights]
    for ring, plane in zip(_simplified(points, starts), planes, strict=True):
        if len(ring) >= 4:
            rings[plane].append(ring)
    return [_islands(found) for found in rings]


def contours(mesh: Mesh, heights: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Closed contours of the sections, unsimplified: points (n, 2), starts (loops + 1,) and plane (loops,).

    Contour i is points[starts[i] : starts[i + 1]], its last point joins its first. Contours are sorted by plane.
    """
    from trunnion_slicer.section_kernels import link, twins

    order = np.argsort(heights, kind="stable")
    levels = np.ascontiguousarray(heights[order], dtype=np.float64)
    z = np.ascontiguousarray(mesh.vertices[:, 2])
    faces = np.ascontiguousarray(mesh.faces)
    corner_z = z[faces]
    first = np.searchsorted(levels, corner_z.min(axis=1), side="right")
    last = np.searchsorted(levels, corner_z.max(axis=1), side="right")
    twin = twins(faces, len(mesh.vertices))
    if (twin < 0).any():
        face, corner = divmod(int(np.flatnonzero(twin < 0)[0]), 3)
        place = ", ".join(f"{value:.3f}" for value in mesh.vertices[faces[face, corner]])
        raise MeshError(f"mesh: the edge at ({place}) mm has no neighbour, a solid should be closed everywhere")
    offset = np.concatenate([[0], np.cumsum(last - first)])
    points, starts, planes = link(np.ascontiguousarray(mesh.vertices), faces, twin, levels, first, offset)
    by_plane = np.argsort(planes, kind="stable")
    lengths = np.diff(starts)[by_plane]
    new_starts = np.concatenate([[0], np.cumsum(lengths)])
    rows = np.repeat(starts[:-1][by_plane] - new_starts[:-1], lengths) + np.arange(new_starts[-1])
    return points[rows], new_starts, order[planes[by_plane]]


def _simplified(points: FloatArray, starts: IntArray) -> list[FloatArray]:
    """The contours as closed rings (n, 2) whose first point is repeated, simplified by at most SIMPLIFY."""
    count = len(starts) - 1
    if count <= 0:
        return []
    lengths = np.diff(starts)
    points = _from_a_corner(points, starts)
    closed = np.insert(points, starts[1:], points[starts[:-1]], axis=0)
    owner = np.repeat(np.arange(count), lengths + 1)
    lines = shapely.linestrings(closed, indices=owner)
    coordinates, index = shapely.get_coordinates(
        shapely.simplify(lines, SIMPLIFY, preserve_topology=False), return_index=True
    )
    return np.split(coordinates, np.searchsorted(index, np.arange(1, count)))


def _from_a_corner(points: FloatArray, starts: IntArray) -> FloatArray:
    """Each contour begun at its furthest point in one odd direction: a true corner, which simplifying may keep.

    A contour is found where it crosses some triangle, in the middle of a wall. Begun there, equal sections of a prism
    would all have one more vertex, and each another.
    """
    lengths = np.diff(starts)
    reach = points @ np.array([np.cos(1.0), np.sin(1.0)])
    owner = np.repeat(np.arange(len(lengths)), lengths)
    furthest = np.flatnonzero(reach == np.maximum.reduceat(reach, starts[:-1])[owner])
    corner = furthest[np.unique(owner[furthest], return_index=True)[1]]
    nth = np.arange(len(points)) - starts[owner]
    rolled: FloatArray = points[starts[owner] + (corner[owner] - starts[owner] + nth) % lengths[owner]]
    return rolled


def _islands(rings: Sequence[FloatArray]) -> MultiPolygon:
    """Rings with the solid on their left as islands with holes."""
    if not rings:
        return MultiPolygon()
    if len(rings) == 1:
        island = Polygon(rings[0])
        if island.is_valid and shapely.geometry.polygon.LinearRing(rings[0]).is_ccw:
            return MultiPolygon([island] if island.area > SMALLEST_ISLAND else [])
    section = manifold3d.CrossSection([ring[:-1] for ring in rings], manifold3d.FillRule.Positive)
    found = [polygon for part in section.decompose() for polygon in _polygons(part)]
    return MultiPolygon(found)


def _polygons(part: Any) -> list[Polygon]:
    """One connected piece of a manifold cross-section: a shell and its holes."""
    rings = [np.asarray(ring, dtype=np.float64) for ring in part.to_polygons()]
    polygons = [Polygon(ring) for ring in rings if len(ring) >= 3]
    polygons = [polygon for polygon in polygons if polygon.area > SMALLEST_ISLAND]
    if not polygons:
        return []
    shell = max(polygons, key=lambda polygon: polygon.area)
    whole = Polygon(shell.exterior, [hole.exterior for hole in polygons if hole is not shell])
    if not whole.is_valid:
        pieces = shapely.get_parts(shapely.buffer(whole, 0.0))
        return [shapely.orient_polygons(piece) for piece in pieces if piece.area > SMALLEST_ISLAND]
    return [shapely.orient_polygons(whole)]
