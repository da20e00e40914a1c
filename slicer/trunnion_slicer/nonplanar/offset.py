"""A patch of skin becomes the stack of surfaces that its layers lie on (equation 3), as deep as they do not fold.

Surface k is the skin moved inwards by k layer heights. An offset folds over itself where the distance exceeds the
radius of curvature, and at ridges with narrow triangles; seen from above such a triangle turns over. Small folds are
relaxed into the mean of their surroundings; a surface that stays folded ends the stack.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from trunnion_core.arrays import BoolArray, FloatArray, freeze

from trunnion_slicer.nonplanar.patch import Patch

RELAXED_SHARE = 0.05
"""Share of a patch's footprint that may be relaxed; more is no longer the offset that was asked for."""

RELAXATIONS = 40
"""Rounds of relaxing before a fold counts as one that stays."""

LEAST_FOOTPRINT = 0.02
"""Share of its footprint on the skin below which a triangle of an offset counts as folded: it is about to be."""


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
    footprint = footprints(patch.vertices[patch.faces])
    surfaces = [patch.vertices]
    for depth in range(1, layers + 1):
        surface = _unfolded(patch, patch.vertices + depth * height * patch.steps, footprint)
        if surface is None:
            break
        surfaces.append(surface)
    return Surfaces(patch, np.stack(surfaces), layers)


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


def _unfolded(patch: Patch, surface: FloatArray, footprint: FloatArray) -> FloatArray | None:
    """The surface with small folds relaxed; None where folds are large or stay."""
    faces = patch.faces
    folded = _folded(surface, patch, footprint)
    if not folded.any():
        return surface
    if footprint[folded].sum() > RELAXED_SHARE * footprint.sum():
        return None
    a = np.concatenate([faces, np.roll(faces, -1, axis=1)], axis=1).ravel()
    b = np.concatenate([np.roll(faces, -1, axis=1), faces], axis=1).ravel()
    count = len(surface)
    neighbours = coo_array((np.ones(len(a)), (a, b)), shape=(count, count)).tocsr()
    valence = np.maximum(neighbours.sum(axis=1), 1.0)[:, None]
    fixed = np.zeros(count, np.bool_)
    fixed[patch.border.ravel()] = True
    moved = np.zeros(count, np.bool_)
    for _ in range(RELAXATIONS):
        moved[faces[folded].ravel()] = True
        moved &= ~fixed
        surface = np.where(moved[:, None], (neighbours @ surface) / valence, surface)
        folded = _folded(surface, patch, footprint)
        if not folded.any():
            touched = moved[faces].any(axis=1)
            return surface if footprint[touched].sum() <= 2 * RELAXED_SHARE * footprint.sum() else None
    return None


def _folded(surface: FloatArray, patch: Patch, footprint: FloatArray) -> BoolArray:
    return np.asarray(footprints(surface[patch.faces]) <= LEAST_FOOTPRINT * footprint)
