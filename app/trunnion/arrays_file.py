"""Arrays that users hand over in .npz files, checked at the door."""

import zipfile
from pathlib import Path

import numpy as np

from trunnion_core.arrays import FloatArray, check_array
from trunnion_core.errors import FileProblem

SHORTEST_AXIS = 1e-9
"""Length under which a vector has no direction."""


def read_arrays(path: Path, **shapes: tuple[int | None, ...]) -> list[FloatArray]:
    """The named arrays as float64, in the order asked for. Raises FileProblem with all that is wrong."""
    try:
        with np.load(path, allow_pickle=False) as data:
            if isinstance(data, np.ndarray):
                raise FileProblem(str(path), [f"is one bare array, should be an .npz with {', '.join(shapes)}"])
            missing = [name for name in shapes if name not in data]
            if missing:
                raise FileProblem(str(path), [f"{name}: is missing; found: {', '.join(data)}" for name in missing])
            raw = [data[name] for name in shapes]
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileProblem(str(path), [f"is not a readable .npz file: {error}"]) from None
    problems, arrays = [], []
    for (name, shape), array in zip(shapes.items(), raw, strict=True):
        try:
            arrays.append(array.astype(np.float64))
            check_array(name, arrays[-1], shape)
        except (ValueError, TypeError) as error:
            problems.append(str(error))
    if problems:
        raise FileProblem(str(path), problems)
    return arrays


def unit_rows(path: Path, name: str, vectors: FloatArray, n: int) -> FloatArray:
    """The vectors at length 1. Raises FileProblem where one has no direction or there are not n of them."""
    if len(vectors) != n:
        raise FileProblem(str(path), [f"{name}: {len(vectors)} rows, should be {n}, one for each point"])
    length = np.linalg.norm(vectors, axis=1)
    if (length < SHORTEST_AXIS).any():
        raise FileProblem(str(path), [f"{name}: row {int(length.argmin())} is zero, should be a direction"])
    return np.asarray(vectors / length[:, None])
