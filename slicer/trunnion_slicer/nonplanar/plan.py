"""A part becomes its non-planar layers and the planar-only mesh under them: the non-planar half of the slicer.

Shahid 2024 (arXiv 2411.07225), sections 2.3-2.5 and 2.9-2.11, step by step: `regions` finds the faces, `patch` their
connected pieces, `offset` the surfaces of the layers, `pocket` takes the layers' space out of the part, `paths` draws
walls and infill in 2D, `project` lifts them onto their surface, `orient` turns the tool.
"""

from dataclasses import dataclass

import numpy as np
from trunnion_core.arrays import BoolArray, FloatArray, check_array, freeze
from trunnion_core.findings import Finding
from trunnion_core.layers import Layer
from trunnion_core.mesh import Mesh
from trunnion_core.settings import PrintSettings


@dataclass(frozen=True, eq=False)
class NonplanarPlan:
    """What is printed along the skin, and what is left for planar layers."""

    planar_mesh: Mesh
    """The part without the space of the non-planar layers."""
    layers: tuple[Layer, ...]
    """Non-planar layers, lowest first."""
    region: BoolArray
    """(m,) faces of the input mesh whose skin is printed non-planar."""
    findings: tuple[Finding, ...]

    def __post_init__(self) -> None:
        check_array("region", self.region, (None,))
        freeze(self.region)


def plan_nonplanar(mesh: Mesh, settings: PrintSettings) -> NonplanarPlan | None:
    """The non-planar part of a print; None when no face qualifies.

    `mesh` is a closed solid in `part`. Raises MeshError when it is not closed.
    """
    if settings.max_angle_deg <= 0 or not len(mesh.faces):
        return None
    from trunnion_slicer.nonplanar.beads import beads_of, sheet
    from trunnion_slicer.nonplanar.offset import offset_surfaces
    from trunnion_slicer.nonplanar.patch import split_patches
    from trunnion_slicer.nonplanar.pocket import planar_only
    from trunnion_slicer.nonplanar.regions import find_region
    from trunnion_slicer.section_kernels import twins

    twin = twins(np.ascontiguousarray(mesh.faces), len(mesh.vertices))
    patches = split_patches(mesh, find_region(mesh, twin, settings), twin)
    findings: list[Finding] = []
    skins = []
    for patch in patches:
        stack = offset_surfaces(patch, settings.nonplanar_layers, settings.layer_height)
        if stack.layers < settings.nonplanar_layers:
            findings.append(_folds(stack.layers, settings, patch.vertices))
        if stack.layers:
            skin = sheet(stack, 0)
            if not skin.outline.buffer(-settings.extrusion_width).is_empty:
                skins.append(skin)
    if not skins:
        return None
    region = np.zeros(len(mesh.faces), np.bool_)
    for skin in skins:
        region[skin.stack.patch.rows] = True
    planar = planar_only(mesh, [skin.stack for skin in skins])
    layers = []
    for depth in reversed(range(max(skin.stack.layers for skin in skins))):
        sheets = [skin if depth == 0 else sheet(skin.stack, depth) for skin in skins if skin.stack.layers > depth]
        beads = tuple(bead for on in sheets for bead in beads_of(on, settings))
        if beads:
            layers.append(Layer("nonplanar", max(on.top for on in sheets), settings.layer_height, beads))
    return NonplanarPlan(planar, tuple(layers), region, tuple(findings))


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
