"""A mesh as it came into a solid that manifold3d accepts, with every repair listed, or one sentence why not.

In order: vertices at one place become one; faces without extent and faces that lie on each other go; neighbours are
made to agree which side is out; open edges a hair apart are joined; holes that are flat or small are closed; bodies
inside out are turned; bodies that overlap are united. A clean mesh passes with its triangles untouched.
"""

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import MeshError
from trunnion_core.findings import Finding, Severity
from trunnion_core.mesh import Mesh
from trunnion_core.tolerance import GAP_CLOSING, WELD_DISTANCE
from trunnion_slicer.bodies import manifold_of, mesh_of, outward, united, volumes
from trunnion_slicer.holes import find_holes
from trunnion_slicer.winding import Edges, consistent_winding, find_edges

CODES: dict[str, tuple[Severity, str]] = {
    "mesh-degenerate-faces": ("note", "Faces without extent were dropped."),
    "mesh-duplicate-faces": ("warning", "Faces that lie on each other were dropped."),
    "mesh-winding": ("warning", "Faces that disagreed with their neighbours about the outside were turned."),
    "mesh-gap-closed": ("warning", "Open edges a hair apart were joined."),
    "mesh-hole-filled": ("warning", "A hole in the surface was closed."),
    "mesh-inside-out": ("warning", "A body whose outside faced inwards was turned."),
    "mesh-bodies-united": ("note", "Bodies that overlap or touch were united into one."),
    "mesh-touching-edge": ("note", "Parts that meet in a mere edge were separated there."),
}
"""Codes of the findings of repair: severity and meaning."""

MIN_VOLUME = 1e-3
"""mm³. A body smaller than a cube of 0.1 mm cannot be printed and is no solid."""


def make_solid(mesh: Mesh) -> tuple[Mesh, tuple[Finding, ...]]:
    """A closed, outward oriented manifold, and what was mended, place by place.

    Raises MeshError, naming a place, for what cannot be mended: edges with faces on one side too many, large bent
    holes, surfaces without sides, no volume, an empty mesh.
    """
    findings: list[Finding] = []
    vertices, faces = _welded(mesh.vertices, mesh.faces)
    faces = _without_degenerate(vertices, faces, findings)
    faces = _without_duplicates(vertices, faces, findings)
    if not len(faces):
        raise MeshError("the mesh holds no faces with extent, should hold a solid")
    edges = find_edges(faces)
    if (edges.uses == 1).any():
        vertices, faces, edges = _with_gaps_closed(vertices, faces, edges, findings)
    faces, edges, body = _with_winding(vertices, faces, edges, findings)
    if (edges.uses == 1).any():
        faces = _with_holes_filled(vertices, faces, edges, findings)
        edges = find_edges(faces)
        faces, edges, body = _with_winding(vertices, faces, edges, findings)
    _refuse_unbalanced(vertices, edges)
    return _as_solid(vertices, faces, edges, body, findings), tuple(findings)


def _as_solid(vertices: FloatArray, faces: IntArray, edges: Edges, body: IntArray, findings: list[Finding]) -> Mesh:
    """The outside outwards and the bodies united; refuses what manifold3d does not take."""
    inside_out, hollow_of = outward(vertices, faces, body)
    turn = inside_out[body]
    faces = np.where(turn[:, None], faces[:, ::-1], faces)
    for one in np.flatnonzero(inside_out):
        place = vertices[faces[body == one]].mean(axis=(0, 1))
        _note(findings, "mesh-inside-out", f"a body of {(body == one).sum()} faces was inside out; turned", place)
    if volumes(vertices, faces, body).sum() < MIN_VOLUME:
        raise MeshError(
            f"the mesh encloses no volume around {_at(vertices[faces].mean(axis=(0, 1)))}, should be a solid"
        )
    used, rows = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], rows.reshape(-1, 3).astype(np.int64)
    solid = Mesh(vertices, faces)
    manifold = manifold_of(vertices, faces)
    status = str(manifold.status()).rpartition(".")[2]
    if status != "NoError" or manifold.is_empty():
        raise MeshError(f"the mesh around {_at(solid.bounds.mean(axis=0))} is no manifold even after repair ({status})")
    crowded = edges.uses > 2
    if crowded.any():
        place = vertices[np.searchsorted(used, edges.ends[crowded][0])].mean(axis=0)
        solid = mesh_of(manifold)
        vertices, faces = solid.vertices, solid.faces
        _, body, _ = consistent_winding(faces, find_edges(faces))
        _, hollow_of = outward(vertices, faces, body)
        message = f"parts meet in {crowded.sum()} mere edges, first at {_at(place)}; separated there"
        _note(findings, "mesh-touching-edge", message, place, int(crowded.sum()))
    whole = united(vertices, faces, body, hollow_of)
    if whole is not None:
        solid, count = whole
        message = f"{count} bodies overlap or touch; united into one solid"
        _note(findings, "mesh-bodies-united", message, solid.bounds.mean(axis=0), count)
    return solid


