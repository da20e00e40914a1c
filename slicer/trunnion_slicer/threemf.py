"""A 3MF package into vertices and faces in mm: units, components, build items and their transforms.

Follows the 3MF Core Specification 1.3: only what the build lists is printed; an object is a mesh or a list of
components; a transform is a 4 x 3 matrix that multiplies row vectors from the right. Objects in other model parts
(production extension) are found by their `path`.
"""

import io
import zipfile
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.errors import MeshError
from trunnion_core.findings import Finding

UNIT_MM = {
    "micron": 0.001,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "inch": 25.4,
    "foot": 304.8,
    "meter": 1000.0,
}
"""Length of the units that the core specification knows, mm."""
START_PART_TYPE = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
MAX_DEPTH = 64
"""Components inside components deeper than this go round in a circle."""

Key = tuple[str, str]
"""A model part of the package, and an object's id in it."""


@dataclass
class _Object:
    kind: str = "model"
    vertices: FloatArray | None = None
    faces: IntArray | None = None
    components: list[tuple[Key, FloatArray]] = field(default_factory=list)


def read_3mf(path: Path, data: bytes) -> tuple[FloatArray, IntArray, list[Finding]]:
    """Vertices (n, 3) mm, faces (m, 3) and notes about unit, number of bodies and what was left out.

    Raises MeshError for what is no 3MF package, an unknown unit, or a reference to an object that is not there.
    """
    try:
        package = zipfile.ZipFile(io.BytesIO(data))
        objects: dict[Key, _Object] = {}
        start = _start_part(package)
        items, unit = _read_part(path, package, start, objects)
        read = {start}
        while waiting := ({key[0] for key, _, _ in items} | _named_parts(objects)) - read:
            part = min(waiting)
            _read_part(path, package, part, objects)
            read.add(part)
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise MeshError(f"{path}: is no readable 3MF package: {error}") from None
    except KeyError as error:
        raise MeshError(f"{path}: is no complete 3MF package: {error.args[0]}") from None
    except ElementTree.ParseError as error:
        raise MeshError(f"{path}: the 3MF model is no well-formed XML: {error}") from None
    if unit not in UNIT_MM:
        raise MeshError(f"{path}: unit '{unit}' is unknown, should be one of {', '.join(UNIT_MM)}")
    return _assemble(path, objects, items, unit)


def _assemble(
    path: Path, objects: dict[Key, _Object], items: list[tuple[Key, FloatArray, bool]], unit: str
) -> tuple[FloatArray, IntArray, list[Finding]]:
    bodies: list[tuple[FloatArray, IntArray]] = []
    skipped = 0
    for key, transform, printable in items:
        if not printable:
            skipped += 1
            continue
        skipped += _collect(path, objects, key, transform, bodies, 0)
    if not bodies:
        raise MeshError(f"{path}: nothing in the build list is a solid to be printed")
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in bodies])
    vertices = np.concatenate([vertices for vertices, _ in bodies]) * UNIT_MM[unit]
    faces = np.concatenate([faces + start for (_, faces), start in zip(bodies, starts, strict=False)])
    findings = []
    if UNIT_MM[unit] != 1.0:
        message = f"{path}: the unit is the {unit}; coordinates were multiplied by {UNIT_MM[unit]:g} to make mm"
        findings.append(Finding("mesh-unit", "note", message, value=UNIT_MM[unit]))
    if len(bodies) > 1:
        message = f"{path}: {len(bodies)} bodies are printed together, placed as in the file"
        findings.append(Finding("mesh-bodies", "note", message, value=float(len(bodies))))
    if skipped:
        message = f"{path}: {skipped} objects that are not printable or no solids were left out"
        findings.append(Finding("mesh-skipped", "note", message, value=float(skipped)))
    return vertices, faces, findings


