"""A solid part onto the bed: the middle of the bed by default, else where its file says, and the check that it fits."""

import numpy as np

from trunnion_core.arrays import FloatArray
from trunnion_core.errors import PlacementError
from trunnion_core.mesh import Mesh
from trunnion_core.profile import MachineProfile
from trunnion_core.settings import PrintSettings
from trunnion_core.tolerance import PLACEMENT_SLACK


def place(mesh: Mesh, profile: MachineProfile, settings: PrintSettings) -> tuple[Mesh, FloatArray]:
    """The mesh in the part frame of the machine, and the shift (3,) mm that was added once it was turned.

    The part is turned by `settings.rotate` about the file's Z. With `settings.center` the middle of its bounding box
    then comes to the middle of the bed and its lowest point to z = 0; last comes `settings.shift`. Raises
    PlacementError with all that sticks out by more than PLACEMENT_SLACK: above the height, below the bed, over its
    edge.
    """
    placed, shift = put(mesh, profile, settings)
    problems = _problems(placed, profile, settings.center and not any(settings.shift))
    if problems:
        raise PlacementError(f"the part does not fit on {profile.name}: " + "; ".join(problems))
    return placed, shift


def put(mesh: Mesh, profile: MachineProfile, settings: PrintSettings) -> tuple[Mesh, FloatArray]:
    """As `place`, without asking whether the part fits."""
    turned = turn(mesh, settings.rotate)
    low, high = turned.bounds
    shift = np.array([*settings.shift, 0.0])
    if settings.center:
        shift += [*(_bed_middle(profile) - (low + high)[:2] / 2), -low[2]]
    return Mesh(turned.vertices + shift, turned.faces), shift


def turn(mesh: Mesh, degrees: float) -> Mesh:
    """The mesh turned right-handed about the Z of its file."""
    if degrees == 0:
        return mesh
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return Mesh(mesh.vertices @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), mesh.faces)


def _bed_middle(profile: MachineProfile) -> FloatArray:
    bed = profile.bed
    if bed.min is None or bed.max is None:
        return np.zeros(2)
    return np.asarray(np.add(bed.min, bed.max) / 2, dtype=np.float64)


def _problems(mesh: Mesh, profile: MachineProfile, centered: bool) -> list[str]:
    """Sentences about everything that sticks out, each with axis and amount."""
    low, high = mesh.bounds
    bed = profile.bed
    problems = []
    if high[2] > bed.height + PLACEMENT_SLACK:
        problems.append(f"Z: {high[2] - bed.height:.3f} mm too tall, top at {high[2]:.3f} of {bed.height:g} mm")
    if low[2] < -PLACEMENT_SLACK:
        problems.append(f"Z: {-low[2]:.3f} mm below the bed, lowest point should be at 0 (or set center)")
    if bed.min is not None and bed.max is not None:
        problems += _beyond_rectangle(low, high, np.array(bed.min), np.array(bed.max), centered)
    elif bed.diameter is not None:
        used = mesh.vertices[np.unique(mesh.faces)]
        radius = np.hypot(used[:, 0], used[:, 1])
        worst = int(np.argmax(radius))
        over = radius[worst] - bed.diameter / 2
        if over > PLACEMENT_SLACK:
            problems.append(
                f"X/Y: {over:.3f} mm over the edge of the round bed at ({used[worst, 0]:.3f}, {used[worst, 1]:.3f}), "
                f"should stay within {bed.diameter / 2:g} mm of its middle"
            )
    return problems


def _beyond_rectangle(
    low: FloatArray, high: FloatArray, bed_low: FloatArray, bed_high: FloatArray, centered: bool
) -> list[str]:
    problems = []
    for axis, letter in enumerate("XY"):
        size, room = high[axis] - low[axis], bed_high[axis] - bed_low[axis]
        if size > room + 2 * PLACEMENT_SLACK:
            problems.append(f"{letter}: {size - room:.3f} mm too large, {size:.3f} mm on a bed of {room:g} mm")
            continue
        under, over = bed_low[axis] - low[axis], high[axis] - bed_high[axis]
        if max(under, over) > PLACEMENT_SLACK and not centered:
            problems.append(
                f"{letter}: {max(under, over):.3f} mm over the edge, {low[axis]:.3f} to {high[axis]:.3f} mm, "
                f"should be within {bed_low[axis]:g} to {bed_high[axis]:g} (or set center)"
            )
    return problems
