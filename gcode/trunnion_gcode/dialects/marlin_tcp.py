"""Marlin's five-axis fork (DerAndere1/Marlin, PENTA_AXIS_TRT) with tip control: G43.4 before the print, G49 after.

X, Y and Z are the tip over the part, in the coordinates that the joints have with the tables at zero; A or B and C stay
joint angles. F is the speed of the tip over the part (`motion.cpp`, `line_to_destination_kinematic`), and the fork cuts
moves that turn a table into pieces of 5 ms. Pieces of fewer than six steps would be made at a multiple of F, as each is
left to the next, which reads F over its own length alone; so programs, whose moves keep to the chord tolerance anyway,
tell it with M665 S to leave them whole. Its branches disagree on the signs of the rotary words, so the signs are
the profile's and have to be checked on the machine.
"""

import functools

from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.dialects import marlin
from trunnion_gcode.dialects.marlin import SHORTEST_LINEAR
from trunnion_gcode.metrics import linear_first
from trunnion_gcode.planner import Planner
from trunnion_gcode.stated import RELIES
from trunnion_gcode.tables import pivots, table_problem
from trunnion_gcode.words import number

UNCUT = 1
"""Pieces a second: moves shorter than a second stay whole."""
CUT = 200
"""DEFAULT_SEGMENTS_PER_SECOND."""


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """Which geometry the firmware must have been told, besides its limits."""
    names = ("X", "Y", "Z", "I", "J", "K")
    zero, offset = pivots(profile)
    words = " ".join(f"{name}{number(name, v, 4)}" for name, v in zip(names, (*zero, *offset), strict=True))
    return (f"{RELIES} M665 {words}", *marlin.setup(profile))


DIALECT = Dialect(
    name="marlin_tcp",
    metric=functools.partial(linear_first, threshold=SHORTEST_LINEAR),
    planner=Planner("marlin", blocks=2, unseen=2, slowest=0.05, in_steps=True),
    tip_words=True,
    refuses=table_problem,
    enter=(f"M665 S{UNCUT}", "G43.4"),
    leave=("G49", f"M665 S{CUT}"),
    shortest=2 * SHORTEST_LINEAR,
    minimum_steps=6,
    setup=setup,
)
