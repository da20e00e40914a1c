"""Compare the surface that beads leave behind with the model: Chamfer distance and its relatives.

Points stand over a jittered grid in X and Y, about 125,000 of them (the paper's surface had 124,560), where the topmost
facet of the model is no steeper than the threshold: once on the model and once on the beads straight above or below.
Distances are true ones, from points to surfaces, not to the nearest sample, so that they do not depend on how
dense the samples are: equation 12 of Shahid 2024 (arXiv 2411.07225) in the limit of many points.
"""

import math

import igl
import numpy as np

from trunnion_core.arrays import FloatArray, IntArray
from trunnion_core.mesh import Mesh
from trunnion_sim.report import SurfaceReport
from trunnion_sim.surface import compare_kernel
from trunnion_sim.surface.deposit import Field, turned

SAMPLES = 125_000
"""Points aimed at."""
SEED = 20241107
"""Of the jitter: the same program gives the same figures."""


def compare(field: Field, model: Mesh, max_angle_deg: float, layer_height: float) -> SurfaceReport | None:
    """The comparison over visible facets up to `max_angle_deg` from horizontal; None where there are none.

    `layer_height` in mm: void and overfill are shares of an outermost layer that thick.
    """
    normals = facet_normals(model)
    chosen = normals[:, 2] >= math.cos(math.radians(max_angle_deg)) - 1e-9
    area = float((_areas(model) * normals[:, 2])[chosen].sum())
    if area <= 0:
        return None
    xy = _jittered(model, area)
    z, face = model_top(model, xy)
    hit = (face >= 0) & chosen[np.maximum(face, 0)]
    if not hit.any():
        return None
    xy, z = xy[hit], z[hit]
    on_beads = np.column_stack([xy, heights(field, xy)])
    on_model = np.column_stack([xy, z])
    distance = distance_to_mesh(on_beads, model)
    sign = np.where(on_beads[:, 2] >= z, 1.0, -1.0)
    back = compare_kernel.distance_to_field(
        field.top, field.x, field.y, field.cell, turned(on_model), np.abs(on_beads[:, 2] - z)
    )
    above = (on_beads[:, 2] - z) * normals[face[hit], 2]
    return SurfaceReport(
        points=on_beads,
        deviation=sign * distance,
        chamfer=float(distance.mean() + back.mean()),
        void_fraction=float(np.clip(-above, 0.0, layer_height).mean() / layer_height),
        overfill_fraction=float(np.clip(above, 0.0, layer_height).mean() / layer_height),
        cell=field.cell,
    )


def heights(field: Field, xy: FloatArray) -> FloatArray:
    """(n,) mm: the surface of the beads at (n, 2) points, between four cells; the bed outside the field."""
    return np.asarray(
        compare_kernel.field_heights(field.top, field.x, field.y, field.cell, turned(xy)), dtype=np.float64
    )


def model_top(model: Mesh, xy: FloatArray) -> tuple[FloatArray, IntArray]:
    """Height of the topmost facet over (n, 2) points and its row; NaN and -1 beside the model."""
    return compare_kernel.topmost(np.ascontiguousarray(model.triangles), xy)


def distance_to_mesh(points: FloatArray, model: Mesh) -> FloatArray:
    """(n,) mm from points to the nearest spot of the mesh."""
    squared = igl.point_mesh_squared_distance(points, model.vertices, model.faces)[0]
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)), dtype=np.float64)


def facet_normals(model: Mesh) -> FloatArray:
    """(m, 3) unit; zero for facets without area."""
    across = _cross(model)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(np.divide(across, size, out=np.zeros_like(across), where=size > 0))


def _areas(model: Mesh) -> FloatArray:
    return np.asarray(np.linalg.norm(_cross(model), axis=1) / 2)


def _cross(model: Mesh) -> FloatArray:
    a, b, c = model.triangles.transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def _jittered(model: Mesh, area: float) -> FloatArray:
    """(n, 2) one point in each square of a grid over the model, so dense that SAMPLES of them cover `area`."""
    low, high = model.bounds[:, :2]
    pitch = math.sqrt(area / SAMPLES)
    nx, ny = np.maximum(1, np.ceil((high - low) / pitch)).astype(int)
    squares = np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), axis=-1).reshape(-1, 2)
    jitter = np.random.default_rng(SEED).random(squares.shape)
    return np.asarray(low + (squares + jitter) * pitch)
