"""Machines to try, and a second road to every pose: the two chains multiplied out with 4 x 4 matrices."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from trunnion_core.profile import MachineProfile, load_profile, profile_from_file
from trunnion_core.profile_file import ProfileFile


def linear(letter: str, side: str, axis: list[float], low: float, high: float, speed: float = 200) -> dict[str, Any]:
    limits = {"min": low, "max": high, "speed": speed, "acceleration": 1000}
    return {"letter": letter, "side": side, "type": "linear", "axis": axis, **limits}


def rotary(
    letter: str, side: str, axis: list[float], point: list[float], reach: float | None, speed: float = 200
) -> dict[str, Any]:
    limits = {} if reach is None else {"min": -reach, "max": reach}
    common = {"letter": letter, "side": side, "type": "rotary", "axis": axis, "point": point}
    return {**common, **limits, "speed": speed, "acceleration": 1000}


def profile(
    name: str,
    joints: list[dict[str, Any]],
    tip: list[float] | None = None,
    axis: list[float] | None = None,
    origin: list[float] | None = None,
) -> MachineProfile:
    data = {
        "machine": {"name": name, "firmware": "marlin"},
        "joint": joints,
        "tool": {"tip": tip or [0, 0, 0], "axis": axis or [0, 0, 1]},
        "work": {"origin": origin or [0, 0, 0], "bed": {"shape": "circle", "diameter": 200, "height": 100}},
    }
    return profile_from_file(ProfileFile.model_validate(data), name)


def all_machines() -> dict[str, MachineProfile]:
    x = linear("X", "tool", [1, 0, 0], -300, 300)
    y = linear("Y", "tool", [0, 1, 0], -300, 300)
    z = linear("Z", "tool", [0, 0, 1], -300, 300)
    bed_y = linear("Y", "work", [0, -1, 0], -300, 300)
    bed_z = linear("Z", "work", [0, 0, -1], -300, 300)
    c_table = rotary("C", "work", [0, 0, 1], [0, 0, 0], None)
    return {
        "cradle": load_profile("generic_ab_cradle"),
        "tilt_then_platter": profile(
            "tilt_then_platter",
            [x, z, bed_y, rotary("A", "work", [0, 1, 0], [0, 0, -30], 200, 83.3), c_table],
        ),
        "finite_platter": profile(
            "finite_platter",
            [
                x,
                z,
                bed_y,
                rotary("A", "work", [0, 1, 0], [0, 0, -30], 200, 83.3),
                rotary("B", "work", [0, 0, 1], [1, 2, 0], 1200),
            ],
        ),
        "yaw_head": profile(
            "yaw_head",
            [
                x,
                z,
                rotary("A", "tool", [0, 0, 1], [0, 0, 0], 360),
                rotary("B", "tool", [0, 1, 0], [0, 0, 47.9], 146),
                bed_y,
            ],
            origin=[10, -5, 2],
        ),
        "nutating_head": profile(
            "nutating_head",
            [
                x,
                y,
                z,
                rotary("C", "tool", [0, 0, 1], [0, 0, 0], 360),
                rotary("B", "tool", [0, 1, 1], [3, 0, 60], 180),
            ],
        ),
        "head_and_table": profile(
            "head_and_table", [x, y, z, rotary("B", "tool", [0, 1, 0], [0, 0, 80], 120), c_table]
        ),
        "stage_on_table": profile(
            "stage_on_table",
            [
                z,
                rotary("A", "work", [1, 0, 0], [0, 0, -20], 120),
                rotary("C", "work", [0, 0, 1], [5, 0, 0], None),
                linear("X", "work", [-1, 0, 0], -300, 300),
                linear("Y", "work", [0, -1, 0], -300, 300),
            ],
        ),
        "slanted": profile(
            "slanted",
            [
                linear("X", "tool", [1, 0.2, 0], -300, 300),
                bed_z,
                rotary("A", "work", [1, 0.1, 0.2], [1, 2, 3], 200),
                linear("Y", "tool", [0, 1, 0.1], -300, 300),
                rotary("B", "tool", [0.1, 1, 0.3], [4, 5, 60], 200),
            ],
            tip=[1, -2, 3],
            axis=[0.1, 0.2, 1],
            origin=[7, 8, 9],
        ),
    }


def random_profile(rng: np.random.Generator) -> MachineProfile:
    """Any chain of three linear and two rotary joints in any order, on any side, in general position."""
    kinds = rng.permutation(["linear", "linear", "linear", "rotary", "rotary"])
    joints = []
    for letter, kind in zip("XYZAB", kinds, strict=True):
        side = str(rng.choice(["tool", "work"]))
        axis = rng.normal(size=3).tolist()
        if kind == "linear":
            joints.append(linear(letter, side, axis, -1e6, 1e6))
        else:
            joints.append(rotary(letter, side, axis, rng.uniform(-100, 100, 3).tolist(), None))
    tip, axis, origin = rng.uniform(-100, 100, 3), rng.normal(size=3), rng.uniform(-100, 100, 3)
    return profile("random", joints, tip.tolist(), axis.tolist(), origin.tolist())


def multiplied_out(machine: MachineProfile, joints: Any) -> tuple[Any, Any]:
    """Tip and tool axis in `part`, one row at a time, with homogeneous matrices from the definition of a profile."""
    points, tool_axes = [], []
    for row in joints:
        side = {"tool": np.eye(4), "work": np.eye(4)}
        for joint, value in zip(machine.joints, row, strict=True):
            step = np.eye(4)
            if joint.rotary:
                a, b, c = joint.axis
                k = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
                step[:3, :3] = np.eye(3) + np.sin(value) * k + (1 - np.cos(value)) * k @ k
                step[:3, 3] = joint.point - step[:3, :3] @ joint.point
            else:
                step[:3, 3] = value * joint.axis
            side[joint.side] = side[joint.side] @ step
        part_from_tool = np.linalg.inv(side["work"]) @ side["tool"]
        points.append((part_from_tool @ np.append(machine.tip, 1))[:3] - machine.origin)
        tool_axes.append(part_from_tool[:3, :3] @ machine.tool_axis)
    return np.array(points), np.array(tool_axes)


@pytest.fixture(scope="session")
def machines() -> dict[str, MachineProfile]:
    return all_machines()


@pytest.fixture(scope="session")
def make_random_profile() -> Callable[[np.random.Generator], MachineProfile]:
    return random_profile


@pytest.fixture(scope="session")
def oracle() -> Callable[[MachineProfile, Any], tuple[Any, Any]]:
    return multiplied_out


@pytest.fixture(scope="session")
def make_profile() -> Callable[..., MachineProfile]:
    return profile


@pytest.fixture(scope="session")
def joint_tables() -> tuple[Callable[..., dict[str, Any]], Callable[..., dict[str, Any]]]:
    return linear, rotary


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Tests that ask for `machine` run on every machine."""
    if "machine" in metafunc.fixturenames:
        found = all_machines()
        metafunc.parametrize("machine", found.values(), ids=found.keys())
