"""LinuxCNC with joints programmed directly: RS274NGC commands and user M codes, motion of `tp.c`; the filament is U."""

from trunnion_sim.rules import Rules, codes

RULES = Rules(
    name="linuxcnc",
    commands=codes(
        g="0-5 5.1 5.2 5.3 7 8 10 17 17.1 18 18.1 19 19.1 20 21 28 28.1 30 30.1 33 33.1 38.2 38.3 38.4 38.5 40-42 41.1 "
        "42.1 43 43.1 43.2 49 52-59 59.1 59.2 59.3 61 61.1 64 70-73 74 76 80-90 90.1 91 91.1 92 92.1 92.2 92.3 93-99",
        m="0-9 19 30 48-53 60-68 70-73 98 99 100-199",
    ),
    corners="linuxcnc",
    g90_resets_e=False,
    case_sensitive=False,
    inverse_time=True,
    max_line=256,
    least_blocks=2,
    slowest=0.0,
    filament="U",
)
