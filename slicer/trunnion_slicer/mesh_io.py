"""A mesh file (STL, OBJ, PLY, 3MF) into a `Mesh` in mm, as it stands in the file: nothing is mended here.

STL, OBJ and PLY carry no unit and are taken as mm; a 3MF file names its unit. Only OBJ and PLY need trimesh, which
is imported when one comes along.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trunnion_core.arrays import BoolArray, FloatArray, IntArray
from trunnion_core.errors import MeshError
from trunnion_core.findings import Finding, Severity
from trunnion_core.mesh import Mesh
from trunnion_slicer.stl import read_stl, write_stl
from trunnion_slicer.threemf import read_3mf

__all__ = ["CODES", "READERS", "LoadedMesh", "load_mesh", "write_stl"]

CODES: dict[str, tuple[Severity, str]] = {
    "mesh-bytes-after-end": ("warning", "A binary STL has bytes after its last triangle; they were left unread."),
    "mesh-unit": ("note", "The file's unit is not the millimetre; coordinates were converted."),
    "mesh-bodies": ("note", "The file holds several bodies; they are taken together, placed as in the file."),
    "mesh-skipped": ("note", "Objects of a 3MF file that are not to be printed, or are no solids, were left out."),
}
"""Codes of the findings of loading: severity and meaning."""


@dataclass(frozen=True)
class LoadedMesh:
    """What a file holds, and what is worth saying about the file."""

    mesh: Mesh
    findings: tuple[Finding, ...]


def load_mesh(path: Path) -> LoadedMesh:
    """The triangles of a file in mm, at least one and all finite; vertices are as in the file, not yet welded.

    Raises MeshError, in one sentence, for a file that is missing, empty, cut off, of another kind than its name says,
    without triangles, or with coordinates that are no finite numbers.
    """
    read = READERS.get(path.suffix.lower())
    if path.is_dir():
        raise MeshError(f"{path}: is a directory, should be a mesh file ({_known()})")
    if not path.exists():
        raise MeshError(f"{path}: no such file")
    if read is None:
        raise MeshError(f"{path}: the ending '{path.suffix}' is none of those known: {_known()}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror}") from None
    if not data:
        raise MeshError(f"{path}: is empty, should be a mesh")
    vertices, faces, findings = read(path, data)
    if not len(faces):
        raise MeshError(f"{path}: holds no triangles, should hold a solid")
    if faces.min() < 0 or faces.max() >= len(vertices):
        wrong = int(np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))[0])
        raise MeshError(
            f"{path}: triangle {wrong} names vertices {faces[wrong].tolist()}, but there are {len(vertices)}"
        )
    finite: BoolArray = np.isfinite(vertices.sum(axis=1))
    if not finite.all():
        bad = np.flatnonzero(~finite[faces].all(axis=1))
        if bad.size:
            corner = vertices[faces[bad[0]]][~finite[faces[bad[0]]]][0]
            raise MeshError(
                f"{path}: triangle {bad[0]} has a corner at ({corner[0]:g}, {corner[1]:g}, {corner[2]:g}), "
                f"should be finite ({bad.size} such of {len(faces)} triangles)"
            )
        vertices = np.where(finite[:, None], vertices, 0.0)
    return LoadedMesh(Mesh(vertices, faces), tuple(findings))


def _stl(path: Path, data: bytes) -> tuple[FloatArray, IntArray, list[Finding]]:
    corners, findings = read_stl(path, data)
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int64).reshape(-1, 3), findings


def _through_trimesh(path: Path, data: bytes) -> tuple[FloatArray, IntArray, list[Finding]]:
    import io

    import trimesh

    kind = path.suffix.lower().removeprefix(".")
    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
    except MemoryError:
        raise
    except Exception as error:
        # Whatever a foreign reader trips over, to the user it is one thing: not a readable file of this kind.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise MeshError(f"{path}: is no readable {kind.upper()} file: {reason}") from None
    if not meshes:
        raise MeshError(f"{path}: holds no triangles, should hold a solid")
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    vertices = np.concatenate([np.asarray(mesh.vertices, dtype=np.float64) for mesh in meshes])
    faces = np.concatenate(
        [np.asarray(mesh.faces, dtype=np.int64) + start for mesh, start in zip(meshes, starts, strict=False)]
    )
    return vertices.copy(), faces.copy(), []


Reader = Callable[[Path, bytes], tuple[FloatArray, IntArray, list[Finding]]]
READERS: dict[str, Reader] = {".stl": _stl, ".obj": _through_trimesh, ".ply": _through_trimesh, ".3mf": read_3mf}
"""What reads a file, by its ending."""


def _known() -> str:
    return ", ".join(READERS)
