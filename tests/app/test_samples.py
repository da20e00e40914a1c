"""The five sample parts are solids with the features that they are named for."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from trunnion import samples
from trunnion_core.settings import PrintSettings
from trunnion_slicer.bodies import manifold_of, volumes
from trunnion_slicer.repair import make_solid

THRESHOLD = np.cos(np.arctan(0.3 / 0.4))


def normals(mesh):
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def patches(mesh):
    """Faces (rows) of every connected patch below the threshold angle, largest first, slivers left out."""
    rows = np.flatnonzero(normals(mesh)[:, 2] > THRESHOLD)
    faces = mesh.faces[rows]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    of = coo_array((np.ones(len(edge)), (np.repeat(np.arange(len(rows)), 3), edge.ravel()))).tocsr()
    count, label = connected_components(of @ of.T, directed=False)
    found = sorted((rows[label == k] for k in range(count)), key=lambda patch: -area(mesh, patch))
    return [patch for patch in found if area(mesh, patch) > 4.0]


def area(mesh, rows):
    a, b, c = np.moveaxis(mesh.triangles[rows], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def rim_heights(mesh, rows):
    faces = mesh.faces[rows]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edge, uses = np.unique(ends, axis=0, return_counts=True)
    return mesh.vertices[np.unique(edge[uses == 1]), 2]


@pytest.fixture(scope="module")
def parts():
    return {name: samples.make(name) for name in samples.names()}


def test_there_are_the_five_of_the_paper():
    assert samples.names() == ("freeform", "mouse", "propeller", "rib", "wheel")


@pytest.mark.parametrize("name", samples.names())
def test_a_sample_is_a_modest_closed_solid_that_needs_no_support_and_no_repair(parts, name):
    mesh = parts[name]
    solid, findings = make_solid(mesh)
    assert findings == ()
    assert len(solid.faces) == len(mesh.faces)
    assert volumes(mesh.vertices, mesh.faces, np.zeros(len(mesh.faces), dtype=int))[0] > 1000
    assert manifold_of(mesh.vertices, mesh.faces).status().name == "NoError"
    low, high = mesh.bounds
    assert low[2] == 0.0
    assert (high - low < [46, 46, 14]).all()
    hanging = np.flatnonzero((normals(mesh)[:, 2] < -1e-3) & (mesh.triangles[:, :, 2].max(axis=1) > 0))
    assert area(mesh, hanging) < 1e-3  # mm²: slivers that Booleans leave where surfaces meet


@pytest.mark.parametrize("name", samples.names())
def test_a_sample_is_the_same_every_time_and_its_settings_are_valid(parts, name):
    again = samples.make(name)
    assert_array_equal(again.vertices, parts[name].vertices)
    assert_array_equal(again.faces, parts[name].faces)
    settings = PrintSettings.model_validate(samples.settings(name))
    assert (settings.layer_height, settings.extrusion_width) == (0.3, 0.4)


def test_the_skin_of_the_freeform_part_ends_at_varying_heights_in_flanks_that_are_hardly_steeper(parts):
    mesh = parts["freeform"]
    skin = patches(mesh)
    assert len(skin) == 1
    rim = rim_heights(mesh, skin[0])
    assert np.ptp(rim) > 2.0
    touching = np.isin(mesh.faces, np.unique(mesh.faces[skin[0]])).any(axis=1)
    touching[skin[0]] = False
    assert np.degrees(np.arccos(normals(mesh)[touching, 2])).max() < 45.0


def test_the_mouse_has_one_handle_and_a_split(parts):
    mesh = parts["mouse"]
    assert manifold_of(mesh.vertices, mesh.faces).genus() == 1
    assert len(patches(mesh)) == 1
    floor = (np.ptp(mesh.triangles[:, :, 2], axis=1) < 1e-6) & (np.abs(mesh.triangles[:, 0, 2] - 6.2) < 1e-6)
    assert area(mesh, np.flatnonzero(floor)) > 4.0


def test_the_rib_stands_in_the_middle_of_four_flat_roofs(parts):
    mesh = parts["rib"]
    slopes = np.unique(np.degrees(np.arccos(normals(mesh)[normals(mesh)[:, 2] > 0.5, 2])).round(6))
    assert slopes.tolist() == [0.0, 12.0, 18.0, 24.0, 30.0]
    main, top = patches(mesh)
    assert area(mesh, top) == pytest.approx(1.6 * 18.0)
    assert mesh.triangles[main][:, :, 2].max() < 11.0


def test_the_blades_of_the_propeller_are_three_alike_and_twist(parts):
    mesh = parts["propeller"]
    *blades, hub = patches(mesh)
    assert len(blades) == 3
    areas = [area(mesh, blade) for blade in blades]
    assert np.ptp(areas) < 0.01 * np.mean(areas)
    assert area(mesh, hub) < min(areas)
    blade = blades[0]
    middle = mesh.triangles[blade].mean(axis=1)
    radius = np.hypot(middle[:, 0], middle[:, 1])
    slope = np.degrees(np.arccos(normals(mesh)[blade, 2]))
    assert slope[radius < 9].mean() > slope[radius > 18].mean() + 5


def test_the_wheel_has_five_patches_at_three_heights(parts):
    mesh = parts["wheel"]
    tops = sorted(round(float(mesh.triangles[patch][:, :, 2].max()), 1) for patch in patches(mesh))
    assert len(tops) == 5
    assert tops[-1] == 9.2
    assert tops[-2] == 8.0
    assert max(tops[:3]) < 6.6


def test_an_unknown_sample_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="freeform, mouse, propeller, rib, wheel"):
        samples.make("_solids")
