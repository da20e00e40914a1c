"""Marlin 2.1: commands of `gcode/gcode.cpp`, motion as in `module/planner.cpp` (classic jerk or junction deviation).

F is read over the rotaries where the squared linear length is UNEAR_ZERO (`get_move_distance`). Of the 16 places in the
queue one stays empty, and one is free when a move begins and its end can no longer change.
"""

from trunnion_sim.rules import Rules, codes

RULES = Rules(
    name="marlin",
    commands=codes(
        g="0-6 10-12 17-21 26-35 38.2 38.3 38.4 38.5 42 53-59 60 61 76 80 90-92 425",
        m="0 1 3-5 7-11 16-34 42 43 48 73 75-78 80-88 92 100 102 104-115 117-126 127-129 140-145 149-151 154 155 "
        "163-166 190-193 200-211 217-221 226 240 250 255 256 260 261 280-282 290 300-308 350 351 355 360-364 380 381 "
        "400-407 410-413 420-423 425 428 430 486 493 500-504 510-512 524 540 550 552-554 569 575 592 593 600 603 605 "
        "665 666 672 701 702 710 808 810-820 851 852 860-869 862.1 862.2 862.3 862.4 "
        "862.5 862.6 871 876 900 906 907-919 928 951 993-999 7219",
    ),
    corners="marlin",
    g90_resets_e=True,
    case_sensitive=True,
    inverse_time=False,
    max_line=95,
    least_blocks=2,
    slowest=0.05,
    unseen_blocks=2,
    first_move_delay=0.1,
    homes_in_turn=True,
    least_steps=6,
    whole_percent=True,
    shortest_linear=1e-3,
    advance_axes="XYZ",
    advance_ratio=3.0,
    advance="held",
)
