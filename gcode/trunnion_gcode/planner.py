"""How a firmware's planner turns words into motion, as a value: what the plan must follow to be what happens."""

from dataclasses import dataclass
from typing import Literal

Corners = Literal["marlin", "reprapfirmware", "klipper", "grbl", "blend"]
"""Rule for the speed at a corner.

marlin: classic jerk, or junction deviation where the profile gives one. reprapfirmware: no axis jumps by more than its
corner speed. klipper: junction deviation over X, Y and Z from a square corner velocity, extra axes by their own corner
speed, cruising held back where it would be short. grbl: junction deviation over all axes. blend: every move by itself
from rest to rest with half its acceleration, the next one setting off while it slows down (LinuxCNC).
"""


@dataclass(frozen=True)
class Planner:
    """What one firmware's planner does with moves, beyond the limits of the profile."""

    corners: Corners
    blocks: int | None = None
    """Moves that it looks ahead, at least; None where it sees all of them."""
    unseen: int = 0
    """Places of its queue that are empty when a move begins."""
    slowest: float = 0.0
    """Units/s; slower moves are sped up to this."""
    in_steps: bool = False
    """Whether its corners see positions rounded to whole motor steps, and so small jumps where words have none."""
    tolerance: float = 0.0
    """mm that blends may leave the corner."""
