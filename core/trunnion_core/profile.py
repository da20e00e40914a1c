"""A machine, as the rooms see it: the validated profile in internal units (mm, s, rad, mm³, °C)."""

import math
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import ProfileError
from trunnion_core.profile_file import (
    STEPS_PER_DEG,
    STEPS_PER_MM,
    BedTable,
    ExtruderTable,
    GcodeTable,
    HeatersTable,
    JointTable,
    PlannerTable,
    ProfileFile,
)
from trunnion_core.solid_tables import HullTable, MeshTable, SolidEntry, SolidTable
from trunnion_core.stl_corners import stl_corners
from trunnion_core.validation import nearest, sentences


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint in mm or rad. A growing value moves the carried body along +axis, or turns it right-handed about it."""

    letter: str
    side: Literal["tool", "work"]
    rotary: bool
    axis: FloatArray
    """(3,) unit, machine frame, all joints at zero."""
    point: FloatArray
    """(3,) mm, machine frame: a point on a rotary's axis; zero for a linear joint."""
    min: float
    """-inf on a rotary that turns for ever."""
    max: float
    speed: float
    acceleration: float
    jerk: float
    """inf where the profile gives none."""
    corner_speed: float
    home: float
    steps_per_unit: float
    """Per mm or rad."""

    @property
    def unit(self) -> str:
        """How a person names the joint's unit."""
        return "degrees" if self.rotary else "mm"

    def shown(self, value: float) -> float:
        """An internal value in the unit that people and files see: mm or degrees."""
        return math.degrees(value) if self.rotary else value


@dataclass(frozen=True, eq=False)
class Body:
    """A body that is neither tool nor clamp, for collision."""

    carried_by: str
    """Letter of a joint of either side, or frame."""
    solid: SolidTable
    """mm, machine frame, all joints at zero."""
    touches: tuple[str, ...]
    """Names of bodies that it may touch."""


@dataclass(frozen=True, eq=False)
class MachineProfile:
    """A validated machine. `joints` is in profile order: from the frame outwards within each side."""

    file: str
    """Name or path that it was loaded from, for messages."""
    name: str
    firmware: str
    assumed: tuple[str, ...]
    joints: tuple[Joint, ...]
    tip: FloatArray
    """(3,) mm, machine frame, all joints at zero."""
    tool_axis: FloatArray
    """(3,) unit, machine frame, all joints at zero, from the tip into the tool."""
    nozzle_diameter: float
    nozzle_flat_diameter: float
    filament_diameter: float
    tool_bodies: tuple[SolidTable, ...]
    origin: FloatArray
    """(3,) mm, machine frame, all joints at zero: where the part's origin sits. The part frame is not turned there."""
    bed: BedTable
    work_bodies: tuple[SolidTable, ...]
    extruder: ExtruderTable
    heaters: HeatersTable
    planner: PlannerTable
    gcode: GcodeTable
    bodies: tuple[Body, ...] = ()
    """Bodies that the frame or any joint carries."""

    @cached_property
    def letters(self) -> tuple[str, ...]:
        """The joints' letters, in profile order."""
        return tuple(joint.letter for joint in self.joints)

    @cached_property
    def rotary(self) -> tuple[int, ...]:
        """Columns of the rotary joints: none, or two."""
        return tuple(column for column, joint in enumerate(self.joints) if joint.rotary)

    @property
    def filament_area(self) -> float:
        """mm² of the filament's section."""
        return math.pi / 4 * self.filament_diameter**2

    def array(self, field: str) -> FloatArray:
        """(k,) of one number of every joint (`min`, `max`, `speed`, `acceleration`, `jerk`, `corner_speed`, `home`)."""
        return np.array([getattr(joint, field) for joint in self.joints], dtype=np.float64)

    @cached_property
    def to_shown(self) -> FloatArray:
        """(k,) factors from internal units to mm and degrees."""
        return np.array([math.degrees(1.0) if joint.rotary else 1.0 for joint in self.joints])

    @cached_property
    def steps_per_shown(self) -> FloatArray:
        """(k + 1,) motor steps per mm and per degree of the joints, and per mm of filament last."""
        return np.append(self.array("steps_per_unit") / self.to_shown, self.extruder.steps_per_mm)


def shipped_profiles() -> dict[str, Path]:
    """Every machine that comes with Trunnion: name to file, sorted by name."""
    installed = Path(__file__).parent / "machine_profiles"
    folder = installed if installed.is_dir() else Path(__file__).parents[2] / "machine_profiles"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_profile(name_or_path: str | Path) -> MachineProfile:
    """The machine of that shipped name, or in that TOML file. Raises ProfileError with every problem at once."""
    path = find_profile(name_or_path)
    data = _read_with_parents(path, seen=())
    try:
        file = ProfileFile.model_validate(data)
    except ValidationError as error:
        raise ProfileError(str(path), sentences(error, ProfileFile)) from None
    return profile_from_file(file, str(path))


