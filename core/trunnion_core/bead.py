"""The section of a bead: the one volume rule from which pitch, width and extrusion all come.

A bead is a stadium: a rectangle with two half-discs, `width` across and `height` high. Beads lie side by side at the
pitch where the sections' overlap equals the groove they leave, so a filled layer holds exactly height x area of
plastic (Slic3r's flow model, https://manual.slic3r.org/advanced/flow-math).
"""

import numpy as np

from trunnion_core.arrays import FloatArray


def bead_area(width: FloatArray, height: FloatArray) -> FloatArray:
    """Cross-section in mm² of beads of `width` and `height` mm; an ellipse where the bead is narrower than high."""
    stadium = (width - height) * height + np.pi / 4 * height**2
    return np.asarray(np.where(width >= height, stadium, np.pi / 4 * width * height))


def bead_spacing(width: float, height: float) -> float:
    """Pitch in mm of parallel beads that fill a layer without loss or excess: area / height."""
    return float(bead_area(np.asarray(width), np.asarray(height))) / height


def bead_width(area: FloatArray, height: FloatArray) -> FloatArray:
    """Width in mm of the bead that has `area` mm² at `height` mm: the inverse of `bead_area`."""
    stadium = (area - np.pi / 4 * height**2) / height + height
    return np.asarray(np.where(area >= np.pi / 4 * height**2, stadium, area / (np.pi / 4 * height)))
