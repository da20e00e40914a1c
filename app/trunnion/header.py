"""What a program says about itself in its first and last lines: `; key = value` comments."""

import re
from pathlib import Path

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import GcodeError

KEY_VALUE = re.compile(r"^; ([a-z_ \[\]]+?) = (.*)$")
END_BYTES = 65536
"""How much of the head and the tail of a file is searched; both are a few kilobytes in practice."""


def read_header(path: Path) -> dict[str, str]:
    """Every `; key = value` near the head and the tail of the file; empty for a program nobody here wrote."""
    try:
        with path.open("rb") as file:
            head = file.read(END_BYTES)
            file.seek(max(len(head), path.stat().st_size - END_BYTES))
            tail = file.read()
    except OSError as error:
        raise GcodeError(f"{path}: cannot be read: {error.strerror}") from None
    found = {}
    for line in (head + b"\n" + tail).decode("utf-8", "replace").splitlines():
        match = KEY_VALUE.match(line)
        if match:
            found[match[1]] = match[2].strip()
    return found


def placement(path: Path, header: dict[str, str]) -> FloatArray | None:
    """(3,) mm that the slicer added to the model's coordinates; None where the program does not say."""
    text = header.get("placement")
    if text is None:
        return None
    try:
        shift = np.array([float(word) for word in text.split()])
    except ValueError:
        shift = np.empty(0)
    if shift.shape != (3,) or not np.isfinite(shift).all():
        raise GcodeError(f"{path}: header: placement = {text}, should be three numbers in mm")
    return shift
