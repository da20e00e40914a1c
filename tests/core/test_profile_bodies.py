"""Bodies of a profile: hulls and mesh files, carriers of either side, and every mistake in its own sentence."""

import re
import struct

import numpy as np
import pytest

from trunnion_core.errors import ProfileError
from trunnion_core.profile import load_profile
from trunnion_core.solid_tables import HullTable
from trunnion_core.stl_corners import stl_corners

CORNERS = np.array([[0, 0, 0], [8, 0, 0], [0, 6, 0], [0, 0, 4]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def written(folder, body):
    """A shipped machine with one more body."""
    path = folder / "machine.toml"
    path.write_text(f'extends = "generic_ab_cradle"\nbody = [{body}]\n')
    return path


def wedge(carried_by, solid, rest=""):
    return f'{{ carried_by = "{carried_by}", solid = {solid}{rest} }}'


def binary(corners=CORNERS):
    triangles = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[face].ravel(), 0) for face in FACES)
    return b"solid in name only".ljust(80) + struct.pack("<I", len(FACES)) + triangles


def text(corners=CORNERS):
    lines = ["solid wedge"]
    for face in FACES:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += [f"  vertex {x:e} {y} {z}" for x, y, z in corners[face].tolist()] + [" endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]).encode()


@pytest.mark.parametrize("data", [binary(), text(), text().upper()], ids=["binary", "text", "loud"])
def test_a_mesh_file_becomes_the_hull_of_its_corners(tmp_path, data):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "arm.stl").write_bytes(data)
    mesh = '{ shape = "mesh", name = "arm", file = "parts/arm.stl" }'
    body = load_profile(written(tmp_path, wedge("A", mesh, ', touches = ["bed"]'))).bodies[0]
    assert (body.carried_by, body.touches, body.solid.name) == ("A", ("bed",), "arm")
    assert isinstance(body.solid, HullTable)
    assert sorted(body.solid.points) == sorted(map(tuple, CORNERS.tolist()))


def test_a_mesh_of_a_parent_profile_is_found_beside_the_parent(tmp_path):
    parent, child = tmp_path / "parent", tmp_path / "child"
    parent.mkdir()
    child.mkdir()
    (parent / "arm.stl").write_bytes(binary())
    written(parent, wedge("frame", '{ shape = "mesh", name = "arm", file = "arm.stl" }'))
    (child / "mine.toml").write_text('extends = "../parent/machine.toml"\n')
    assert load_profile(child / "mine.toml").bodies[0].solid.name == "arm"


MISTAKES = [
    (
        wedge("Q", '{ shape = "box", name = "b", min = [0, 0, 0], max = [1, 1, 1] }'),
        "body b: carried_by is Q, should be",
    ),
    (
        wedge("A", '{ shape = "box", name = "b", min = [0, 0, 0], max = [1, 1, 1] }', ', touches = ["carrige"]'),
        "body b: touches carrige, which is no body; did you mean 'carriage'",
    ),
    (wedge("A", '{ shape = "box", name = "b", min = [0, 0, 1], max = [1, 1, 1] }'), "b: min 1 is not below max 1"),
    (
        wedge("A", '{ shape = "cylinder", name = "b", bottom = 2, top = 1, diameter = 1 }'),
        "b: bottom 2 is not below top",
    ),
    (
        wedge("A", '{ shape = "cone", name = "b", bottom = 0, top = 1, bottom_diameter = 0, top_diameter = 0 }'),
        "b: zero 0 is not below the larger diameter 0",
    ),
    (wedge("A", '{ shape = "hull", name = "b", points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]] }'), "at least 4"),
    (
        wedge("A", '{ shape = "hull", name = "b", points = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]] }'),
        "b: points lie in one plane",
    ),
    (
        wedge("A", '{ shape = "mesh", name = "b", file = "none.stl" }'),
        r"body b: .*none\.stl cannot be read: No such file",
    ),
    (wedge("A", '{ shape = "mesh", name = "b", file = "machine.toml" }'), r"body b: .*machine\.toml is no STL file"),
    (wedge("A", '{ shape = "mesh", name = "b", file = "flat.stl" }'), r"the corners of .*flat\.stl lie in one plane"),
    (wedge("A", '{ shape = "mesh", name = "b", fiel = "b.stl" }'), r"unknown key"),
]


@pytest.mark.parametrize(("body", "sentence"), MISTAKES)
def test_each_mistake_has_its_sentence(tmp_path, body, sentence):
    (tmp_path / "flat.stl").write_bytes(binary(CORNERS * (1, 1, 0)))
    with pytest.raises(ProfileError) as error:
        load_profile(written(tmp_path, body))
    assert any(re.search(sentence, problem) for problem in error.value.problems), error.value.problems


def test_what_is_no_number_is_no_corner(tmp_path):
    path = tmp_path / "bad.stl"
    path.write_bytes(text().replace(b"8.000000e+00", b"nan"))
    with pytest.raises(ValueError, match="finite corners"):
        stl_corners(path)
