"""RepRapFirmware 3.5: commands of `GCodes/GCodes2.cpp`, motion as in `Movement/DDA.cpp` (limits axis by axis)."""

from trunnion_sim.rules import Rules, codes

RULES = Rules(
    name="reprapfirmware",
    commands=codes(
        g="0-4 10 11 17-21 28-32 38.2 38.3 38.4 38.5 53-59 59.1 59.2 59.3 60 68 69 90-94",
        m="0-5 17 18 20-30 32 36-39 42 73 80-84 92 98 99 101-122 135 140-144 150 190 191 200-211 220 221 226 "
        "260 261 280 290 291 292 300-309 350 374-376 400-409 450-453 470 471 486 500-505 540 550-606 650 651 665-674 "
        "701-703 750-753 851 862 863 900 905-918 929 950-957 970 997-999",
    ),
    corners="per_axis",
    g90_resets_e=False,
    case_sensitive=False,
    inverse_time=True,
    max_line=255,
    least_blocks=40,
    slowest=0.5,
    advance_axes="XY",
    advance="ramps",
)
