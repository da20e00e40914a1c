"""An STL file, binary or text, becomes the corners of its triangles: all that a convex hull needs."""

import re
from pathlib import Path

import numpy as np

from trunnion_core.arrays import FloatArray

HEADER = 84
"""Bytes before the first triangle of a binary file; the last four are how many there are."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"^\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE | re.IGNORECASE)


def stl_corners(path: Path) -> FloatArray:
    """(n, 3) mm, each corner once. OSError where the file cannot be read, ValueError where it is no STL."""
    data = path.read_bytes()
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    if len(data) >= HEADER and len(data) == HEADER + count * TRIANGLE.itemsize:
        corners = np.frombuffer(data, TRIANGLE, count, HEADER)["corners"].reshape(-1, 3).astype(np.float64)
    else:
        corners = np.array(_VERTEX.findall(data)).astype(np.float64).reshape(-1, 3)
    if not len(corners) or not np.isfinite(corners).all():
        raise ValueError("is no STL file with finite corners")
    return np.unique(corners, axis=0)
