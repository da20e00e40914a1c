"""A triangle mesh in the part frame."""

from dataclasses import dataclass

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray, check_array, freeze


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles over shared vertices, counter-clockwise seen from outside, in the `part` frame (Z up)."""

    vertices: FloatArray
    """(n, 3) mm."""
    faces: IntArray
    """(m, 3) rows of `vertices`."""

    def __post_init__(self) -> None:
        check_array("vertices", self.vertices, (None, 3))
        check_array("faces", self.faces, (None, 3))
        if self.faces.size and not (self.faces.min() >= 0 and self.faces.max() < len(self.vertices)):
            raise ValueError(f"faces: rows up to {self.faces.max()}, but there are {len(self.vertices)} vertices")
        freeze(self.vertices, self.faces)

    @property
    def triangles(self) -> FloatArray:
        """(m, 3, 3) mm: the three corners of every face."""
        return self.vertices[self.faces]

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) mm: lowest and highest corner of the vertices in use."""
        used = self.vertices[self.faces.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])
