"""The outline of the first layer becomes loops around it, which fill the nozzle before anything counts."""

import numpy as np
import shapely
from shapely.geometry import MultiPolygon

from trunnion_core.bead import bead_spacing
from trunnion_core.layers import Bead
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.beads import flat_bead
from trunnion_slicer.sections import SIMPLIFY
from trunnion_slicer.walls import as_multipolygon


def skirt(outline: MultiPolygon, settings: PrintSettings) -> list[Bead]:
    """`settings.skirts` closed loops around `outline`, the outermost first; parts far apart get loops of their own."""
    width, height = settings.first_width, settings.first_height
    beads = []
    for loop in reversed(range(settings.skirts)):
        distance = settings.skirt_distance + width / 2 + loop * bead_spacing(width, height)
        around = shapely.simplify(outline.convex_hull if len(outline.geoms) == 1 else outline, SIMPLIFY)
        for part in as_multipolygon(around.buffer(distance, quad_segs=16)).geoms:
            ring = np.asarray(shapely.simplify(part.exterior, SIMPLIFY).coords)[::-1]
            beads.append(flat_bead(ring, height, width, height, Role.SKIRT))
    return beads
