"""Plane layers: the volume they lay, where they lie, what is solid."""

import manifold3d as m3
import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Point, box

from trunnion_core.bead import bead_area
from trunnion_core.errors import MeshError, PlacementError, SettingsError
from trunnion_core.layers import Bead, Layer
from trunnion_core.mesh import Mesh
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_slicer.planar import plan_planar, planar_layers
from trunnion_slicer.sections import sections

DENSE = PrintSettings(layer_height=0.3, fill_density=100, skirts=0)
SOLID = (Role.SOLID_INFILL, Role.TOP_SOLID_INFILL)


def to_mesh(solid: m3.Manifold) -> Mesh:
    data = solid.to_mesh64()
    return Mesh(np.array(data.vert_properties[:, :3], dtype=np.float64), np.array(data.tri_verts, dtype=np.int64))


SOLIDS = {
    "box": m3.Manifold.cube((20, 20, 9)),
    "tube": m3.Manifold.cylinder(9, 12, 12, 128) - m3.Manifold.cylinder(9, 7, 7, 128),
    "l": m3.Manifold.cube((30, 10, 9)) + m3.Manifold.cube((10, 30, 9)),
    "cone": m3.Manifold.cylinder(9, 15, 6, 128),
    "plate with holes": m3.Manifold.cube((40, 20, 6))
    - m3.Manifold.cylinder(6, 3, 3, 48).translate((10, 10, 0))
    - m3.Manifold.cylinder(6, 5, 5, 48).translate((27, 9, 0)),
}
SHAPES = {name: to_mesh(solid) for name, solid in SOLIDS.items()}
VOLUMES = {name: solid.volume() for name, solid in SOLIDS.items()}
del SOLIDS


def volume(bead: Bead) -> float:
    length = np.linalg.norm(np.diff(bead.points, axis=0), axis=1)
    return float((length * bead_area(bead.width, bead.height)[1:]).sum())


def lines(layer: Layer, *roles: Role) -> list[LineString]:
    return [LineString(bead.points[:, :2]) for bead in layer.beads if bead.role in roles]


def covered(layer: Layer, *roles: Role) -> object:
    """The area under beads, each widened a little to close the seams between neighbours."""
    return shapely.union_all([line.buffer(0.22) for line in lines(layer, *roles)])


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("settings", [DENSE, DENSE.model_copy(update={"perimeters": 0, "extrusion_width": 0.6})])
def test_full_density_lays_the_volume_of_the_mesh(name: str, settings: PrintSettings) -> None:
    laid = sum(volume(bead) for layer in planar_layers(SHAPES[name], settings) for bead in layer.beads)
    assert laid == pytest.approx(VOLUMES[name], rel=0.02)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("density", [15, 100])
def test_every_bead_lies_inside_its_section_and_on_its_plane(name: str, density: float) -> None:
    settings = DENSE.model_copy(update={"fill_density": density})
    mesh = SHAPES[name]
    layers = planar_layers(mesh, settings)
    slices = sections(mesh, np.array([layer.z - layer.height / 2 for layer in layers]))
    for layer, section in zip(layers, slices, strict=True):
        for bead in layer.beads:
            assert (bead.points[:, 2] == layer.z).all()
            assert (bead.tool_axes == [0, 0, 1]).all()
            assert shapely.covers(section.buffer(-0.19), LineString(bead.points[:, :2]))


def test_layers_follow_first_layer_height_and_stop_at_the_nearest_to_the_top() -> None:
    settings = DENSE.model_copy(update={"first_layer_height": 0.2, "first_layer_extrusion_width": 0.5})
    layers = planar_layers(to_mesh(m3.Manifold.cube((5, 5, 1.9))), settings)
    assert [layer.z for layer in layers] == pytest.approx([0.2, 0.5, 0.8, 1.1, 1.4, 1.7, 2.0])
    outer = [next(bead for bead in layer.beads if bead.role == Role.OUTER_WALL) for layer in layers]
    assert [bead.width[0] for bead in outer[:2]] == [0.5, 0.4]
    assert outer[0].points[:, 0].min() == pytest.approx(0.25)
    assert outer[1].points[:, 0].min() == pytest.approx(0.2)


def test_skins_are_solid_as_many_layers_as_asked_and_the_middle_is_not() -> None:
    # A 3 mm step beside a 9 mm tower, layers of 0.3 mm: the step's skin is layers 7 to 9, the tower's 27 to 29.
    settings = DENSE.model_copy(update={"fill_density": 20, "top_solid_layers": 3, "bottom_solid_layers": 2})
    layers = planar_layers(to_mesh(m3.Manifold.cube((30, 20, 3)) + m3.Manifold.cube((12, 20, 9))), settings)
    step, tower = box(14, 2, 28, 18), box(2, 2, 10, 18)
    for index, layer in enumerate(layers):
        solid = covered(layer, *SOLID)
        for place, top in ((step, 9), (tower, 29)):
            if index > top:
                continue
            share = solid.intersection(place).area / place.area
            if index < 2 or index > top - 3:
                assert share > 0.99, (index, top)
            else:
                assert share < 0.01, (index, top)
        facing_up = covered(layer, Role.TOP_SOLID_INFILL).area
        assert (facing_up > 10) == (index in (9, 29))


