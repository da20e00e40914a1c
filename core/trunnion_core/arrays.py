"""Named array types and the checks a dataclass makes once, at its door."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

UNIT_TOLERANCE = 1e-6
"""How far the length of a row called *unit* may be from 1: rounding of text files, never of mathematics."""


def check_array(name: str, array: NDArray[Any], shape: tuple[int | None, ...], *, finite: bool = True) -> None:
    """Raise ValueError unless `array` has `shape` (None: any length) and, if asked, only finite numbers."""
    if array.ndim != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        raise ValueError(f"{name}: shape {array.shape}, should be {shape}")
    if finite and array.dtype.kind == "f" and not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"{name}: row {row} is {array[row]}, should be finite")


def check_unit_rows(name: str, array: FloatArray, n: int) -> None:
    """Raise ValueError unless `array` is (n, 3) and every row has length 1 within UNIT_TOLERANCE."""
    check_array(name, array, (n, 3))
    length = np.linalg.norm(array, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1.0) > UNIT_TOLERANCE)
    if wrong.size:
        raise ValueError(f"{name}: row {wrong[0]} has length {length[wrong[0]]:.6g}, should be 1")


def freeze(*arrays: NDArray[Any]) -> None:
    """Make the arrays read-only, so that a frozen dataclass is frozen all the way down."""
    for array in arrays:
        array.setflags(write=False)
