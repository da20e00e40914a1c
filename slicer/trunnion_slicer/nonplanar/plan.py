"""A part becomes its non-planar layers and the planar-only mesh under them: the non-planar half of the slicer.

Shahid 2024 (arXiv 2411.07225), sections 2.3-2.5 and 2.9-2.11, step by step: `regions` finds the faces, `access` what of
them the head can reach, `patch` their connected pieces, `offset` the surfaces of the layers, `pocket` takes the layers'
space out of the part, `paths` draws walls and infill in 2D, `project` lifts them onto their surface, `orient` turns the
tool.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from trunnion_core.arrays import BoolArray, FloatArray, check_array, freeze
from trunnion_core.findings import Finding
from trunnion_core.layers import Layer
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings
from trunnion_core.solid_tables import SolidTable
from trunnion_slicer.planar import Collar, PlanarPlan, plan_planar
from trunnion_slicer.walls import as_multipolygon

if TYPE_CHECKING:
    from trunnion_slicer.nonplanar.access import Reach
    from trunnion_slicer.nonplanar.beads import Sheet

DEEP_SHARE = 0.9
"""Share of the skin reachable in a single layer that has to stay reachable for more layers to be worth it."""

STANDS_OUT = 0.05
"""mm. How far planar stairs beside the skin may stand out of the part's surface: half of what a flat smooths."""


@dataclass(frozen=True, eq=False)
class NonplanarPlan:
    """What is printed along the skin, and what is left for planar layers."""

    planar_mesh: Mesh
    """The part without the space of the non-planar layers."""
    planar: PlanarPlan
    """Its layers, on which the non-planar ones lie."""
    layers: tuple[Layer, ...]
    """Non-planar layers, lowest first."""
    region: BoolArray
    """(m,) faces of the input mesh whose skin is printed non-planar."""
    findings: tuple[Finding, ...]

    def __post_init__(self) -> None:
        check_array("region", self.region, (None,))
        freeze(self.region)


def plan_nonplanar(
    mesh: Mesh,
    settings: PrintSettings,
    head: Sequence[SolidTable] = (),
    lap: Callable[[str], None] = lambda stage: None,
) -> NonplanarPlan | None:
    """The non-planar part of a print; None when no face qualifies.

    Skin that a body of the `head` (tool frame, mm) cannot be over without entering the part stays planar, and so does
    everything where no skin is left; both are said in findings. Without bodies nothing is in the way.
    `mesh` is a closed solid in `part`. `lap` is called with the name of every stage that ends: the planar layers are
    made in between, since the lowest non-planar one lies on their beads. Raises MeshError when it is not closed.
    """
    if settings.max_angle_deg <= 0 or not len(mesh.faces):
        return None
    from trunnion_slicer.nonplanar.beads import beads_of, sheet
    from trunnion_slicer.nonplanar.offset import offset_surfaces, with_raised_floor
    from trunnion_slicer.nonplanar.patch import split_patches
    from trunnion_slicer.nonplanar.pocket import planar_only
    from trunnion_slicer.nonplanar.regions import find_region
    from trunnion_slicer.section_kernels import twins

    twin = twins(np.ascontiguousarray(mesh.faces), len(mesh.vertices))
    reach, count = _reach(mesh, find_region(mesh, twin, settings), settings, head)
    findings = list(reach.findings)
    if count < settings.nonplanar_layers:
        findings.append(_fewer(count, settings))
    whole, mesh = mesh, reach.mesh
    twin = twins(np.ascontiguousarray(mesh.faces), len(mesh.vertices))
    patches = split_patches(mesh, reach.region, twin)
    skins = []
    for patch in patches:
        stack = with_raised_floor(offset_surfaces(patch, count, settings.layer_height))
        if stack.layers < count:
            findings.append(_folds(stack.layers, settings, patch.vertices))
        if stack.layers:
            skin = sheet(stack, 0)
            if not skin.outline.buffer(-settings.extrusion_width).is_empty:
                skins.append(skin)
    if not skins:
        return _all_planar(whole, settings, tuple(findings), lap) if findings else None
    region = np.zeros(len(whole.faces), np.bool_)
    for skin in skins:
        region[reach.parent[skin.stack.patch.rows]] = True
    planar_mesh = planar_only(mesh, [skin.stack for skin in skins])
    lap("nonplanar")
    planar = plan_planar(planar_mesh, settings, _collar(skins, settings, head))
    lap("planar")
    layers = []
    for depth in reversed(range(max(skin.stack.layers for skin in skins))):
        sheets = [skin if depth == 0 else sheet(skin.stack, depth) for skin in skins if skin.stack.layers > depth]
        beads = tuple(bead for on in sheets for bead in beads_of(on, planar.layers, settings, reach))
        if beads:
            layers.append(Layer("nonplanar", max(on.top for on in sheets), settings.layer_height, beads))
    return NonplanarPlan(planar_mesh, planar, tuple(layers), region, tuple(findings))