def _collect(
    path: Path,
    objects: dict[Key, _Object],
    key: Key,
    transform: FloatArray,
    bodies: list[tuple[FloatArray, IntArray]],
    depth: int,
) -> int:
    """Append every mesh under object `key`, transformed; return how many objects were left out."""
    if depth > MAX_DEPTH:
        raise MeshError(f"{path}: components of object {key[1]} contain each other without end")
    if key not in objects:
        raise MeshError(f"{path}: object {key[1]} of {key[0]} is used but not defined")
    thing = objects[key]
    if thing.kind not in ("model", "solidsupport", "other") or (thing.kind == "other" and depth == 0):
        return 1
    skipped = 0
    linear = transform[:3]
    if thing.vertices is not None and thing.faces is not None and len(thing.faces):
        faces = thing.faces if np.linalg.det(linear) > 0 else thing.faces[:, ::-1]
        with np.errstate(invalid="ignore"):  # what is not finite is found, and said, where the file is checked
            bodies.append((thing.vertices @ linear + transform[3], faces))
    for child, placed in thing.components:
        combined = placed @ linear
        combined[3] += transform[3]
        skipped += _collect(path, objects, child, combined, bodies, depth + 1)
    return skipped


def _start_part(package: zipfile.ZipFile) -> str:
    """Name of the model part that the package's root relationships point at."""
    root = ElementTree.fromstring(package.read("_rels/.rels"))
    for relation in root:
        if relation.get("Type") == START_PART_TYPE:
            return str(relation.get("Target")).lstrip("/")
    raise KeyError("no relationship to a 3D model in _rels/.rels")


def _named_parts(objects: dict[Key, _Object]) -> set[str]:
    return {key[0] for thing in objects.values() for key, _ in thing.components}


def _read_part(
    path: Path, package: zipfile.ZipFile, part: str, objects: dict[Key, _Object]
) -> tuple[list[tuple[Key, FloatArray, bool]], str]:
    """Read one model part into `objects`; return its build items and its unit."""
    with package.open(part) as stream:
        model = ElementTree.parse(stream).getroot()
    for element in model.iterfind("{*}resources/{*}object"):
        objects[part, str(element.get("id"))] = _object(path, part, element)
    items = [
        (_reference(item, part), _transform(path, item), item.get("printable", "1") not in ("0", "false"))
        for item in model.iterfind("{*}build/{*}item")
    ]
    return items, model.get("unit", "millimeter")


def _object(path: Path, part: str, element: ElementTree.Element) -> _Object:
    thing = _Object(kind=element.get("type", "model"))
    for child in element:
        name = child.tag.rpartition("}")[2]
        if name == "mesh":
            vertices, triangles = child.find("{*}vertices"), child.find("{*}triangles")
            if vertices is None or triangles is None:
                raise MeshError(f"{path}: the mesh of object {element.get('id')} lacks vertices or triangles")
            thing.vertices = _numbers(path, vertices, ("x", "y", "z"))
            faces = _numbers(path, triangles, ("v1", "v2", "v3"))
            thing.faces = faces.astype(np.int64)
            if faces.size and not (faces.min() >= 0 and faces.max() < len(thing.vertices)):
                raise MeshError(
                    f"{path}: object {element.get('id')} has triangles on vertex {faces.max():.0f}, "
                    f"but only {len(thing.vertices)} vertices"
                )
        elif name == "components":
            thing.components += [(_reference(item, part), _transform(path, item)) for item in child]
    return thing


def _numbers(path: Path, parent: ElementTree.Element, keys: tuple[str, str, str]) -> FloatArray:
    """(n, 3) of three attributes of every child."""
    one, two, three = keys
    try:
        rows = [(float(item.attrib[one]), float(item.attrib[two]), float(item.attrib[three])) for item in parent]
    except (KeyError, ValueError) as error:
        raise MeshError(f"{path}: a vertex or triangle of the 3MF model is wrong: {error}") from None
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _reference(element: ElementTree.Element, part: str) -> Key:
    elsewhere = next((value for name, value in element.attrib.items() if name.endswith("}path")), part)
    return elsewhere.lstrip("/"), str(element.get("objectid"))


def _transform(path: Path, element: ElementTree.Element) -> FloatArray:
    """(4, 3): rows 0-2 the linear part, row 3 the shift, for row vectors."""
    text = element.get("transform")
    if text is None:
        return np.vstack([np.eye(3), np.zeros(3)])
    try:
        matrix = np.array(text.split(), dtype=np.float64).reshape(4, 3)
    except ValueError:
        raise MeshError(f"{path}: transform '{text}' of object {element.get('objectid')} is not 12 numbers") from None
    if not np.isfinite(matrix).all() or np.linalg.det(matrix[:3]) == 0:
        raise MeshError(f"{path}: transform '{text}' of object {element.get('objectid')} flattens the part")
    return matrix
