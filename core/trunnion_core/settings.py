"""Print settings: one model with every default, bound and line of help. Names follow desktop slicers."""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


def _percent(value: object) -> object:
    """Desktop slicers write densities as "20%"; the number alone means the same."""
    if isinstance(value, str) and value.strip().endswith("%"):
        return value.strip()[:-1]
    return value


Percent = Annotated[float, BeforeValidator(_percent)]


class PrintSettings(BaseModel):
    """How a part is to be printed. Lengths in mm, speeds in mm/s of the tip over the part, angles in degrees."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    layer_height: float = Field(0.2, gt=0, le=2, description="Height of a layer, mm.")
    first_layer_height: float | None = Field(
        None, gt=0, le=2, description="Height of the first layer, mm; by default layer_height."
    )
    extrusion_width: float = Field(0.4, gt=0, le=4, description="Width of a bead, mm.")
    first_layer_extrusion_width: float | None = Field(
        None, gt=0, le=4, description="Width of a bead on the first layer, mm; by default extrusion_width."
    )
    extrusion_multiplier: float = Field(1.0, ge=0.5, le=2, description="Factor on all extrusion.")
    perimeters: int = Field(2, ge=0, le=100, description="Walls around every planar region.")
    top_solid_layers: int = Field(3, ge=0, le=100, description="Solid layers under surfaces that face up.")
    bottom_solid_layers: int = Field(3, ge=0, le=100, description="Solid layers over surfaces that face down.")
    fill_density: Percent = Field(20.0, ge=0, le=100, description="Density of the inner infill, percent.")
    fill_pattern: str = Field(
        "rectilinear", description="Infill pattern: the name of a file in the slicer's infill folder."
    )
    fill_angle: float = Field(
        45.0,
        ge=-360,
        le=360,
        description="Direction of the infill lines of even layers, degrees; odd layers are turned by 90.",
    )
    infill_overlap: Percent = Field(
        15.0,
        ge=0,
        le=50,
        description="How far infill runs into the innermost wall, percent of the bead's width.",
    )
    skirts: int = Field(1, ge=0, le=20, description="Loops around the part on the first layer, which fill the nozzle.")
    skirt_distance: float = Field(6.0, ge=0, le=100, description="Distance of the skirt from the part, mm.")
    perimeter_speed: float = Field(50.0, gt=0, le=1000, description="Speed of inner walls, mm/s.")
    external_perimeter_speed: float = Field(35.0, gt=0, le=1000, description="Speed of outer walls, mm/s.")
    infill_speed: float = Field(60.0, gt=0, le=1000, description="Speed of inner infill, mm/s.")
    solid_infill_speed: float = Field(50.0, gt=0, le=1000, description="Speed of solid infill, mm/s.")
    top_solid_infill_speed: float = Field(40.0, gt=0, le=1000, description="Speed of the uppermost planar layer, mm/s.")
    first_layer_speed: float = Field(20.0, gt=0, le=1000, description="Speed of every bead on the first layer, mm/s.")
    nonplanar_speed: float = Field(30.0, gt=0, le=1000, description="Speed of non-planar beads, mm/s.")
    travel_speed: float = Field(120.0, gt=0, le=1000, description="Speed without extrusion, mm/s.")
    retract_length: float = Field(0.8, ge=0, le=20, description="Filament pulled back before a travel, mm.")
    retract_speed: float = Field(35.0, gt=0, le=200, description="Speed of the filament while retracting, mm/s.")
    retract_before_travel: float = Field(
        2.0, ge=0, le=100, description="Travels shorter than this inside a region do not retract, mm."
    )
    retract_lift: float = Field(0.4, ge=0, le=20, description="Lift along the tool axis on a retracted travel, mm.")
    temperature: float = Field(210.0, ge=0, le=500, description="Nozzle, °C.")
    first_layer_temperature: float | None = Field(
        None, ge=0, le=500, description="Nozzle on the first layer, °C; by default temperature."
    )
    bed_temperature: float = Field(60.0, ge=0, le=200, description="Bed, °C; 0 leaves it off.")
    first_layer_bed_temperature: float | None = Field(
        None, ge=0, le=200, description="Bed on the first layer, °C; by default bed_temperature."
    )
    fan_speed: Percent = Field(100.0, ge=0, le=100, description="Part fan after the first layers, percent.")
    disable_fan_first_layers: int = Field(1, ge=0, le=1000, description="Layers printed without part fan.")
    center: bool = Field(
        True,
        description="Place the part on the middle of the bed, resting on it; otherwise take coordinates as in "
        "the file.",
    )
    rotate: float = Field(0.0, ge=-360, le=360, description="Turn the part about the vertical first, degrees.")
    shift: tuple[float, float] = Field((0.0, 0.0), description="Then move the part by this in X and Y, mm.")
    nonplanar_max_angle: float | None = Field(
        None,
        ge=0,
        lt=90,
        description="Slope up to which upper surfaces are printed non-planar, degrees; by default "
        "atan(layer_height / extrusion_width); 0 prints everything planar.",
    )
    nonplanar_layers: int = Field(1, ge=1, le=50, description="Non-planar layers on such surfaces.")
    nonplanar_min_area: float = Field(
        4.0, ge=0, description="Non-planar regions smaller than this in projection stay planar, mm²."
    )
    nonplanar_perimeters: int = Field(1, ge=0, le=100, description="Walls around every non-planar region.")
    nonplanar_fill_angle: float = Field(
        0.0,
        ge=-360,
        le=360,
        description="Direction of the lines of the outermost non-planar layer, degrees; layers below alternate by 90.",
    )
    nonplanar_offset: Literal["averaged_normals"] = Field(
        "averaged_normals", description="How inner non-planar surfaces are made from the skin."
    )
    nonplanar_tool_axis: Literal["normal", "vertical"] = Field(
        "normal",
        description="Where the tool points on non-planar beads: along the surface's averaged normal, or "
        "straight down (always so on a machine without rotary axes).",
    )
    nonplanar_axis_tolerance: float = Field(
        0.0,
        ge=0,
        le=30,
        description="How far the tool may lean away from the wanted direction to spare the rotary axes, degrees.",
    )
    nonplanar_smoothing: float = Field(
        2.0,
        ge=0,
        le=15,
        description="How far smoothing may turn the tool from the averaged normal so that rotary axes turn evenly, "
        "degrees, and never so that the head would touch the part; it also rounds the tip's path over facets by up to "
        "0.004 mm. 0 leaves both as they are.",
    )
    chord_tolerance: float = Field(
        0.01,
        gt=0,
        le=1,
        description="How far the tip may leave its path between two points that the machine joins linearly, mm.",
    )

    @property
    def first_height(self) -> float:
        """Height of the first layer in mm."""
        return self.layer_height if self.first_layer_height is None else self.first_layer_height

    @property
    def first_width(self) -> float:
        """Bead width on the first layer in mm."""
        return self.extrusion_width if self.first_layer_extrusion_width is None else self.first_layer_extrusion_width

    @property
    def max_angle_deg(self) -> float:
        """Non-planar threshold in degrees: as set, or equation 1 of Shahid 2024 (arXiv 2411.07225)."""
        if self.nonplanar_max_angle is not None:
            return self.nonplanar_max_angle
        return math.degrees(math.atan(self.layer_height / self.extrusion_width))
