"""Mesh files of every kind give the same solid; broken ones give one sentence."""

import re
import struct
import zipfile

import numpy as np
import pytest
from manifold3d import Manifold
from numpy.testing import assert_allclose, assert_array_equal

from trunnion_core.errors import MeshError
from trunnion_core.mesh import Mesh
from trunnion_slicer.bodies import mesh_of
from trunnion_slicer.mesh_io import CODES, READERS, load_mesh, write_stl
from trunnion_slicer.repair import make_solid

BALL = mesh_of(Manifold.sphere(10, 16).translate([1.5, -2.25, 10]))
TETRAHEDRON = Mesh(
    np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def ascii_stl(mesh):
    lines = ["solid of vertex fame"]
    for triangle in mesh.triangles:
        corners = "\n".join("      vertex " + " ".join(f"{value:.9e}" for value in corner) for corner in triangle)
        lines.append(f"  facet normal 0 0 0\n    outer loop\n{corners}\n    endloop\n  endfacet")
    return "\n".join([*lines, "endsolid of vertex fame\n"])


def obj(mesh):
    vertices = "\n".join("v " + " ".join(repr(float(value)) for value in corner) for corner in mesh.vertices)
    return f"# made here\n{vertices}\n" + "\n".join("f " + " ".join(str(k + 1) for k in face) for face in mesh.faces)


def ply(mesh):
    head = f"ply\nformat ascii 1.0\nelement vertex {len(mesh.vertices)}\nproperty double x\nproperty double y\n"
    head += f"property double z\nelement face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    vertices = "\n".join(" ".join(repr(float(value)) for value in corner) for corner in mesh.vertices)
    return head + vertices + "\n" + "\n".join("3 " + " ".join(map(str, face)) for face in mesh.faces) + "\n"


def mesh_xml(mesh):
    vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in mesh.vertices.tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces.tolist())
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def write_3mf(path, resources, build, unit="millimeter"):
    core = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    model = f'<?xml version="1.0"?><model unit="{unit}" xmlns="{core}"><resources>{resources}</resources>'
    relations = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/part.model"/></Relationships>'
    )
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("_rels/.rels", relations)
        package.writestr("3D/part.model", f"{model}<build>{build}</build></model>")
    return path


def write(folder, kind, mesh):
    path = folder / f"part.{kind.rpartition(' ')[2]}"
    if kind == "binary stl":
        write_stl(mesh, path)
    elif kind == "3mf":
        write_3mf(path, f'<object id="1">{mesh_xml(mesh)}</object>', '<item objectid="1"/>')
    else:
        path.write_text({"ascii stl": ascii_stl, "obj": obj, "ply": ply}[kind](mesh))
    return path


@pytest.mark.parametrize("kind", ["binary stl", "ascii stl", "obj", "ply", "3mf"])
def test_every_format_gives_the_same_triangles(tmp_path, kind):
    loaded = load_mesh(write(tmp_path, kind, BALL))
    assert loaded.findings == ()
    assert_allclose(loaded.mesh.triangles, BALL.triangles, rtol=0, atol=1e-6)
    solid, repairs = make_solid(loaded.mesh)
    assert repairs == ()
    assert len(solid.vertices) == len(BALL.vertices)


def test_a_binary_stl_that_begins_with_solid_is_read_as_binary(tmp_path):
    path = write(tmp_path, "binary stl", BALL)
    path.write_bytes(b"solid ".ljust(80) + path.read_bytes()[80:])
    assert_allclose(load_mesh(path).mesh.triangles, BALL.triangles, rtol=0, atol=1e-6)


def test_the_ending_may_be_written_large(tmp_path):
    path = write(tmp_path, "binary stl", BALL)
    assert len(load_mesh(path.rename(tmp_path / "PART.STL")).mesh.faces) == len(BALL.faces)


