"""An STL file, binary or ASCII, into triangle corners, and a mesh back into a binary one.

Which of the two a file is, its first word does not tell: many binary files begin with "solid". The size does: a
binary file of n triangles holds 84 + 50 n bytes. Layout: Marshall Burns, Automated Fabrication, 1993, section 6.5.
"""

import re
from pathlib import Path

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import MeshError
from trunnion_core.findings import Finding
from trunnion_core.mesh import Mesh
from trunnion_core.output import whole_file

HEADER_BYTES = 84
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX_LINE = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE | re.MULTILINE)
END_OF_SOLID = re.compile(rb"end\s*solid", re.IGNORECASE)
TEXT_SAMPLE_BYTES = 1024
"""How much of a file is looked at to tell text from binary."""


def read_stl(path: Path, data: bytes) -> tuple[FloatArray, list[Finding]]:
    """Corners (m, 3, 3) in mm as in the file, and what is odd about the file. Raises MeshError."""
    promised = int.from_bytes(data[80:84], "little") if len(data) >= HEADER_BYTES else 0
    if len(data) >= HEADER_BYTES and len(data) == HEADER_BYTES + RECORD.itemsize * promised:
        return _binary(path, data, promised)
    if _is_text(data):
        return _ascii(path, data)
    return _binary(path, data, promised)


def write_stl(mesh: Mesh, path: Path) -> None:
    """Write `mesh` as a binary STL; the file appears whole or not at all. Coordinates are rounded to 32 bits."""
    record = np.zeros(len(mesh.faces), dtype=RECORD)
    corners = mesh.triangles
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    record["corners"] = corners
    header = b"Trunnion, millimetres".ljust(80) + len(record).to_bytes(4, "little")
    with whole_file(path) as part:
        part.write_bytes(header + record.tobytes())


def _binary(path: Path, data: bytes, promised: int) -> tuple[FloatArray, list[Finding]]:
    if len(data) < HEADER_BYTES:
        raise MeshError(f"{path}: {len(data)} bytes are too few for an STL file, whose header alone has {HEADER_BYTES}")
    found = (len(data) - HEADER_BYTES) // RECORD.itemsize
    if found < promised:
        raise MeshError(
            f"{path}: the binary STL is cut off: its header promises {promised} triangles, "
            f"the file holds {found}; should be {HEADER_BYTES + RECORD.itemsize * promised} bytes, is {len(data)}"
        )
    corners = np.frombuffer(data, RECORD, promised, HEADER_BYTES)["corners"].astype(np.float64)
    extra = len(data) - HEADER_BYTES - RECORD.itemsize * promised
    if not extra:
        return corners, []
    message = f"{path}: {extra} bytes after the last of {promised} triangles were left unread"
    return corners, [Finding("mesh-bytes-after-end", "warning", message, value=float(extra))]


def _ascii(path: Path, data: bytes) -> tuple[FloatArray, list[Finding]]:
    words = VERTEX_LINE.findall(data)
    if not words:
        raise MeshError(f"{path}: is text without a single 'vertex' line, should be an ASCII or binary STL file")
    last_facet = max(data.rfind(b"endfacet"), data.rfind(b"ENDFACET"))
    whole = len(words) % 3 == 0 and END_OF_SOLID.search(data, max(last_facet, 0)) is not None
    if not whole:
        raise MeshError(
            f"{path}: the ASCII STL is cut off after {len(words)} vertices "
            f"({len(words) // 3} whole triangles), should end with 'endsolid'"
        )
    try:
        return np.array(words, dtype="S").astype(np.float64).reshape(-1, 3, 3), []
    except ValueError as error:
        raise MeshError(f"{path}: a vertex of the ASCII STL is no number: {error}") from None


def _is_text(data: bytes) -> bool:
    sample = np.frombuffer(data[:TEXT_SAMPLE_BYTES], np.uint8)
    printable = ((sample >= 32) & (sample != 127)) | ((sample >= 9) & (sample <= 13))
    return bool(printable.all())
