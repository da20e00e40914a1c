"""grblHAL: commands of `gcode.c` and of plugins for heaters and fans, motion of `planner.c`; the filament is U."""

from trunnion_sim.rules import Rules, codes

RULES = Rules(
    name="grblhal",
    commands=codes(
        g="0-4 5 5.1 7 8 10 17-21 28 28.1 30 30.1 33 38.2 38.3 38.4 38.5 40 43 43.1 43.2 49 50 51 53-59 59.1 59.2 59.3 "
        "61 64 65 66 67 73 76 80-90 91 91.1 92 92.1 92.2 92.3 93-99",
        m="0-9 30 48-51 53 56 60-73 98 99 104 106 107 109 140 190",
    ),
    corners="grbl",
    g90_resets_e=False,
    case_sensitive=False,
    inverse_time=True,
    max_line=256,
    least_blocks=35,
    slowest=0.0,
    filament="U",
)
