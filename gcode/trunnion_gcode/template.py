"""The profile's start and end code, with its `{placeholders}` filled in; nothing is evaluated."""

import re
from collections.abc import Mapping, Sequence

from trunnion_core.errors import GcodeError
from trunnion_core.profile import MachineProfile
from trunnion_core.settings import PrintSettings
from trunnion_core.validation import nearest
from trunnion_gcode.moves import joint_decimals
from trunnion_gcode.words import number

PLACEHOLDER = re.compile(r"\{([^{}]*)\}")


def filled(lines: Sequence[str], where: str, values: Mapping[str, str]) -> list[str]:
    """The lines with every placeholder replaced. GcodeError names an unknown one and suggests the nearest."""
    return [_filled_line(line, f"{where}[{index}]", values) for index, line in enumerate(lines)]


def placeholders(profile: MachineProfile, settings: PrintSettings) -> dict[str, str]:
    """What start and end code may ask for: temperatures in °C, and `{park}`, the words of the home pose."""
    first = settings.temperature if settings.first_layer_temperature is None else settings.first_layer_temperature
    bed = (
        settings.bed_temperature
        if settings.first_layer_bed_temperature is None
        else settings.first_layer_bed_temperature
    )
    park = " ".join(
        joint.letter + number(f"home {joint.letter}", joint.shown(joint.home), decimals)
        for joint, decimals in zip(profile.joints, joint_decimals(profile), strict=True)
    )
    return {
        "temperature": number("temperature", settings.temperature, 1),
        "first_layer_temperature": number("first_layer_temperature", first, 1),
        "bed_temperature": number("bed_temperature", settings.bed_temperature, 1),
        "first_layer_bed_temperature": number("first_layer_bed_temperature", bed, 1),
        "park": park,
    }


def _filled_line(line: str, where: str, values: Mapping[str, str]) -> str:
    def value(match: "re.Match[str]") -> str:
        name = match[1].strip()
        if name not in values:
            raise GcodeError(f"{where}: '{match[0]}' is no placeholder, {nearest(name, values)}")
        return values[name]

    text = PLACEHOLDER.sub(value, line)
    if "\n" in text or "\r" in text:
        raise GcodeError(f"{where}: holds a line break, should be one line of G-code")
    return text.rstrip()