def find_profile(name_or_path: str | Path) -> Path:
    """The file of a shipped name or a path; ProfileError suggests the nearest name."""
    shipped = shipped_profiles()
    text = str(name_or_path)
    if text in shipped:
        return shipped[text]
    path = Path(name_or_path)
    if path.is_file():
        return path
    raise ProfileError(text, [f"no such machine or file; {nearest(text, shipped)}"])


def _read_with_parents(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    if path.resolve() in seen:
        raise ProfileError(str(path), ["extends: goes round in a circle"])
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ProfileError(str(path), [f"is not TOML: {error}"]) from None
    except OSError as error:
        raise ProfileError(str(path), [f"cannot be read: {error.strerror}"]) from None
    _find_mesh_files(data, path.parent)
    parent = data.get("extends")
    if not isinstance(parent, str):
        return data
    beside = path.parent / parent
    parent_path = beside if beside.is_file() else find_profile(parent)
    return _merged(_read_with_parents(parent_path, (*seen, path.resolve())), data)


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        result[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return result


def _find_mesh_files(data: dict[str, Any], folder: Path) -> None:
    """Name the mesh files of a profile's solids from here, not from the profile's `folder`; what is odd stays as is."""
    tables = [data.get("tool"), data.get("work")]
    lists = [data.get("body"), *(table.get("body") for table in tables if isinstance(table, dict))]
    entries = [entry for listed in lists if isinstance(listed, list) for entry in listed if isinstance(entry, dict)]
    for entry in entries:
        solid = entry.get("solid", entry)
        if isinstance(solid, dict) and isinstance(solid.get("file"), str):
            solid["file"] = str(folder / solid["file"])


def profile_from_file(file: ProfileFile, source: str) -> MachineProfile:
    """Convert a validated file to internal units, with every mesh file read. ProfileError where one cannot be."""
    flat = file.tool.nozzle_flat_diameter
    problems: list[str] = []
    tool_bodies = tuple(_solid(entry, problems) for entry in file.tool.body)
    work_bodies = tuple(_solid(entry, problems) for entry in file.work.body)
    bodies = tuple(Body(body.carried_by, _solid(body.solid, problems), body.touches) for body in file.body)
    if problems:
        raise ProfileError(source, problems)
    return MachineProfile(
        file=source,
        name=file.machine.name,
        firmware=file.machine.firmware,
        assumed=file.machine.assumed,
        joints=tuple(_joint(table) for table in file.joint),
        tip=np.array(file.tool.tip, dtype=np.float64),
        tool_axis=_unit(file.tool.axis),
        nozzle_diameter=file.tool.nozzle_diameter,
        nozzle_flat_diameter=2 * file.tool.nozzle_diameter if flat is None else flat,
        filament_diameter=file.tool.filament_diameter,
        tool_bodies=tool_bodies,
        origin=np.array(file.work.origin, dtype=np.float64),
        bed=file.work.bed,
        work_bodies=work_bodies,
        extruder=file.extruder,
        heaters=file.heaters,
        planner=file.planner,
        gcode=file.gcode,
        bodies=bodies,
    )


def _solid(entry: SolidEntry, problems: list[str]) -> SolidTable:
    """The solid itself; a mesh file becomes the hull of its corners, or one of the problems and a hull of nothing."""
    if not isinstance(entry, MeshTable):
        return entry
    try:
        return HullTable(
            shape="hull", name=entry.name, points=tuple(map(tuple, stl_corners(Path(entry.file)).tolist()))
        )
    except OSError as error:
        problems.append(f"body {entry.name}: {entry.file} cannot be read: {error.strerror}")
    except ValidationError:
        problems.append(f"body {entry.name}: the corners of {entry.file} lie in one plane, should bound a volume")
    except ValueError as error:
        problems.append(f"body {entry.name}: {entry.file} {error}")
    return HullTable.model_construct(shape="hull", name=entry.name, points=())


def _joint(table: JointTable) -> Joint:
    rotary = table.type == "rotary"
    to_internal = math.radians(1.0) if rotary else 1.0
    low = -math.inf if table.min is None else table.min * to_internal
    high = math.inf if table.max is None else table.max * to_internal
    home = min(max(0.0, low), high) if table.home is None else table.home * to_internal
    return Joint(
        letter=table.letter,
        side=table.side,
        rotary=rotary,
        axis=_unit(table.axis),
        point=np.array(table.point or (0.0, 0.0, 0.0), dtype=np.float64),
        min=low,
        max=high,
        speed=table.speed * to_internal,
        acceleration=table.acceleration * to_internal,
        jerk=math.inf if table.jerk is None else table.jerk * to_internal,
        corner_speed=table.corner_speed * to_internal,
        home=home,
        steps_per_unit=(table.steps_per_unit or (STEPS_PER_DEG if rotary else STEPS_PER_MM)) / to_internal,
    )


def _unit(vector: tuple[float, float, float]) -> FloatArray:
    array = np.array(vector, dtype=np.float64)
    return array / np.linalg.norm(array)
