"""The dry run as a function: a program file and a machine, and perhaps the model, become a report."""

import math
from pathlib import Path

from trunnion.header import placement, read_header
from trunnion_core.mesh import Mesh
from trunnion_core.profile import MachineProfile
from trunnion_core.settings import PrintSettings
from trunnion_sim.judge import judge
from trunnion_sim.report import Report
from trunnion_slicer.mesh_io import load_mesh
from trunnion_slicer.placement import place, turn
from trunnion_slicer.repair import make_solid


def check_program(program: Path, profile: MachineProfile, model: Path | None = None) -> Report:
    """Judge a program. With a model, also compare what the beads leave behind with it.

    The model is turned and put where the program's header says the slicer put it; without such a header it is
    centred on the bed. The surface is compared over facets below equation 1's angle for the program's own layer
    height and width, whatever angle was printed non-planar, so that planar and non-planar programs are judged over
    the same facets.
    Raises GcodeError, MeshError, ProfileError.
    """
    header = read_header(program)
    mesh = None if model is None else _placed(model, profile, program, header)
    return judge(program, profile, model=mesh, max_angle_deg=_angle(header))


def _placed(model: Path, profile: MachineProfile, program: Path, header: dict[str, str]) -> Mesh:
    solid, _ = make_solid(load_mesh(model).mesh)
    shift = placement(program, header)
    if shift is None:
        return place(solid, profile, PrintSettings())[0]
    turned = turn(solid, _number(header, "rotate", PrintSettings().rotate))
    return Mesh(turned.vertices + shift, turned.faces)


def _angle(header: dict[str, str]) -> float:
    """Equation 1 of Shahid 2024 in degrees, for the program's settings; for the defaults where it has none."""
    defaults = PrintSettings()
    height = _number(header, "layer_height", defaults.layer_height)
    width = _number(header, "extrusion_width", defaults.extrusion_width)
    return math.degrees(math.atan2(height, width))


def _number(header: dict[str, str], key: str, otherwise: float) -> float:
    """A number of the header; `otherwise` where there is none, as in other slicers' "auto" and percentages."""
    try:
        return float(header.get(key, otherwise))
    except ValueError:
        return otherwise
