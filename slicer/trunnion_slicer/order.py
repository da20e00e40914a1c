"""The beads of one layer in the order of printing.

Islands follow each other by nearest neighbour. Inside an island of a plane layer inner walls come before outer ones:
the outer wall then leans on plastic that is already there, which holds it in place on overhangs; infill comes last
and meets walls on both sides. On a curved layer the contour comes first, since the fill that follows is bounded by
nothing else. A closed bead starts where the loop below it on the last layer started (so seams lie in one line), else
at its point nearest to the tip.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import GeometryCollection, LineString, Polygon

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.layers import Bead, Layer
from trunnion_core.roles import Role
from trunnion_slicer.beads import reversed_bead, started_at

SEAM_REACH = 2.0
"""mm. How far from the seam of the last layer a loop may pass and still take it over."""

EDGE = 1e-3
"""mm. A way along the centre line of the outer wall is inside the island."""

PHASES: tuple[tuple[Role, ...], ...] = (
    (Role.SKIRT,),
    (Role.INNER_WALL,),
    (Role.OUTER_WALL,),
    (Role.SOLID_INFILL, Role.INFILL, Role.TOP_SOLID_INFILL),
    (Role.NONPLANAR_OUTER_WALL,),
    (Role.NONPLANAR_INNER_WALL,),
    (Role.NONPLANAR_INFILL,),
)
"""Inside an island, every bead of one phase is laid before the first of the next."""

OUTER = (Role.OUTER_WALL, Role.NONPLANAR_OUTER_WALL)


@dataclass(frozen=True, eq=False)
class OrderedLayer:
    """Beads as they will be laid; bead i lies in islands[island[i]], in none where that is -1.

    Islands are grown by EDGE and prepared for questions.
    """

    beads: tuple[Bead, ...]
    island: IntArray
    islands: tuple[Polygon, ...]
    seams: FloatArray
    """(m, 3) mm: where the outer walls start."""


def ordered(layer: Layer, tip: FloatArray, seams: FloatArray) -> OrderedLayer:
    """Every bead of `layer` once, turned or reversed where that shortens the way.

    tip (3,) mm is where the last bead ended, seams (m, 3) mm are those of the last layer. O(beads²) per island and
    phase over arrays.
    """
    islands = islands_of(layer.beads)
    home = _home(layer.beads, islands)
    beads: list[Bead] = []
    owner: list[int] = []
    new_seams: list[FloatArray] = []
    todo = {int(island): [b for b, at in zip(layer.beads, home, strict=True) if at == island] for island in set(home)}
    while todo:
        island = min(todo, key=lambda key: (_away(tip, key, islands, todo[key]), key))
        for phase in PHASES:
            chain = [bead for bead in todo[island] if bead.role in phase]
            for bead in _chain(chain, tip, seams):
                beads.append(bead)
                owner.append(island)
                tip = bead.points[-1]
                if bead.role in OUTER:
                    new_seams.append(tip)
        del todo[island]
    found = np.array(new_seams) if new_seams else np.empty((0, 3))
    grown = [island.buffer(EDGE) for island in islands]
    shapely.prepare(grown)
    return OrderedLayer(tuple(beads), np.array(owner, dtype=np.int64), tuple(grown), found)


def islands_of(beads: Sequence[Bead]) -> list[Polygon]:
    """The areas within the outer walls, seen from above."""
    rings = [LineString(bead.points[:, :2]) for bead in beads if bead.role in OUTER and bead.closed]
    if not rings:
        return []
    parts = shapely.get_parts(shapely.build_area(GeometryCollection(rings)))
    return [part for part in parts if isinstance(part, Polygon)]


def _home(beads: Sequence[Bead], islands: Sequence[Polygon]) -> IntArray:
    """The island of every bead; -1 for the skirt, and for all where there are no islands."""
    home = np.full(len(beads), -1, dtype=np.int64)
    inside = np.array([i for i, bead in enumerate(beads) if bead.role != Role.SKIRT], dtype=np.int64)
    if len(islands) and len(inside):
        starts = shapely.points(np.array([beads[i].points[0, :2] for i in inside]))
        found = shapely.STRtree(islands).query_nearest(starts, all_matches=False)
        home[inside[found[0]]] = found[1]
    return home


def _away(tip: FloatArray, island: int, islands: Sequence[Polygon], beads: Sequence[Bead]) -> float:
    """How far the tip is from an island; the skirt is always nearest."""
    if any(bead.role == Role.SKIRT for bead in beads):
        return -1.0
    return float(islands[island].distance(shapely.Point(tip))) if island >= 0 else 0.0


def _chain(beads: Sequence[Bead], tip: FloatArray, seams: FloatArray) -> list[Bead]:
    """Beads by nearest neighbour: loops may be begun at any of their points, open beads at either end."""
    if not beads:
        return []
    if beads[0].role == Role.SKIRT:
        return list(beads)
    doors = [bead.points[:-1] if bead.closed else bead.points[[0, -1]] for bead in beads]
    owner = np.repeat(np.arange(len(beads)), [len(door) for door in doors])
    places = np.concatenate(doors)
    far = np.zeros(len(places))
    chain: list[Bead] = []
    while len(chain) < len(beads):
        door = int((((places - tip) ** 2).sum(axis=1) + far).argmin())
        bead = beads[owner[door]]
        far[owner == owner[door]] = np.inf
        if bead.closed:
            bead = started_at(bead, _seam(bead, places[door], seams))
        elif (places[door] != bead.points[0]).any():
            bead = reversed_bead(bead)
        chain.append(bead)
        tip = bead.points[-1]
    return chain


def _seam(bead: Bead, nearest: FloatArray, seams: FloatArray) -> FloatArray:
    """Where a loop should start: over the seam of the loop below if it passes there, else at `nearest`."""
    if bead.role not in OUTER or len(seams) == 0:
        return nearest
    distance = np.atleast_1d(shapely.distance(LineString(bead.points[:, :2]), shapely.points(seams[:, :2])))
    best = int(distance.argmin())
    if distance[best] > SEAM_REACH:
        return nearest
    place: FloatArray = np.array([*seams[best, :2], bead.points[0, 2]])
    return place
