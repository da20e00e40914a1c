"""The machine profile as it stands in a TOML file: keys, bounds, help. Units: mm, s, degrees, °C.

This one model validates profiles, and its JSON schema and reference page are made from it.
"""

from collections.abc import Iterator
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from trunnion_core.solid_tables import BodyTable, Point2, SolidEntry, Table, Vector
from trunnion_core.tolerance import PARALLEL_AXES
from trunnion_core.validation import nearest

RESERVED_LETTERS = set("EFGMNST")
"""Letters that G-code uses for something else than an axis."""
BED = "bed"
"""What findings, and `touches`, call the plate that the part stands on."""
STEPS_PER_MM, STEPS_PER_DEG = 80.0, 44.4444
"""Steps of joints whose profile gives none: a belt over 20 teeth, and the same motor geared down by five."""


class JointTable(Table):
    """One joint. A growing value moves the carried body along +axis, or turns it right-handed about axis."""

    letter: str = Field(pattern="^[A-Z]$", description="Name of the axis in G-code.")
    side: Literal["tool", "work"] = Field(
        description="Chain that the joint is in: the one ending in the nozzle or the one ending in the part."
    )
    type: Literal["linear", "rotary"] = Field(
        description="Translation along axis, or rotation about the line through point along axis."
    )
    axis: Vector = Field(description="Direction in the machine frame with all joints at zero; any length but zero.")
    point: Vector | None = Field(
        None, description="Any point on a rotary's axis: mm, machine frame, all joints at zero."
    )
    min: float | None = Field(
        None, description="Lowest value, mm or degrees; leave out on a rotary that turns for ever."
    )
    max: float | None = Field(
        None, description="Highest value, mm or degrees; leave out on a rotary that turns for ever."
    )
    speed: float = Field(gt=0, description="Highest speed, mm/s or degrees/s.")
    acceleration: float = Field(gt=0, description="Highest acceleration, mm/s² or degrees/s².")
    jerk: float | None = Field(None, gt=0, description="Highest jerk, mm/s³ or degrees/s³.")
    corner_speed: float = Field(
        0.0, ge=0, description="What may jump at a corner, mm/s or degrees/s (the firmware's classic jerk)."
    )
    home: float | None = Field(None, description="Value after homing, mm or degrees; by default 0, or the nearest end.")
    steps_per_unit: float | None = Field(
        None,
        gt=0,
        description=f"Motor steps per mm or degree; by default {STEPS_PER_MM:g} per mm, {STEPS_PER_DEG:g} per degree.",
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        name = f"joint {self.letter}"
        if not np.linalg.norm(self.axis) > 0:
            raise ValueError(f"{name}: axis is zero, should be a direction")
        if self.type == "rotary" and self.point is None:
            raise ValueError(
                f"{name}: point is missing; a rotary joint needs the pivot, a point on its axis, as [x, y, z] in mm"
            )
        if self.type == "linear" and self.point is not None:
            raise ValueError(f"{name}: point belongs to rotary joints only")
        if self.type == "linear" and (self.min is None or self.max is None):
            raise ValueError(f"{name}: min and max are needed on a linear joint")
        if (self.min is None) != (self.max is None):
            raise ValueError(f"{name}: min and max belong together; leave both out on a rotary that turns for ever")
        if self.min is not None and self.max is not None and not self.min < self.max:
            raise ValueError(f"{name}: min {self.min:g} is not below max {self.max:g}")
        if self.letter in RESERVED_LETTERS:
            raise ValueError(
                f"{name}: the letter {self.letter} has another meaning in G-code; take X, Y, Z, A, B, C, U, V or W"
            )
        return self


class ToolTable(Table):
    """The nozzle. Bodies stand in the tool frame: origin at the tip, Z along the tool axis."""

    tip: Vector = Field((0.0, 0.0, 0.0), description="Tip of the nozzle: mm, machine frame, all joints at zero.")
    axis: Vector = Field((0.0, 0.0, 1.0), description="From the tip into the tool, machine frame, all joints at zero.")
    nozzle_diameter: float = Field(0.4, gt=0, le=4, description="Bore, mm.")
    nozzle_flat_diameter: float | None = Field(
        None, gt=0, description="Outer diameter of the flat around the bore, mm; by default twice the bore."
    )
    filament_diameter: float = Field(1.75, gt=0, le=4, description="mm.")
    body: tuple[SolidEntry, ...] = Field((), description="Convex solids for collision, tool frame.")


class BedTable(Table):
    """The printable area, in the part frame of a part placed at the origin."""

    shape: Literal["rectangle", "circle"]
    min: Point2 | None = Field(None, description="Lowest corner of a rectangle, mm.")
    max: Point2 | None = Field(None, description="Highest corner of a rectangle, mm.")
    diameter: float | None = Field(None, gt=0, description="Diameter of a circle about the part's origin, mm.")
    height: float = Field(gt=0, description="Tallest part, mm.")
    thickness: float = Field(3.0, gt=0, description="Thickness of the plate below z = 0, mm, for collision.")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.shape == "circle" and self.diameter is None:
            raise ValueError("a circle needs its diameter")
        if self.shape == "rectangle":
            if self.min is None or self.max is None:
                raise ValueError("a rectangle needs min and max")
            if not (self.min[0] < self.max[0] and self.min[1] < self.max[1]):
                raise ValueError(f"min {self.min} is not below max {self.max}")
        return self


class WorkTable(Table):
    """Where the part stands."""

    origin: Vector = Field((0.0, 0.0, 0.0), description="The part's origin: mm, machine frame, all joints at zero.")
    bed: BedTable
    body: tuple[SolidEntry, ...] = Field((), description="Clamps and the like that move with the part, part frame.")


class ExtruderTable(Table):
    """The filament drive and what the hot end can melt."""

    speed: float = Field(50.0, gt=0, description="Fastest filament, mm/s.")
    acceleration: float = Field(2000.0, gt=0, description="mm/s² of filament.")
    corner_speed: float = Field(5.0, ge=0, description="What may jump at a corner, mm/s of filament.")
    steps_per_mm: float = Field(400.0, gt=0, description="Motor steps per mm of filament.")
    min_temperature: float = Field(170.0, ge=0, description="Colder than this the firmware refuses to extrude, °C.")
    min_flow: float = Field(0.0, ge=0, description="Slowest steady flow, mm³/s.")
    max_flow: float = Field(12.0, gt=0, description="Fastest flow the hot end can melt, mm³/s.")
    pressure_advance: float = Field(
        0.0,
        ge=0,
        description="s by which filament is ahead of its flow: handed to the firmware, or in the filament words where "
        "the firmware would not apply it. At 0 the program leaves the firmware's own setting alone.",
    )


class HeaterTable(Table):
    """A heater's limits."""

    max_temperature: float = Field(gt=0, description="°C.")


class HeatersTable(Table):
    """The heaters that the machine has."""

    nozzle: HeaterTable = HeaterTable(max_temperature=285)
    bed: HeaterTable | None = HeaterTable(max_temperature=110)


class PlannerTable(Table):
    """How the firmware plans, beyond the joints' own limits."""

    junction_deviation: float | None = Field(
        None, gt=0, description="mm; without it corners follow the joints' corner_speed (classic jerk)."
    )
    blocks: int = Field(16, ge=2, description="Moves the planner looks ahead.")
    acceleration: float | None = Field(
        None,
        gt=0,
        description="mm/s² along the path while printing (M204 P); by default only the joints limit.",
    )
    travel_acceleration: float | None = Field(None, gt=0, description="mm/s² along the path on travels (M204 T).")
    baud: int = Field(250000, gt=0, description="Speed of the serial port.")


class GcodeTable(Table):
    """Code around the print. `{temperature}`, `{bed_temperature}` and `{park}` are filled in; nothing is evaluated."""

    start: tuple[str, ...] = Field(("G28",), description="Lines before heating is waited for: homing and the like.")
    end: tuple[str, ...] = Field(("M107", "M104 S0", "M140 S0"), description="Lines after the last move.")
    decimals_linear: int = Field(4, ge=2, le=6, description="Decimals of mm words.")
    decimals_rotary: int = Field(4, ge=2, le=6, description="Decimals of degree words.")
    decimals_extruder: int = Field(5, ge=3, le=6, description="Decimals of E words.")


class MachineTable(Table):
    """What the machine is called and what drives it."""

    name: str = Field(min_length=1, description="For people.")
    firmware: str = Field(description="Dialect: the name of a file in gcode/trunnion_gcode/dialects.")
    source: str = Field("", description="Where the numbers come from.")
    assumed: tuple[str, ...] = Field((), description="Keys whose numbers are assumptions, not measured or published.")


class ProfileFile(Table):
    """A whole machine profile."""

    extends: str | None = Field(
        None, description="Profile whose tables this one overrides; joints are replaced as a whole list."
    )
    machine: MachineTable
    joint: tuple[JointTable, ...] = Field(description="In order from the frame outwards, within each side.")
    tool: ToolTable = ToolTable()
    work: WorkTable
    body: tuple[BodyTable, ...] = Field((), description="Bodies that the frame or any joint carries.")
    extruder: ExtruderTable = ExtruderTable()
    heaters: HeatersTable = HeatersTable()
    planner: PlannerTable = PlannerTable()
    gcode: GcodeTable = GcodeTable()

    @model_validator(mode="after")
    def _machine_makes_sense(self) -> Self:
        problems = list(_chain_problems(self.joint))
        if problems:
            raise ValueError("; ".join(problems))
        if not np.linalg.norm(self.tool.axis) > 0:
            raise ValueError("tool.axis: is zero, should be a direction")
        bodies = list(_body_problems(self))
        if bodies:
            raise ValueError("; ".join(bodies))
        return self


def _body_problems(file: ProfileFile) -> Iterator[str]:
    carriers = ["frame", *(joint.letter for joint in file.joint)]
    names = [BED, *(solid.name for solid in (*file.tool.body, *file.work.body, *(body.solid for body in file.body)))]
    for body in file.body:
        if body.carried_by not in carriers:
            yield (f"body {body.solid.name}: carried_by is {body.carried_by}, should be one of {', '.join(carriers)}")
        for name in body.touches:
            if name not in names:
                yield f"body {body.solid.name}: touches {name}, which is no body; {nearest(name, names)}"


def _chain_problems(joints: tuple[JointTable, ...]) -> list[str]:
    problems = []
    letters = [joint.letter for joint in joints]
    problems += [
        f"joint: letter {letter} is used {letters.count(letter)} times"
        for letter in sorted(set(letters))
        if letters.count(letter) > 1
    ]
    linear = [np.asarray(joint.axis) / np.linalg.norm(joint.axis) for joint in joints if joint.type == "linear"]
    rotary = [joint for joint in joints if joint.type == "rotary"]
    if len(linear) != 3:
        problems.append(f"joint: {len(linear)} linear joints, should be 3")
    elif abs(np.linalg.det(np.stack(linear))) < PARALLEL_AXES:
        problems.append("joint: the three linear axes lie in one plane, should be independent")
    if len(rotary) not in (0, 2):
        problems.append(f"joint: {len(rotary)} rotary joints, should be none or 2")
    elif rotary:
        first, second = (np.asarray(joint.axis) / np.linalg.norm(joint.axis) for joint in rotary)
        if np.linalg.norm(np.cross(first, second)) < PARALLEL_AXES:
            problems.append(
                f"joint: rotary axes {rotary[0].letter} and {rotary[1].letter} are parallel, "
                "so the tool cannot be turned freely"
            )
    return problems
