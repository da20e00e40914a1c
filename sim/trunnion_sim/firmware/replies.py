"""The texts of Marlin 2.1, one function a text; every line ends in a newline."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from trunnion_core.arrays import FloatArray
from trunnion_sim.firmware import planner_kernel as kernel
from trunnion_sim.firmware.heat import Heater, HeatError

if TYPE_CHECKING:
    from trunnion_sim.firmware.motion import Motion
    from trunnion_sim.firmware.planner import Planner

VERSION = "2.1.2.5"
BUILT = "Jan 01 2026"
COLD_EXTRUSION = "echo: cold extrusion prevented\n"
LONG_EXTRUSION = "echo: too long extrusion prevented\n"
KILLED = "Error:Printer halted. kill() called!\n//action:poweroff\n"

CAPABILITIES = (
    ("SERIAL_XON_XOFF", 0),
    ("BINARY_FILE_TRANSFER", 0),
    ("EEPROM", 0),
    ("VOLUMETRIC", 0),
    ("AUTOREPORT_POS", 1),
    ("AUTOREPORT_TEMP", 1),
    ("PROGRESS", 0),
    ("PRINT_JOB", 1),
    ("AUTOLEVEL", 0),
    ("RUNOUT", 0),
    ("Z_PROBE", 0),
    ("LEVELING_DATA", 0),
    ("BUILD_PERCENT", 1),
    ("SOFTWARE_POWER", 0),
    ("TOGGLE_LIGHTS", 0),
    ("CASE_LIGHT_BRIGHTNESS", 0),
    ("EMERGENCY_PARSER", 1),
    ("HOST_ACTION_COMMANDS", 1),
    ("PROMPT_SUPPORT", 1),
    ("SDCARD", 0),
    ("MULTI_VOLUME", 0),
    ("REPEAT", 0),
    ("SD_WRITE", 0),
    ("AUTOREPORT_SD_STATUS", 0),
    ("LONG_FILENAME", 0),
    ("LFN_WRITE", 0),
    ("CUSTOM_FIRMWARE_UPLOAD", 0),
    ("EXTENDED_M20", 0),
    ("THERMAL_PROTECTION", 1),
    ("MOTION_MODES", 0),
    ("ARCS", 1),
    ("BABYSTEPPING", 0),
    ("CHAMBER_TEMPERATURE", 0),
    ("COOLER_TEMPERATURE", 0),
    ("MEATPACK", 0),
    ("CONFIG_EXPORT", 0),
)


def banner() -> str:
    """What a board says when it starts."""
    return (
        f"start\nPowerUp\n\nMarlin {VERSION}\n"
        f"echo: Last Updated: 2026-01-01 | Author: (trunnion, software machine)\n"
        f"echo: Compiled: {BUILT}\n"
        "echo: Free Memory: 4096  PlannerBufferBytes: 1520\n"
        "echo:Hardcoded Default Settings Loaded\n"
    )


def firmware_info(name: str, axes: int) -> str:
    """M115."""
    head = (
        f"FIRMWARE_NAME:Marlin {VERSION} ({BUILT} 00:00:00) SOURCE_CODE_URL:github.com/MarlinFirmware/Marlin "
        f"PROTOCOL_VERSION:1.0 MACHINE_TYPE:{name} EXTRUDER_COUNT:1 AXIS_COUNT:{axes} "
        "UUID:cede2a2f-41a2-4748-9b12-c55c62f367ff\n"
    )
    return head + "".join(f"Cap:{capability}:{value}\n" for capability, value in CAPABILITIES)


def temperatures(heaters: Iterable[Heater]) -> str:
    """` T:21.00 /0.00 B:21.00 /0.00 @:0 B@:0`, without a line end."""
    heaters = tuple(heaters)
    text = "".join(f" {h.model.name}:{h.reading:.2f} /{h.target:.2f}" for h in heaters)
    for heater in heaters:
        letter = "" if heater.model.name == "T" else heater.model.name
        text += f" {letter}@:{int(heater.duty * 127)}"
    return text


def position(motion: "Motion", values: Sequence[float], counts: FloatArray) -> str:
    """M114: logical positions with the filament last, then motor steps (`motion.cpp`, `report_current_position`)."""
    where = " ".join(f"{letter}:{values[motion.columns[letter]]:.2f}" for letter in (*motion.order, "E"))
    count = " ".join(f"{letter}:{int(counts[motion.columns[letter]])}" for letter in motion.order)
    return f"{where} Count {count}\n"


def heat_error(heater: Heater, error: HeatError) -> str:
    """What precedes the halt; a hot end's number ends its own line, so an empty one follows."""
    serial, display = error.value
    extra = "\n" if heater.model.id.startswith("E") else ""
    return f"Error:{serial}, system stopped! Heater_ID: {heater.model.id}\n{extra}echo:{display}\n{KILLED}"


