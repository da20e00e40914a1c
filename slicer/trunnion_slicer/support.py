"""Plane layers become findings about islands that begin in the air."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from trunnion_core.findings import Finding
from trunnion_core.layers import Layer
from trunnion_core.roles import Role

from trunnion_slicer.order import islands_of


def unsupported(layers: Sequence[Layer]) -> tuple[Finding, ...]:
    """A warning for every island of a layer that touches nothing of the layer below: it would be printed on air.

    Islands are known by their outer walls, so without perimeters there is nothing to say.
    """
    return tuple(_warnings(layers))


def _warnings(layers: Sequence[Layer]) -> Iterator[Finding]:
    below: Sequence[Polygon | LineString] = ()
    for index, layer in enumerate(layers):
        islands = islands_of(layer.beads)
        if index and islands:
            carried = np.zeros(len(islands), np.bool_)
            if below:
                carried[shapely.STRtree(below).query(islands, predicate="intersects")[0]] = True
            for row in np.flatnonzero(~carried):
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