def _all_planar(
    mesh: Mesh, settings: PrintSettings, findings: tuple[Finding, ...], lap: Callable[[str], None]
) -> NonplanarPlan:
    lap("nonplanar")
    planar = plan_planar(mesh, settings)
    lap("planar")
    return NonplanarPlan(mesh, planar, (), np.zeros(len(mesh.faces), np.bool_), findings)


def _reach(mesh: Mesh, region: BoolArray, settings: PrintSettings, head: Sequence[SolidTable]) -> "tuple[Reach, int]":
    """What the head reaches, and in how many layers: as many as cost next to no skin compared with a single one.

    Deep layers lie in a pocket whose sides stand higher than the tip, so wherever planar stairs go on beyond the border
    they cost skin; where the skin ends on walls they do not.
    """
    from trunnion_slicer.nonplanar.access import footprints_of, reachable

    single = reachable(mesh, region, settings, head)
    for layers in range(settings.nonplanar_layers, 1, -1):
        deep = reachable(mesh, region, settings, head, layers)
        if footprints_of(deep.mesh, deep.region).sum() >= DEEP_SHARE * footprints_of(single.mesh, single.region).sum():
            return deep, layers
    return single, 1


def _collar(skins: "Sequence[Sheet]", settings: PrintSettings, head: Sequence[SolidTable]) -> Collar | None:
    """Around and under the rim of the skin, as far as the flat end of the nozzle reaches beyond it."""
    from trunnion_slicer.nonplanar.beads import sheet
    from trunnion_slicer.nonplanar.head import frusta

    bodies = frusta(head)
    ends = bodies[bodies[:, 0] <= 0.0]
    if not len(ends):
        return None
    reach = float(ends[:, 2].max())
    areas = [
        shapely.difference(shapely.buffer(skin.outline, reach), sheet(skin.stack, skin.stack.layers).outline)
        for skin in skins
    ]
    z = np.concatenate([skin.stack.surfaces[:, np.unique(skin.stack.patch.border), 2].ravel() for skin in skins])
    slack = settings.layer_height + reach
    return Collar(as_multipolygon(shapely.union_all(areas)), float(z.min()) - slack, float(z.max()) + slack, STANDS_OUT)


def _fewer(count: int, settings: PrintSettings) -> Finding:
    return Finding(
        "nonplanar-head-blocked",
        "warning",
        f"{count} of {settings.nonplanar_layers} non-planar layers are printed: deeper ones lie so far below the "
        f"planar layers beside them that the nozzle would enter these",
        value=float(count),
        limit=float(settings.nonplanar_layers),
    )


def _folds(possible: int, settings: PrintSettings, vertices: FloatArray) -> Finding:
    x, y, z = (float(value) for value in vertices.mean(axis=0))
    what = f"only {possible} of {settings.nonplanar_layers}" if possible else "no"
    return Finding(
        "nonplanar-offset-folds",
        "warning",
        f"the skin around ({x:.2f}, {y:.2f}, {z:.2f}) mm is too curved for its offsets: {what} non-planar layers of "
        f"{settings.layer_height:g} mm are possible there, the rest is printed planar",
        value=float(possible),
        limit=float(settings.nonplanar_layers),
        point=(x, y, z),
    )