def test_sparse_infill_has_its_density_and_turns_with_the_layer() -> None:
    settings = DENSE.model_copy(update={"fill_density": 25, "top_solid_layers": 0, "bottom_solid_layers": 0})
    layers = planar_layers(to_mesh(m3.Manifold.cube((40, 40, 3))), settings)
    directions = []
    for layer in layers:
        infill = lines(layer, Role.INFILL)
        steps = np.concatenate([np.diff(np.asarray(line.coords), axis=0) for line in infill])
        slanted = steps[np.abs(steps).min(axis=1) > 1e-6]
        directions.append(np.sign(slanted.prod(axis=1)).mean())
        laid = np.linalg.norm(slanted, axis=1).sum() * 0.336
        assert laid / 38.6**2 == pytest.approx(0.25, abs=0.02)
    assert directions == pytest.approx([1.0, -1.0] * (len(layers) // 2))


def test_no_density_no_infill_but_skins() -> None:
    settings = DENSE.model_copy(update={"fill_density": 0})
    roles = [{bead.role for bead in layer.beads} for layer in planar_layers(SHAPES["box"], settings)]
    assert all(Role.INFILL not in found for found in roles)
    assert Role.SOLID_INFILL in roles[0]
    assert roles[15] == {Role.OUTER_WALL, Role.INNER_WALL}


def test_holes_stay_open() -> None:
    for layer in planar_layers(SHAPES["plate with holes"], DENSE):
        beads = list(lines(layer, *Role))
        for x, y, radius in ((10, 10, 3), (27, 9, 5)):
            nearest = min(line.distance(Point(x, y)) for line in beads)
            assert nearest == pytest.approx(radius + 0.2, abs=0.03)


def test_the_skirt_goes_round_the_first_layer_only() -> None:
    settings = DENSE.model_copy(update={"skirts": 2, "skirt_distance": 4.0})
    first, *others = planar_layers(SHAPES["l"], settings)
    loops = lines(first, Role.SKIRT)
    assert len(loops) == 2
    assert loops[0].length > loops[1].length
    section = box(0, 0, 30, 10).union(box(0, 0, 10, 30))
    assert loops[1].distance(section) == pytest.approx(4.2, abs=0.03)
    assert loops[0].distance(loops[1]) == pytest.approx(0.336, abs=0.03)
    assert not any(lines(layer, Role.SKIRT) for layer in others)


@pytest.mark.parametrize(
    ("mesh", "error", "says"),
    [
        (to_mesh(m3.Manifold.cube((10, 10, 0.1))), MeshError, "less than half the first layer"),
        (to_mesh(m3.Manifold.cube((10, 10, 5)).translate((0, 0, 2))), PlacementError, "should stand on the bed"),
        (to_mesh(m3.Manifold.cube((10, 10, 5)).translate((0, 0, -2))), PlacementError, "should stand on the bed"),
    ],
)
def test_what_cannot_be_sliced_is_refused(mesh: Mesh, error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        planar_layers(mesh, DENSE)


def test_an_unknown_pattern_is_refused_even_where_no_layer_needs_it() -> None:
    settings = DENSE.model_copy(update={"fill_pattern": "gyroyd"})
    with pytest.raises(SettingsError, match="fill_pattern: 'gyroyd' is unknown"):
        planar_layers(SHAPES["box"], settings)


def test_islands_in_the_air_are_said() -> None:
    mushroom = m3.Manifold.cube((10, 10, 6)) + m3.Manifold.cube((4, 10, 3)).translate((20, 0, 3))
    bridge = mushroom + m3.Manifold.cube((24, 10, 1)).translate((0, 0, 6))
    findings = plan_planar(to_mesh(bridge), DENSE).findings
    assert [(finding.code, finding.layer) for finding in findings] == [("unsupported-island", 10)]
    assert findings[0].point == pytest.approx((22, 5, 3.3), abs=1)


def test_what_no_bead_fits_into_is_said() -> None:
    needle = m3.Manifold.cube((10, 10, 3)) + m3.Manifold.cylinder(9, 0.1, 0.1, 12).translate((5, 5, 0))
    (finding,) = plan_planar(to_mesh(needle), DENSE).findings
    assert finding.code == "thin-place-lost"
    assert finding.layer == 10
    assert finding.value == 20
    assert plan_planar(SHAPES["plate with holes"], DENSE).findings == ()
