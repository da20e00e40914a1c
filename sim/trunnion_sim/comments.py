"""What one comment of a slicer means: its text becomes kinds and values.

Understood are this project's own keys (`;ROLE:`, `;SPEED:`), those that PrusaSlicer, SuperSlicer, OrcaSlicer and their
viewers share (`;TYPE:External perimeter`, `;WIDTH:`, `;HEIGHT:`, `;LAYER_CHANGE`), and those of Bambu Studio
(`; FEATURE: Outer wall`, `; LINE_WIDTH:`, `; LAYER_HEIGHT:`, `; CHANGE_LAYER`), Cura (`;TYPE:WALL-OUTER`, `;LAYER:0`),
ideaMaker (`;TYPE:SOLID-FILL`), Simplify3D (`; feature outer perimeter`, before version 4 `; outer perimeter`,
`; layer 1, Z = 0.2`, `; tool H0.200 W0.480`) and KISSlicer (`; 'Perimeter Path', ...`, `; BEGIN_LAYER_OBJECT ...`).
PrusaSlicer's viewer (`libslic3r/GCode/GCodeProcessor.cpp`) reads them the same way.
"""

import re

import numpy as np

from trunnion_core.roles import Role

OTHER = -1
"""A role that the comments name and this project has not, such as support; or none named at all."""

_ROLES = {
    Role.OUTER_WALL: "external perimeter|outer wall|wall-outer|overhang perimeter|overhang wall|outer perimeter"
    "|external single extrusion",
    Role.INNER_WALL: "perimeter|inner wall|wall-inner|inner perimeter|gap fill|gap infill|gap-fill|thin wall"
    "|floating vertical shell|internal single extrusion|single extrusion|interior shell",
    Role.INFILL: "internal infill|sparse infill|fill|infill",
    Role.SOLID_INFILL: "solid infill|internal solid infill|skin|bottom surface|bridge infill|bridge"
    "|internal bridge infill|internal bridge|solid layer|solid-fill",
    Role.TOP_SOLID_INFILL: "top solid infill|top surface|ironing|top-solid-fill",
    Role.SKIRT: "skirt/brim|skirt|brim",
}
ROLE_OF_TEXT = {name: int(role) for role, names in _ROLES.items() for name in names.split("|")} | {
    role.text: int(role) for role in Role
}
PATHS = {
    "perimeter": Role.OUTER_WALL,
    "loop": Role.INNER_WALL,
    "crown": Role.INNER_WALL,
    "solid": Role.SOLID_INFILL,
    "sparse infill": Role.INFILL,
    "stacked sparse infill": Role.INFILL,
    "skirt": Role.SKIRT,
}
"""KISSlicer's names."""
FEATURES = {
    *("outer perimeter", "inner perimeter", "external single extrusion", "internal single extrusion"),
    *("single extrusion", "solid layer", "infill", "gap fill", "bridge", "skirt", "support", "dense support"),
}
"""Comments of Simplify3D that consist of a role alone."""
KINDS = {
    "ROLE:": "role",
    **dict.fromkeys(("TYPE:", "FEATURE:", "feature "), "type"),
    **dict.fromkeys(("WIDTH:", "LINE_WIDTH:"), "width"),
    **dict.fromkeys(("HEIGHT:", "LAYER_HEIGHT:"), "height"),
    "SPEED:": "speed",
    "LAYER:": "layer",
}
_PATH = re.compile(r"'(.+) Path'")
_LAYER = re.compile(r"layer (\d+), Z = ")
_TOOL = re.compile(r"tool H([\d.]+) W([\d.]+)")
_OBJECT = re.compile(r"BEGIN_LAYER_OBJECT z=[\d.]+ z_thickness=([\d.]+)")

Meaning = tuple[tuple[str, float], ...]
"""Kinds (role, type, width, height, speed, layer) and their values; NaN for the layer after the present one."""


def meaning(text: bytes) -> Meaning:
    """Kinds and values of one comment (without its semicolon); empty where it says nothing that is understood."""
    words = text.decode("utf-8", "replace").strip()
    if words in ("LAYER_CHANGE", "CHANGE_LAYER"):
        return (("layer", np.nan),)
    if words in FEATURES:
        return (("type", _role(words)),)
    for prefix, kind in KINDS.items():
        if words.startswith(prefix):
            rest = words[len(prefix) :].strip()
            if kind in ("role", "type"):
                return ((kind, _role(rest)),)
            value = _number(rest)
            return () if value is None else ((kind, value),)
    if found := _PATH.match(words):
        return (("type", float(PATHS.get(found[1].lower(), OTHER))),)
    if found := _LAYER.match(words):
        return (("layer", max(0.0, float(found[1]) - 1)),)
    if found := _OBJECT.match(words):
        height = _number(found[1])
        return (("layer", np.nan), *((("height", height),) if height is not None else ()))
    if found := _TOOL.match(words):
        height, width = _number(found[1]), _number(found[2])
        return () if height is None or width is None else (("height", height), ("width", width))
    return ()


def _role(text: str) -> float:
    return float(ROLE_OF_TEXT.get(text.lower(), OTHER))


def _number(text: str) -> float | None:
    """A finite number; None where there is none."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
