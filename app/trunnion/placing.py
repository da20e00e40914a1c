"""Find a placement as a function: a mesh file and a machine become a turn and a shift, as print settings."""

import math
from pathlib import Path

import numpy as np

from trunnion.pipeline import settings_for
from trunnion_core.profile import MachineProfile
from trunnion_core.settings import PrintSettings
from trunnion_motion.fit import Poses
from trunnion_motion.place import place
from trunnion_slicer.mesh_io import load_mesh
from trunnion_slicer.placement import put
from trunnion_slicer.repair import make_solid


def find_placement(model: Path, profile: MachineProfile, settings: PrintSettings) -> tuple[float, tuple[float, float]]:
    """(rotate in degrees, shift in mm) with which the machine reaches every vertex with its tilt.

    Searched from the placement that `settings` give. Raises PlacementError where a search in steps of 5 mm and 5
    degrees finds none, naming the joint and the place.
    """
    settings = settings_for(profile, settings)
    solid, _ = make_solid(load_mesh(model).mesh)
    tilted = settings.nonplanar_tool_axis == "normal"
    start, _ = put(solid, profile, settings)
    poses = Poses.of_mesh(start, math.radians(settings.max_angle_deg) if tilted else 0.0)
    found = place(poses, profile)
    rotate = (settings.rotate + found.turn_deg + 180.0) % 360.0 - 180.0
    # `place` turns about the middle of the poses, the setting about the file's origin: the shift makes up for it
    wanted = found.of(Poses(start.vertices, np.tile([0.0, 0.0, 1.0], (len(start.vertices), 1)))).points
    given, _ = put(solid, profile, settings.model_copy(update={"rotate": rotate}))
    extra = (wanted - given.vertices)[0]
    return rotate, (settings.shift[0] + float(extra[0]), settings.shift[1] + float(extra[1]))
