"""Turn what a hot end can give into a window of tip speed, and say where a machine's axes hold the tip below it."""

from collections.abc import Iterator

import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.bead import bead_area
from trunnion_core.findings import Finding
from trunnion_core.profile import MachineProfile
from trunnion_core.program import MachineProgram
from trunnion_motion.timelaw import BY_WISH, TimeLaw


def tip_window(
    width: FloatArray, height: FloatArray, profile: MachineProfile, multiplier: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """(n,) least and (n,) greatest tip speed in mm/s at which beads keep the flow between the extruder's limits.

    `width`, `height` (n,) mm; where the width is 0 nothing is extruded and the window is open.
    """
    beads = width > 0
    area = np.where(beads, bead_area(width, np.where(beads, height, 1.0)) * multiplier, 1.0)
    least = np.where(beads, profile.extruder.min_flow / area, 0.0)
    return least, np.where(beads, profile.extruder.max_flow / area, np.inf)


def flow_findings(
    program: MachineProgram, law: TimeLaw, points: FloatArray, profile: MachineProfile
) -> Iterator[Finding]:
    """One `flow-below-minimum` for each run of rows that a joint holds below `extruder.min_flow`, at its worst row.

    `points` (n, 3) mm are the tips at the rows' ends, in `part`. Counts what the row could hold for ever: the slow
    beginning of every bead is not meant. Rows that were wanted slower than the minimum are not meant either.
    """
    least = profile.extruder.min_flow
    if least <= 0 or not len(program):
        return
    volume = program.filament * profile.filament_area
    per_mm = np.where(program.width > 0, volume / np.maximum(law.length, np.finfo(float).tiny), 0.0)
    flow = per_mm * law.steady
    low = (flow < least) & (per_mm * program.tip_speed >= least) & (law.limited_by != BY_WISH)
    names = (*profile.letters, "E")
    for first, last in _runs(low):
        row = first + int(np.argmin(flow[first:last]))
        x, y, z = (float(value) for value in points[row])
        joint = names[int(law.limited_by[row])]
        yield Finding(
            "flow-below-minimum",
            "warning",
            f"layer {int(program.layer[row])}, {last - first} rows about ({x:.2f}, {y:.2f}, {z:.2f}) mm: joint {joint} "
            f"holds the flow at {flow[row]:.3f} mm³/s, the hot end needs {least:g}",
            row=row,
            layer=int(program.layer[row]),
            axis=joint,
            value=float(flow[row]),
            limit=least,
            point=(x, y, z),
        )


def _runs(flag: "np.typing.NDArray[np.bool_]") -> list[tuple[int, int]]:
    """First and one-past-last row of every run of true rows."""
    edges: IntArray = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