def _welded(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Vertices within WELD_DISTANCE made one: equal after rounding to that grid, the first of each kept as it is."""
    grid = np.round(vertices / WELD_DISTANCE).astype(np.int64)
    order = np.lexsort(grid.T)
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = (np.diff(grid[order], axis=0) != 0).any(axis=1)
    group = np.cumsum(new) - 1
    row = np.empty(len(order), dtype=np.int64)
    row[order] = group
    return vertices[order[new]], row[faces]


def _without_degenerate(vertices: FloatArray, faces: IntArray, findings: list[Finding]) -> IntArray:
    """Without the faces that have a corner twice; needles stay: they hold neighbours together."""
    twice = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    if twice.any():
        place = vertices[faces[twice][0, 0]]
        message = f"{twice.sum()} faces without extent dropped, first at {_at(place)}"
        _note(findings, "mesh-degenerate-faces", message, place, int(twice.sum()))
    return np.asarray(faces[~twice])


def _without_duplicates(vertices: FloatArray, faces: IntArray, findings: list[Finding]) -> IntArray:
    """One of every set of faces on the same corners; none where two face each other in a surface that is not closed."""
    if not len(faces):
        return faces
    ordered = np.sort(faces, axis=1)
    _, group, count = np.unique(ordered, axis=0, return_inverse=True, return_counts=True)
    if (count == 1).all():
        return faces
    # The sign of the permutation that sorts the corners says which way the face looks.
    one, two, three = faces.T
    sign = np.where((one < two).astype(int) + (two < three) + (three < one) == 2, 1.0, -1.0)
    group = group.ravel()
    side = np.bincount(group, sign, len(count))
    rows = np.flatnonzero(sign == np.sign(side)[group])[::-1]
    first = np.full(len(count), -1, dtype=np.int64)
    first[group[rows]] = rows
    keep = np.zeros(len(faces), dtype=np.bool_)
    keep[first[first >= 0]] = True
    if not find_edges(faces).surplus.any():
        # Closed bodies that touch: what each needs of the common wall stays until they are united.
        keep |= side[group] == 0
    if keep.all():
        return faces
    dropped = int((~keep).sum())
    place = vertices[faces[np.flatnonzero(~keep)[0]]].mean(axis=0)
    message = f"{dropped} faces that lie on others dropped, first at {_at(place)}"
    _note(findings, "mesh-duplicate-faces", message, place, dropped)
    return faces[keep]


def _with_gaps_closed(
    vertices: FloatArray, faces: IntArray, edges: Edges, findings: list[Finding]
) -> tuple[FloatArray, IntArray, Edges]:
    """Vertices of open edges within GAP_CLOSING of each other made one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    open_vertices = np.unique(edges.ends[edges.uses == 1])
    pairs = cKDTree(vertices[open_vertices]).query_pairs(GAP_CLOSING, output_type="ndarray")
    if not len(pairs):
        return vertices, faces, edges
    n = len(open_vertices)
    count, label = connected_components(coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)))
    target = np.full(count, len(vertices), dtype=np.int64)
    np.minimum.at(target, label, open_vertices)
    row = np.arange(len(vertices))
    row[open_vertices] = target[label]
    place = vertices[open_vertices[pairs[0, 0]]]
    message = f"{n - count} open corners within {GAP_CLOSING:g} mm of another joined, first at {_at(place)}"
    _note(findings, "mesh-gap-closed", message, place, n - count)
    faces = _without_degenerate(vertices, row[faces], findings)
    return vertices, faces, find_edges(faces)


def _with_winding(
    vertices: FloatArray, faces: IntArray, edges: Edges, findings: list[Finding]
) -> tuple[IntArray, Edges, IntArray]:
    """Faces that agree with their neighbours, their edges, and the body of every face."""
    flip, body, one_sided = consistent_winding(faces, edges)
    if one_sided.size:
        place = vertices[faces[body == one_sided[0]]].mean(axis=(0, 1))
        raise MeshError(f"the surface around {_at(place)} has only one side (a Moebius strip), should enclose a volume")
    if not flip.any():
        return faces, edges, body
    place = vertices[faces[np.flatnonzero(flip)[0]]].mean(axis=0)
    message = f"{flip.sum()} faces turned to agree with their neighbours, first at {_at(place)}"
    _note(findings, "mesh-winding", message, place, int(flip.sum()))
    turned = np.where(flip[:, None], faces[:, ::-1], faces)
    return turned, find_edges(turned), body


def _with_holes_filled(vertices: FloatArray, faces: IntArray, edges: Edges, findings: list[Finding]) -> IntArray:
    half = np.flatnonzero(edges.uses[edges.of_half] == 1)
    tails, heads = faces.ravel()[half], np.roll(faces, -1, axis=1).ravel()[half]
    part_size = float(np.linalg.norm(np.ptp(vertices[faces.ravel()], axis=0)))
    holes = find_holes(vertices, tails, heads, part_size)
    for hole in holes:
        if not len(hole.faces):
            raise MeshError(
                f"the surface has a hole at {_at(hole.middle)}, {hole.size:.2f} mm across with {len(hole.rim)} edges, "
                "that cannot be closed safely; the mesh should be closed"
            )
        message = f"hole at {_at(hole.middle)}, {hole.size:.2f} mm across with {len(hole.rim)} edges, closed"
        _note(findings, "mesh-hole-filled", message, hole.middle)
    return np.concatenate([faces, *(hole.faces for hole in holes)])


def _refuse_unbalanced(vertices: FloatArray, edges: Edges) -> None:
    """Refuse edges whose faces do not pair off."""
    wrong = np.flatnonzero(edges.surplus != 0)
    if not wrong.size:
        return
    worst = wrong[np.argmax(edges.uses[wrong])]
    kind = "open" if edges.uses[worst] == 1 else "non-manifold"
    raise MeshError(
        f"{kind} edge at {_at(vertices[edges.ends[worst]].mean(axis=0))} with {edges.uses[worst]} faces "
        f"({wrong.size} such edges), every edge should have two faces that agree which side is out"
    )


def _note(findings: list[Finding], code: str, message: str, place: FloatArray, count: int = 1) -> None:
    x, y, z = (float(number) for number in place)
    findings.append(Finding(code, CODES[code][0], message, point=(x, y, z), count=count))


def _at(place: FloatArray) -> str:
    return "(" + ", ".join(f"{number:.3f}" for number in place) + ") mm"
