"""What a machine did when it executed a program, as the simulator saw it."""

from dataclasses import dataclass

from trunnion_core.arrays import FloatArray, IntArray, check_array, freeze


@dataclass(frozen=True, eq=False)
class Trace:
    """One row per executed motion, which ends in the state of the row."""

    line: IntArray
    """(n,) line of the G-code file, from 1."""
    joints: FloatArray
    """(n, k) mm or rad, in profile order."""
    points: FloatArray
    """(n, 3) mm, tip in `part`."""
    tool_axes: FloatArray
    """(n, 3) unit, in `part`."""
    volume: FloatArray
    """(n,) mm³ of plastic fed during the row; negative where it is retracted."""
    time: FloatArray
    """(n,) s at the end of the row, since the start."""

    def __post_init__(self) -> None:
        n = len(self.line)
        check_array("joints", self.joints, (n, None))
        check_array("points", self.points, (n, 3))
        check_array("tool_axes", self.tool_axes, (n, 3))
        for name in ("line", "volume", "time"):
            check_array(name, getattr(self, name), (n,))
        freeze(self.line, self.joints, self.points, self.tool_axes, self.volume, self.time)

    def __len__(self) -> int:
        return len(self.line)
