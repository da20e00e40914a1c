"""Plane layers become findings: islands that begin in the air, islands that no bead fits into."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon

from trunnion_core.findings import Finding
from trunnion_core.layers import Layer
from trunnion_core.roles import Role
from trunnion_slicer.order import islands_of

SLIVER = 0.05
"""mm. Islands that vanish when they shrink by this are what cutting two surfaces leaves behind, not part of a model."""


def unsupported(layers: Sequence[Layer]) -> tuple[Finding, ...]:
    """A warning for every island of a layer that touches nothing of the layer below: it would be printed on air.

    Islands are known by their outer walls, so without perimeters there is nothing to say.
    """
    return tuple(_warnings(layers))


def lost(slices: Sequence[MultiPolygon], layers: Sequence[Layer]) -> tuple[Finding, ...]:
    """One warning for all islands of the sections in which no bead lies: too thin to be printed, they are missing."""
    bare = [(layer, island) for section, layer in zip(slices, layers, strict=True) for island in _bare(section, layer)]
    if not bare:
        return ()
    layer, island = bare[0]
    place = island.representative_point()
    return (
        Finding(
            "thin-place-lost",
            "warning",
            f"{len(bare)} islands on {len({id(layer) for layer, _ in bare})} layers are too thin for a bead and are "
            f"left out, the first around ({place.x:.2f}, {place.y:.2f}) mm at z = {layer.z:.2f} mm",
            layer=next(index for index, other in enumerate(layers) if other is layer),
            value=float(len(bare)),
            point=(float(place.x), float(place.y), layer.z),
        ),
    )


def _bare(section: MultiPolygon, layer: Layer) -> Sequence[Polygon]:
    """Islands that no bead touches."""
    islands = np.array(section.geoms, dtype=object)
    if not len(islands):
        return []
    lines = [LineString(bead.points[:, :2]) for bead in layer.beads]
    filled = np.zeros(len(islands), np.bool_)
    if lines:
        filled[shapely.STRtree(lines).query(islands, predicate="intersects")[0]] = True
    return [
        island for island in islands[~filled] if isinstance(island, Polygon) and not island.buffer(-SLIVER).is_empty
    ]


def _warnings(layers: Sequence[Layer]) -> Iterator[Finding]:
    below: Sequence[Polygon | LineString] = ()
    under: Layer | None = None
    for index, layer in enumerate(layers):
        islands = islands_of(layer.beads)
        if index and islands:
            carried = np.zeros(len(islands), np.bool_)
            if below:
                carried[shapely.STRtree(below).query(islands, predicate="intersects")[0]] = True
            for row in np.flatnonzero(~carried):
                if under is not None and _on_beads(islands[row], under):
                    continue
                place = islands[row].representative_point()
                yield Finding(
                    "unsupported-island",
                    "warning",
                    f"layer {index}: an island of {islands[row].area:.2f} mm² around ({place.x:.2f}, {place.y:.2f}) mm "
                    f"at z = {layer.z:.2f} mm touches nothing below it and would be printed on air",
                    layer=index,
                    value=float(islands[row].area),
                    point=(float(place.x), float(place.y), layer.z),
                )
        thin = [bead for bead in layer.beads if bead.role == Role.OUTER_WALL and not bead.closed]
        below = [*islands, *(LineString(bead.points[:, :2]) for bead in thin)]
        under = layer


def _on_beads(island: Polygon, under: Layer) -> bool:
    """Whether any bead of the layer below runs under the island; a loop of one bead looks like an island's wall."""
    return any(island.intersects(LineString(bead.points[:, :2])) for bead in under.beads)
