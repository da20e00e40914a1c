"""Klipper with rotary joints as extra axes: commands of `klippy/gcode.py` and its extras, motion of `toolhead.py`."""

from trunnion_sim.rules import Rules, codes

RULES = Rules(
    name="klipper",
    commands=codes(
        g="0-4 10 11 17-21 28 90-92",
        m="18 20 21 23-27 73 82-84 104-107 109 112 114 115 117-119 140 141 190 191 204 220 221 400 600",
    ),
    names=frozenset({"PAUSE", "SET_PRESSURE_ADVANCE"}),
    corners="klipper",
    g90_resets_e=False,
    case_sensitive=False,
    inverse_time=False,
    max_line=4096,
    least_blocks=2,
    slowest=0.0,
    advance_axes="XY",
)