def prompt(text: str, button: str) -> str:
    """A host prompt with one button."""
    return f"//action:prompt_end\n//action:prompt_begin {text}\n//action:prompt_button {button}\n//action:prompt_show\n"


def settings(motion: "Motion", planner: "Planner", *, bare: bool = False) -> str:
    """M503; `bare`, with S0, without headings and echoes (`settings.cpp`, `gcode.cpp` `report_heading`)."""
    lines = ["; Linear Units:", "  G21 ; (mm)", "; Temperature Units:", "  M149 C ; Units in Celsius"]
    lines += ["; Steps per unit:", steps(motion, planner), "; Max feedrates (units/s):", speeds(motion, planner)]
    lines += ["; Max Acceleration (units/s2):", accelerations(motion, planner)]
    lines += [
        "; Acceleration (units/s2) (P<print-accel> R<retract-accel> T<travel-accel>):",
        path_accelerations(planner),
    ]
    if planner.state[kernel.JUNCTION_DEVIATION] > 0:
        names = "J<junc_dev>"
    else:
        names = " ".join(f"{letter}<max_jerk>" for letter in (*motion.order, "E"))
    lines += [f"; Advanced (B<min_segment_time_us> S<min_feedrate> T<min_travel_feedrate> {names}):"]
    lines += [corners(motion, planner), "; Home offset:", "  M206" + "".join(f" {x}0.00" for x in motion.order)]
    if motion.tip is not None:
        lines += ["; Penta axis:", motion.tip.report()]
    if bare:
        return "".join(f"{line}\n" for line in lines if not line.startswith(";"))
    return "".join(f"echo:{line}\n" for line in lines)


def steps(motion: "Motion", planner: "Planner") -> str:
    """M92."""
    return "  M92" + _words(motion, planner.limits[kernel.STEPS_PER_UNIT])


def speeds(motion: "Motion", planner: "Planner") -> str:
    """M203."""
    return "  M203" + _words(motion, planner.limits[kernel.MAX_SPEED])


def accelerations(motion: "Motion", planner: "Planner") -> str:
    """M201."""
    return "  M201" + _words(motion, planner.limits[kernel.MAX_ACCELERATION])


def path_accelerations(planner: "Planner") -> str:
    """M204."""
    places = {"P": kernel.PRINT_ACCELERATION, "R": kernel.RETRACT_ACCELERATION, "T": kernel.TRAVEL_ACCELERATION}
    return "  M204" + "".join(f" {letter}{planner.state[place]:.2f}" for letter, place in places.items())


def corners(motion: "Motion", planner: "Planner") -> str:
    """M205."""
    deviation = planner.state[kernel.JUNCTION_DEVIATION]
    rule = f" J{deviation:.2f}" if deviation > 0 else _words(motion, planner.limits[kernel.JERK])
    return f"  M205 B{planner.state[kernel.MIN_SEGMENT_TIME] * 1e6:.2f} S0.00 T0.00{rule}"


def soft_limits(motion: "Motion") -> str:
    """M211, two lines."""
    low = "".join(f" {letter}{motion.low[motion.columns[letter]]:.2f}" for letter in motion.order)
    high = "".join(f" {letter}{motion.high[motion.columns[letter]]:.2f}" for letter in motion.order)
    on = motion.soft_limits
    return f"  M211 S{int(on)} ; {'ON' if on else 'OFF'}\n  Min: {low}   Max: {high}"


def _words(motion: "Motion", values: FloatArray) -> str:
    return "".join(f" {letter}{values[motion.columns[letter]]:.2f}" for letter in (*motion.order, "E"))
