"""Machines of every kind and analytic toolpaths: dome, cone, pipe, a stack of squares."""

import numpy as np
import pytest

from trunnion_core.profile import load_profile, profile_from_file
from trunnion_core.profile_file import ProfileFile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath


def _linear(letter, side, axis, low, high, speed=200.0):
    limits = {"min": low, "max": high, "speed": speed, "acceleration": 10 * speed, "corner_speed": speed / 25}
    return {"letter": letter, "side": side, "type": "linear", "axis": axis, **limits}


def _rotary(letter, side, axis, point, limit=None):
    table = {"letter": letter, "side": side, "type": "rotary", "axis": axis, "point": point}
    table |= {"speed": 200.0, "acceleration": 1000.0, "corner_speed": 8.0}
    return table if limit is None else table | {"min": -limit, "max": limit}


def machine(joints, **more):
    bed = {"shape": "circle", "diameter": 200, "height": 120}
    data = {
        "machine": {"name": "test", "firmware": "marlin"},
        "joint": joints,
        "work": {"origin": [0, 0, 0], "bed": bed},
        **more,
    }
    return profile_from_file(ProfileFile.model_validate(data), "test.toml")


def bc_table(c_limit=None, **more):
    return machine(
        [
            _linear("X", "tool", [1, 0, 0], -180, 180),
            _linear("Y", "tool", [0, 1, 0], -180, 180),
            _linear("Z", "tool", [0, 0, 1], -100, 200, 40.0),
            _rotary("B", "work", [0, 1, 0], [0, 0, 25], 110),
            _rotary("C", "work", [0, 0, 1], [0, 0, 0], c_limit),
        ],
        **more,
    )


def head():
    return machine(
        [
            _linear("X", "tool", [1, 0, 0], -250, 250),
            _linear("Z", "tool", [0, 0, 1], -20, 250, 40.0),
            _rotary("C", "tool", [0, 0, 1], [0, 0, 0], 360),
            _rotary("B", "tool", [0, 1, 0], [0, 0, 47], 135),
            _linear("Y", "work", [0, -1, 0], -250, 250),
        ]
    )


MACHINES = {
    "ab": lambda: load_profile("generic_ab_cradle"),
    "bc": bc_table,
    "bc_limited": lambda: bc_table(200),
    "head": head,
    "open5x_prusa_i3": lambda: load_profile("open5x_prusa_i3"),
    "open5x_voron0": lambda: load_profile("open5x_voron0"),
    "rep5x_ender3": lambda: load_profile("rep5x_ender3"),
}


@pytest.fixture(params=sorted(MACHINES))
def profile(request):
    """Each five-axis machine in turn."""
    return MACHINES[request.param]()


@pytest.fixture
def machines():
    """Every five-axis machine by name."""
    return {name: make() for name, make in MACHINES.items()}


@pytest.fixture
def settings():
    return PrintSettings(layer_height=0.3, extrusion_width=0.4)


def rings_path(rings, role=Role.NONPLANAR_INFILL, height=0.3, speed=30.0, lift=1.0):
    """Rings (points, tool axes, width, layer), one after the other, with a lift, a travel and a descent between."""
    blocks = {name: [] for name in ("points", "tool_axes", "width", "role", "layer")}

    def add(points, axes, width, kind, layer):
        n = len(points)
        for name, value in zip(
            blocks, (points, axes, np.full(n, width), np.full(n, int(kind)), np.full(n, layer)), strict=True
        ):
            blocks[name].append(value)

    before = None
    for points, axes, width, layer in rings:
        if before is not None:
            add(before[0] + lift * before[1], before[1], 0.0, Role.TRAVEL, layer)
            add(points[:1] + lift * axes[:1], axes[:1], 0.0, Role.TRAVEL, layer)
        add(points[:1], axes[:1], 0.0, Role.TRAVEL, layer)
        add(points[1:], axes[1:], width, role, layer)
        before = points[-1:], axes[-1:]
    arrays = {name: np.concatenate(value) for name, value in blocks.items()}
    beads = arrays["width"] > 0
    return Toolpath(**arrays, height=np.where(beads, height, 0.0), speed=np.where(beads, speed, 120.0))


def ring(radius, z, tilt, n=180):
    angle = np.linspace(0, 2 * np.pi, n + 1)
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    axes = np.sin(tilt) * around + np.cos(tilt) * np.array([0, 0, 1.0])
    return radius * around + [0, 0, z], axes


def dome_path(radius=40.0, layers=1, height=0.3, pitch=0.4, tilts=(0.02, 0.6), center=(0.0, 0.0, -25.0), n=180):
    """Rings of constant slope on a sphere's cap, outermost layer last; pitch along the surface."""
    rings = []
    low, high = tilts
    for layer in range(layers):
        r = radius - height * (layers - 1 - layer)
        count = int(np.ceil(r * (high - low) / pitch))
        step = (high - low) / count
        for tilt in low + step * (np.arange(count) + 0.5):
            points, axes = ring(r * np.sin(tilt), r * np.cos(tilt), tilt, n)
            rings.append((points + center, axes, step * r + height * (1 - np.pi / 4), layer))
    return rings_path(rings, height=height)


@pytest.fixture
def dome():
    """A coarse dome for motion tests: few rings, tilts from 1 to 34 degrees."""
    return dome_path(pitch=2.5, n=120)


@pytest.fixture
def paths():
    """Makers of toolpaths and machines, for tests that vary them."""
    return {"rings": rings_path, "ring": ring, "dome": dome_path, "bc": bc_table, "machine": machine, "linear": _linear}
