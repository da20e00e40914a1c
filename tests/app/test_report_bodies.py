"""The report page's machine: which joints carry a body, and a hull as triangles that enclose it."""

import math

import numpy as np

from trunnion.html_report import _carriers, _drawn
from trunnion_core.profile import load_profile
from trunnion_core.solid_tables import HullTable


def test_a_body_moves_with_its_side_up_to_its_joint():
    profile = load_profile("open5x_voron0")
    carried = {letter: _carriers(profile, letter) for letter in ("frame", "X", "Y", "Z", "B", "C")}
    assert {key: value["joints"] for key, value in carried.items()} == {
        "frame": 0,
        "X": 1,
        "Y": 2,
        "Z": 1,
        "B": 2,
        "C": 3,
    }
    assert {key for key, value in carried.items() if value["side"] == "work"} == {"Z", "B", "C"}


def test_the_triangles_of_a_hull_look_outwards():
    """By the divergence theorem they enclose its volume: an octahedron's, with a point inside that is no corner."""
    ends = [tuple(sign * 3.0 * axis) for axis in np.eye(3) for sign in (1, -1)]
    drawn = _drawn(HullTable(shape="hull", name="diamond", points=(*ends, (0.1, 0.2, 0.3))))
    a, b, c = np.moveaxis(np.array(drawn["triangles"]), 1, 0)
    assert len(a) == 8
    assert math.isclose((a * np.cross(b, c)).sum() / 6, 4 / 3 * 3.0**3)
