"""A patch of skin becomes the stack of surfaces that its layers lie on (equation 3), as deep as they do not fold.

Surface k is the skin moved inwards by k layer heights. An offset folds over itself where the distance exceeds the
radius of curvature, and at ridges with narrow triangles; seen from above such a triangle turns over. Small folds are
relaxed by moving their triangles as a whole; a surface that stays folded ends the stack.
"""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, freeze
from trunnion_slicer.nonplanar.patch import Patch

RELAXED_SHARE = 0.1
"""Share of a patch's footprint that may fold before it is relaxed; more is no longer the offset that was asked for."""

RELAXATIONS = 60
"""Rounds of relaxing before a fold counts as one that stays."""

LEAST_FOOTPRINT = 0.02
"""Share of its footprint on the skin below which a triangle of an offset counts as folded: it is about to be."""

THIN_SHARE, THIN_AREA = 0.75, 0.01
"""A relaxed surface is refused where its layers are thinner or thicker than nominal by more than the first on more
than the second of the footprint."""

FLOOR_RAISED = 0.2
"""Share of the lowest layer that is left to the planar layers under it. Their stairs make it half a layer thicker in
places and thinner in others; a bead thicker than it is wide falls into itself and leaves deep grooves, a thin one is
pressed flat. So it is 0.3 to 1.3 layers thick rather than 0.5 to 1.5."""

CRUMB_SHARE = 1e-4
"""Share of the footprint that may stay folded: slivers of a tessellation, narrower than any bead."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The skin and its offsets: layer k lies between surfaces[k] and surfaces[k + 1]."""

    patch: Patch
    surfaces: FloatArray
    """(layers + 1, n, 3) mm: vertices of the patch on every surface, the skin first."""
    wanted: int
    """How many layers were asked for."""

    def __post_init__(self) -> None:
        freeze(self.surfaces)

    @property
    def layers(self) -> int:
        """How many layers are possible."""
        return len(self.surfaces) - 1

    def densities(self, layer: int) -> FloatArray:
        """(n,) mm³ of layer over each mm² of its upper surface's footprint; shared out to the vertices.

        Interpolated linearly over that surface and summed over its footprint, it gives the volume between the two
        surfaces exactly, with all that curvature, creases and slanting borders do to it.
        """
        faces = self.patch.faces
        top, bottom = self.surfaces[layer], self.surfaces[layer + 1]
        volume = np.maximum(prism_volumes(top[faces], bottom[faces]), 0.0)
        area = np.maximum(footprints(top[faces]), 0.0)
        count = len(top)
        volume_at = np.bincount(faces.ravel(), np.repeat(volume, 3), count)
        return np.asarray(volume_at / np.maximum(np.bincount(faces.ravel(), np.repeat(area, 3), count), 1e-12))


def offset_surfaces(patch: Patch, layers: int, height: float) -> Surfaces:
    """As many of `layers` offsets by multiples of `height` mm as do not fold."""
    surfaces = [patch.vertices]
    steps = patch.steps
    for depth in range(1, layers + 1):
        unfolded = _unfolded(patch, steps, depth * height)
        if unfolded is None:
            break
        steps = unfolded
        surfaces.append(patch.vertices + depth * height * steps)
    return Surfaces(patch, np.stack(surfaces), layers)


def with_raised_floor(stack: Surfaces) -> Surfaces:
    """The stack with its lowest surface moved up by FLOOR_RAISED of the lowest layer."""
    if not stack.layers:
        return stack
    surfaces = stack.surfaces.copy()
    surfaces[-1] += FLOOR_RAISED * (surfaces[-2] - surfaces[-1])
    return Surfaces(stack.patch, surfaces, stack.wanted)


def footprints(triangles: FloatArray) -> FloatArray:
    """(m,) mm² of triangles (m, 3, 3) seen from above; negative where they are turned over."""
    a = triangles[:, 1, :2] - triangles[:, 0, :2]
    b = triangles[:, 2, :2] - triangles[:, 0, :2]
    return np.asarray((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2)


def prism_volumes(top: FloatArray, bottom: FloatArray) -> FloatArray:
    """(m,) mm³ between triangles (m, 3, 3) and their images.

    The volume swept from top to bottom grows at the rate area . displacement, a quadratic in the way gone, which
    Simpson's rule integrates exactly.
    """
    drop = (top - bottom).mean(axis=1)

    def area(corners: FloatArray) -> FloatArray:
        return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2

    mean = (area(top) + 4 * area((top + bottom) / 2) + area(bottom)) / 6
    return np.asarray((mean * drop).sum(axis=1))


def _unfolded(patch: Patch, steps: FloatArray, depth: float) -> FloatArray | None:
    """Steps (n, 3) whose offset by `depth` mm has no folds that matter; None where there are too many.

    The three corners of a folded triangle are given their common mean step, lengthened to keep the thickness: a
    triangle that moves as a whole does not fold.
    """
    faces = patch.faces
    footprint = footprints(patch.vertices[faces])
    folded = _folded(patch, steps, depth, footprint)
    if not folded.any():
        return steps
    if footprint[folded].sum() > RELAXED_SHARE * footprint.sum():
        return None
    count = len(steps)
    for _ in range(RELAXATIONS):
        rows = faces[folded]
        together = np.repeat(steps[rows].mean(axis=1), 3, axis=0)
        share = np.bincount(rows.ravel(), minlength=count)
        summed = [np.bincount(rows.ravel(), together[:, axis], count) for axis in range(3)]
        moved = share > 0
        relaxed = np.stack(summed, axis=1)[moved] / share[moved, None]
        steps = steps.copy()
        steps[moved] = relaxed / np.maximum(-(relaxed * patch.mean[moved]).sum(axis=1, keepdims=True), 0.5)
        folded = _folded(patch, steps, depth, footprint)
        if not folded.any():
            break
    if footprint[folded].sum() > CRUMB_SHARE * footprint.sum():
        return None
    return steps if _thickness_holds(patch, steps, footprint) else None


def _thickness_holds(patch: Patch, steps: FloatArray, footprint: FloatArray) -> bool:
    top = patch.vertices[patch.faces]
    normal = np.cross(top[:, 1] - top[:, 0], top[:, 2] - top[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    thickness = -(steps[patch.faces].mean(axis=1) * normal).sum(axis=1)
    wrong = (thickness < THIN_SHARE) | (thickness > 1 / THIN_SHARE)
    return bool(footprint[wrong].sum() <= THIN_AREA * footprint.sum())


def _folded(patch: Patch, steps: FloatArray, depth: float, footprint: FloatArray) -> BoolArray:
    moved = (patch.vertices + depth * steps)[patch.faces]
    return np.asarray(footprints(moved) <= LEAST_FOOTPRINT * footprint)