def test_an_obj_may_have_quads_and_negative_indices(tmp_path):
    path = tmp_path / "cube.obj"
    corners = "\n".join(f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    path.write_text(f"{corners}\nf 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf -7 -3 -1 -5\n")
    solid, repairs = make_solid(load_mesh(path).mesh)
    assert repairs == ()
    assert_array_equal(solid.bounds, [[0, 0, 0], [1, 1, 1]])
    assert len(solid.faces) == 12


def test_the_unit_of_a_3mf_is_honoured(tmp_path):
    resources = f'<object id="1">{mesh_xml(TETRAHEDRON)}</object>'
    loaded = load_mesh(write_3mf(tmp_path / "part.3mf", resources, '<item objectid="1"/>', unit="inch"))
    assert_allclose(loaded.mesh.bounds[1], 254.0)
    assert [finding.code for finding in loaded.findings] == ["mesh-unit"]


def test_components_and_items_of_a_3mf_stand_where_their_transforms_put_them(tmp_path):
    # The component turns by 90 degrees about Z (row vectors), then moves by 100 in X; the item lifts by 5.
    resources = f'<object id="1">{mesh_xml(TETRAHEDRON)}</object><object id="2"><components>'
    resources += '<component objectid="1" transform="0 1 0 -1 0 0 0 0 1 100 0 0"/></components></object>'
    build = '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"/><item objectid="1"/>'
    build += '<item objectid="1" printable="0"/>'
    loaded = load_mesh(write_3mf(tmp_path / "part.3mf", resources, build))
    expected = TETRAHEDRON.vertices @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [100, 0, 5]
    assert_allclose(loaded.mesh.vertices[:4], expected)
    assert_allclose(loaded.mesh.vertices[4:], TETRAHEDRON.vertices)
    assert [finding.code for finding in loaded.findings] == ["mesh-bodies", "mesh-skipped"]
    assert all(CODES[finding.code][0] == finding.severity for finding in loaded.findings)


def test_a_mirrored_body_of_a_3mf_keeps_its_outside(tmp_path):
    resources = f'<object id="1">{mesh_xml(TETRAHEDRON)}</object>'
    build = '<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>'
    _, repairs = make_solid(load_mesh(write_3mf(tmp_path / "part.3mf", resources, build)).mesh)
    assert repairs == ()


@pytest.mark.parametrize(
    ("resources", "build", "unit", "sentence"),
    [
        ("", '<item objectid="7"/>', "millimeter", "object 7 of 3D/part.model is used but not defined"),
        ('<object id="1"/>', '<item objectid="1"/>', "furlong", "unit 'furlong' is unknown, should be one of micron"),
        ('<object id="1"/>', "", "millimeter", "nothing in the build list"),
        (
            '<object id="1"><components><component objectid="1"/></components></object>',
            '<item objectid="1"/>',
            "millimeter",
            "contain each other",
        ),
        ('<object id="1"/>', '<item objectid="1" transform="1 2"/>', "millimeter", "is not 12 numbers"),
    ],
)
def test_a_wrong_3mf_is_refused(tmp_path, resources, build, unit, sentence):
    with pytest.raises(MeshError, match=sentence):
        load_mesh(write_3mf(tmp_path / "part.3mf", resources, build, unit))


def test_a_truncated_binary_stl_says_how_much_is_missing(tmp_path):
    path = write(tmp_path, "binary stl", BALL)
    whole = path.read_bytes()
    path.write_bytes(whole[: 84 + 50 * 7 + 13])
    with pytest.raises(MeshError, match=rf"promises {len(BALL.faces)} triangles, the file holds 7"):
        load_mesh(path)
    path.write_bytes(whole[:60])
    with pytest.raises(MeshError, match=r"60 bytes|text"):
        load_mesh(path)


def test_bytes_after_the_end_of_a_binary_stl_are_said(tmp_path):
    path = write(tmp_path, "binary stl", BALL)
    path.write_bytes(path.read_bytes() + b"extra")
    (finding,) = load_mesh(path).findings
    assert (finding.code, finding.value) == ("mesh-bytes-after-end", 5.0)


def test_a_truncated_ascii_stl_is_refused_wherever_it_is_torn(tmp_path):
    text = ascii_stl(TETRAHEDRON)
    path = tmp_path / "part.stl"
    for end in range(text.index("endloop"), text.rindex("endsolid"), 7):
        path.write_text(text[:end])
        with pytest.raises(MeshError, match="cut off after"):
            load_mesh(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("kind", ["binary stl", "ascii stl", "ply", "3mf"])
def test_a_corner_that_is_no_number_is_refused_with_its_triangle(tmp_path, kind, value):
    path = write(tmp_path, kind, TETRAHEDRON)
    if kind == "binary stl":
        data = bytearray(path.read_bytes())
        struct.pack_into("<f", data, 84 + 50 * 2 + 12, value)
        path.write_bytes(bytes(data))
        row = 2
    else:
        vertices = TETRAHEDRON.vertices.copy()
        vertices[3, 2] = 77.0
        text = {"ascii stl": ascii_stl, "ply": ply}.get(kind, mesh_xml)(Mesh(vertices, TETRAHEDRON.faces))
        text = text.replace(f"{77.0:.9e}" if kind == "ascii stl" else "77.0", str(value))
        if kind == "3mf":
            write_3mf(path, f'<object id="1">{text}</object>', '<item objectid="1"/>')
        else:
            path.write_text(text)
        row = 1
    with pytest.raises(MeshError, match=rf"triangle {row} has a corner at \(.*(nan|inf).*\), should be finite"):
        load_mesh(path)


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("empty.stl", b"", "is empty"),
        ("prose.stl", b"Dear printer,\nplease make me a boat.\n", "text without a single 'vertex' line"),
        ("long.stl", b"Dear printer, please make me a boat.\n" * 40, "text without a single 'vertex' line"),
        ("none.stl", bytes(84), "holds no triangles"),
        ("word.stl", b"solid\nfacet\nvertex 1 2 x\nvertex 1 2 3\nvertex 1 1 1\nendsolid", "is no number"),
        ("part.step", b"ISO-10303-21;", r"'\.step' is none of those known: \.stl, \.obj, \.ply, \.3mf"),
        ("empty.obj", b"# nothing\n", "holds no triangles|no readable OBJ"),
        ("junk.ply", b"\x00\x01\x02" * 50, "no readable PLY file"),
        ("junk.3mf", b"PK but no zip", "no readable 3MF package"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_sentence_with_its_name(tmp_path, name, data, sentence):
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(MeshError, match=f"{re.escape(name)}: .*({sentence})") as error:
        load_mesh(path)
    assert "\n" not in str(error.value)


def test_a_missing_file_and_a_directory_are_refused(tmp_path):
    with pytest.raises(MeshError, match="no such file"):
        load_mesh(tmp_path / "absent.stl")
    with pytest.raises(MeshError, match="is a directory"):
        load_mesh(tmp_path)
    assert sorted(READERS) == [".3mf", ".obj", ".ply", ".stl"]


def test_writing_leaves_nothing_half_done(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_stl(BALL, tmp_path / "absent" / "part.stl")
    write_stl(BALL, tmp_path / "part.stl")
    assert [path.name for path in tmp_path.iterdir()] == ["part.stl"]
