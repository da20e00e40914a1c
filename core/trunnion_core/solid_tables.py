"""The solids of a machine profile, for collision, as they stand in a TOML file: keys, bounds, help. Units: mm.

All are convex; a mesh file counts as its convex hull.
"""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from trunnion_core.tolerance import FLAT_BODY

Vector = tuple[float, float, float]
Point2 = tuple[float, float]


class Table(BaseModel):
    """A table of a profile: unknown keys are errors, and nothing is infinite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ConeTable(Table):
    """A cone or truncated cone along the local Z."""

    shape: Literal["cone"]
    name: str = Field(description="What findings call it.")
    bottom: float = Field(description="Z of the lower end, mm.")
    top: float = Field(description="Z of the upper end, mm.")
    bottom_diameter: float = Field(ge=0, description="mm.")
    top_diameter: float = Field(ge=0, description="mm.")
    center: Point2 = Field((0.0, 0.0), description="X and Y of the axis, mm.")

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        _check_below(self.name, "bottom", self.bottom, "top", self.top)
        _check_below(self.name, "zero", 0.0, "the larger diameter", max(self.bottom_diameter, self.top_diameter))
        return self


class CylinderTable(Table):
    """A cylinder along the local Z."""

    shape: Literal["cylinder"]
    name: str = Field(description="What findings call it.")
    bottom: float = Field(description="Z of the lower end, mm.")
    top: float = Field(description="Z of the upper end, mm.")
    diameter: float = Field(gt=0, description="mm.")
    center: Point2 = Field((0.0, 0.0), description="X and Y of the axis, mm.")

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        _check_below(self.name, "bottom", self.bottom, "top", self.top)
        return self


class BoxTable(Table):
    """A box along the local axes."""

    shape: Literal["box"]
    name: str = Field(description="What findings call it.")
    min: Vector = Field(description="Lowest corner, mm.")
    max: Vector = Field(description="Highest corner, mm.")

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        for low, high in zip(self.min, self.max, strict=True):
            _check_below(self.name, "min", low, "max", high)
        return self


class HullTable(Table):
    """The smallest convex solid that holds some corners: wedges, braces, whatever has flat faces."""

    shape: Literal["hull"]
    name: str = Field(description="What findings call it.")
    points: tuple[Vector, ...] = Field(min_length=4, description="Corners, mm; four or more that are not in one plane.")

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        points = np.asarray(self.points)
        if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < FLAT_BODY:
            raise ValueError(f"{self.name}: points lie in one plane, should bound a volume")
        return self


class MeshTable(Table):
    """A mesh file, which counts as its convex hull: a hollow of it is solid. Give a hollow body as several files."""

    shape: Literal["mesh"]
    name: str = Field(description="What findings call it.")
    file: str = Field(description="STL file, mm, found from the folder of the profile.")


SolidTable = ConeTable | CylinderTable | BoxTable | HullTable
"""A convex solid, once the files of meshes are read."""
SolidEntry = Annotated[ConeTable | CylinderTable | BoxTable | HullTable | MeshTable, Field(discriminator="shape")]


class BodyTable(Table):
    """A body that is neither tool nor clamp: a gantry's beam, a cradle's arm, the frame; for collision.

    Every body is tested against the printed part and against every other body that it can move against, over the whole
    motion. Joints lying side by side excuse nothing: there a wrong limit does its harm. What touches by design, such
    as a carriage on its beam, is named in `touches`. The plate under the part is called bed.
    """

    carried_by: str = Field(description="Letter of the joint that carries it, on either side, or frame.")
    solid: SolidEntry = Field(description="Convex solid: mm, machine frame, all joints at zero.")
    touches: tuple[str, ...] = Field(
        (), description="Names of bodies that it slides or turns on, which are not tested against it."
    )


def _check_below(name: str, lower: str, low: float, upper: str, high: float) -> None:
    """ValueError where a solid has no volume."""
    if not low < high:
        raise ValueError(f"{name}: {lower} {low:g} is not below {upper} {high:g}")
