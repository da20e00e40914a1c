"""Measure the kinematics room: python bench/kinematics.py [--poses 1000000] [--chains 100] [--prices].

Speeds are beside a plain numpy implementation of the same in the same run: forward as homogeneous 4 x 4 matrices
multiplied out over all rows at once, inverse as the textbook closed form in whole-array operations. The round trip is
the full figure of the tests: that many random poses over that many random chains, worst error of any branch. --prices
instead plans samples with other prices of a step and prints how much the time of the print changes.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from trunnion import samples
from trunnion.pipeline import settings_for, solid_part
from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.profile import MachineProfile, load_profile, profile_from_file
from trunnion_core.profile_file import ProfileFile
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_kinematics import branches
from trunnion_kinematics.branches import choose
from trunnion_kinematics.chain import JointChain
from trunnion_kinematics.subdivide import subdivide
from trunnion_motion.plan import plan_motion
from trunnion_slicer.slice import slice_mesh

ROUNDS = 7
SHIPPED = ("generic_ab_cradle", "open5x_prusa_i3", "open5x_voron0", "rep5x_ender3")
PRICES: dict[str, dict[str, float]] = {
    "as it is": {},
    "extruding x 1": {"EXTRUDING_WEIGHT": 1.0},
    "extruding x 8": {"EXTRUDING_WEIGHT": 8.0},
    "turning x 0.1": {"TURNING_WEIGHT": 0.1},
    "turning x 1": {"TURNING_WEIGHT": 1.0},
    "rewind 0.5 s": {"REWIND_COST": 0.5},
    "rewind 9 s": {"REWIND_COST": 9.0},
    "early 0 s": {"EARLY_COST": 0.0},
    "early 0.1 s": {"EARLY_COST": 0.1},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--poses", type=int, default=1_000_000)
    parser.add_argument("--chains", type=int, default=100)
    parser.add_argument("--prices", action="store_true")
    options = parser.parse_args()
    if options.prices:
        other_prices()
        return
    rng = np.random.default_rng(0)
    n = options.poses
    machines = {
        "A-B cradle": load_profile("generic_ab_cradle"),
        "platter": platter(None),
        "random chain": anything(rng),
    }
    for name, machine in machines.items():
        inverse_and_forward(name, machine, n, rng)
    round_trip(n // options.chains, options.chains, rng)
    path_choice(n)


def inverse_and_forward(name: str, machine: MachineProfile, n: int, rng: np.random.Generator) -> None:
    chain = JointChain.from_profile(machine)
    points, tool_axes = rng.uniform(-50, 50, (n, 3)), unit_rows(rng, n)
    joints = chain.inverse(points, tool_axes)
    there = np.isfinite(joints[:, :99]).all(axis=(0, 2))
    turns = plain_inverse(machine, chain, points[:99], tool_axes[:99])[:, there][..., chain.rotary]
    assert np.allclose(np.sort(turns, axis=0), np.sort(joints[:, :99][:, there][..., chain.rotary], axis=0))
    from trunnion_kinematics.chain_kernels import inverse_kernel

    kernel = best(lambda: inverse_kernel(*chain.constants, points, tool_axes, joints))
    whole = best(lambda: chain.inverse(points, tool_axes))
    plain = best(lambda: plain_inverse(machine, chain, points, tool_axes), 2)
    print(f"{name}: inverse, both branches: {n / whole / 1e6:.2f} M poses/s "
          f"({n / kernel / 1e6:.2f} in place), numpy {n / plain / 1e6:.2f}, ratio {plain / whole:.1f}")  # fmt: skip
    some = np.nan_to_num(joints[0])
    whole = best(lambda: chain.forward(some))
    plain = best(lambda: plain_forward(machine, some), 2)
    assert np.allclose(plain_forward(machine, some[:99])[0], chain.forward(some[:99])[0])
    print(f"{name}: forward: {n / whole / 1e6:.2f} M poses/s, numpy {n / plain / 1e6:.2f}, ratio {plain / whole:.1f}")


def round_trip(n: int, chains: int, rng: np.random.Generator) -> None:
    worst, worst_axis, reached = 0.0, 0.0, 0
    for _ in range(chains):
        chain = JointChain.from_profile(anything(rng))
        points, tool_axes = rng.uniform(-100, 100, (n, 3)), unit_rows(rng, n)
        for joints in chain.inverse(points, tool_axes):
            there = np.isfinite(joints).all(axis=1)
            again, axes_again = chain.forward(joints[there])
            worst = max(worst, float(np.abs(again - points[there]).max()))
            worst_axis = max(worst_axis, float(np.abs(axes_again - tool_axes[there]).max()))
            reached += int(there.sum())
    print(f"round trip: {n * chains} poses, {chains} random chains, {reached} solutions: "
          f"tip {worst:.1e} mm, tool axis {worst_axis:.1e}")  # fmt: skip


def path_choice(n: int) -> None:
    """CPU seconds of one core, the least of some runs, beside a fixed load of numpy's in the same run."""
    yardstick = best_cpu(fixed_load, ROUNDS)
    print(f"choice: the fixed load takes {yardstick:.3f} s of CPU time")
    points, tool_axes, travel = winding_path(n)
    speed = np.full(n, 50.0)
    machines = {name: load_profile(name) for name in SHIPPED}
    for name, machine in {**machines, "platter of 3 turns": platter(540), "endless platter": platter(None)}.items():
        chain = JointChain.from_profile(machine)
        for tolerance in (0.0, 5.0):
            options = {"travel": travel, "axis_tolerance": float(np.radians(tolerance)), "speed": speed}
            choice = choose(chain, machine, points, tool_axes, **options)
            took = best_cpu(lambda: choose(chain, machine, points, tool_axes, **options), 3)  # noqa: B023
            print(
                f"choice, {name}, tolerance {tolerance:g} deg: {n} rows in {took:.2f} s, {took / yardstick:.1f} loads, "
                f"{choice.rewinds.size} rewinds, {choice.forced.size} forced"
            )
        fine = subdivide(chain, points, choice.tool_axes, choice.joints, 0.01, rewinds=choice.rewinds)
        took = best_cpu(lambda: subdivide(chain, points, choice.tool_axes, choice.joints, 0.01), 1)  # noqa: B023
        print(f"subdivision, {name}: {n} rows to {len(fine.source)} in {took:.2f} s")


def other_prices() -> None:
    """How far the true time depends on the price of a step: samples on every machine, planned with other prices.

    The price knows speeds, not accelerations. Were another way quicker once accelerations count, some of these prices
    would find it: seconds of extrusion and of turning weighed anew (turning x 1 takes rotaries for much slower), dearer
    and cheaper rewinds, turns earlier and later.
    """
    for name in ("freeform", "propeller"):
        settings = PrintSettings(**samples.settings(name))
        for machine in SHIPPED:
            profile = load_profile(machine)
            part = solid_part(name, samples.make(name), profile, settings)
            toolpath = slice_mesh(part.mesh, settings_for(profile, settings)).toolpath
            for tolerance in (0.0, 5.0):
                leaning = settings.model_copy(update={"nonplanar_axis_tolerance": tolerance})
                seconds = {price: planned_with(price, toolpath, profile, leaning) for price in PRICES}
                usual = seconds["as it is"]
                change = ", ".join(f"{price} {took / usual - 1:+.2%}" for price, took in list(seconds.items())[1:])
                print(f"prices, {name} on {machine}, tolerance {tolerance:g} deg: {usual:.1f} s; {change}", flush=True)


def planned_with(price: str, toolpath: Toolpath, profile: MachineProfile, settings: PrintSettings) -> float:
    """Seconds that the firmware takes for a plan made with other constants in `branches`."""
    usual = {key: getattr(branches, key) for key in PRICES[price]}
    try:
        for key, value in PRICES[price].items():
            setattr(branches, key, value)
        return float(plan_motion(toolpath, profile, settings).program.duration.sum())
    finally:
        for key, value in usual.items():
            setattr(branches, key, value)


def fixed_load() -> None:
    """What the choice is compared with: a million numbers sorted, their sines and their sums."""
    numbers = np.random.default_rng(0).normal(size=1_000_000)
    np.sort(numbers)
    np.sin(numbers).sum()
    np.cumsum(numbers)


def best_cpu(call: Callable[[], Any], rounds: int) -> float:
    """Least CPU time of some runs, in s."""
    times = []
    for _ in range(rounds):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return min(times)


def winding_path(n: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Two hundred turns up a vase, planar half of the time, with a travel every 400 rows."""
    a = np.linspace(0, 400 * np.pi, n)
    lean = np.radians(25) * np.clip(np.sin(a / 40), 0, 1)
    points = np.stack([30 * np.cos(a), 30 * np.sin(a), a / 100 + 5], axis=1)
    tool_axes = np.stack([np.sin(lean) * np.cos(a), np.sin(lean) * np.sin(a), np.cos(lean)], axis=1)
    return points, tool_axes, np.arange(n) % 400 == 0


def best(call: Callable[[], Any], rounds: int = ROUNDS) -> float:
    """Least wall time of some runs, in s."""
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def unit_rows(rng: np.random.Generator, n: int) -> FloatArray:
    rows = rng.normal(size=(n, 3))
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def plain_forward(machine: MachineProfile, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    side = {"tool": np.tile(np.eye(4), (len(joints), 1, 1)), "work": np.tile(np.eye(4), (len(joints), 1, 1))}
    for joint, value in zip(machine.joints, joints.T, strict=True):
        step = np.tile(np.eye(4), (len(joints), 1, 1))
        if joint.rotary:
            a, b, c = joint.axis
            k = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
            sin, cos = np.sin(value)[:, None, None], np.cos(value)[:, None, None]
            step[:, :3, :3] = np.eye(3) + sin * k + (1 - cos) * (k @ k)
            step[:, :3, 3] = joint.point - step[:, :3, :3] @ joint.point
        else:
            step[:, :3, 3] = value[:, None] * joint.axis
        side[joint.side] = side[joint.side] @ step
    whole = np.linalg.inv(side["work"]) @ side["tool"]
    return whole[:, :3, :3] @ machine.tip + whole[:, :3, 3] - machine.origin, whole[:, :3, :3] @ machine.tool_axis


def plain_inverse(machine: MachineProfile, chain: JointChain, points: FloatArray, tool_axes: FloatArray) -> FloatArray:
    """Paden's second subproblem and one 3 x 3 solve, in whole-array operations."""
    w1, w2 = chain.rotary_axes
    p, q = machine.tool_axis, tool_axes
    g, k1, k2 = w1 @ w2, q @ w1, w2 @ p
    m = 1 - g * g
    a, b = (k1 - g * k2) / m, (k2 - g * k1) / m
    joints = np.empty((2, len(points), 5))
    with np.errstate(invalid="ignore"):
        root = np.sqrt((1 - a * a - b * b - 2 * a * b * g) / m)
    for branch, c in enumerate((root, -root)):
        z = a[:, None] * w1 + b[:, None] * w2 + c[:, None] * np.cross(w1, w2)
        t2 = np.arctan2(np.cross(p, z) @ w2, z @ p - k2 * k2)
        t1 = np.arctan2(np.cross(z, q) @ w1, np.einsum("ni,ni->n", z, q) - k1 * k1)
        joints[branch][:, chain.rotary] = np.stack([t1, t2], axis=1) * chain.sign
        still = np.zeros((len(points), 5))
        still[:, chain.rotary] = joints[branch][:, chain.rotary]
        offset, _ = plain_forward(machine, still)
        columns = chain.jacobian(still)[:, :3, chain.linear]
        joints[branch][:, chain.linear] = np.linalg.solve(columns, (points - offset)[:, :, None])[:, :, 0]
    return joints


def platter(reach: float | None) -> MachineProfile:
    """Tilt, then platter; the platter turns for ever or `reach` degrees either way."""
    linear = [
        {"letter": letter, "side": side, "type": "linear", "axis": axis, "min": -300, "max": 300}
        for letter, side, axis in (("X", "tool", [1, 0, 0]), ("Z", "tool", [0, 0, 1]), ("Y", "work", [0, -1, 0]))
    ]
    tilt = {"letter": "A", "axis": [0, 1, 0], "point": [0, 0, -30], "min": -200, "max": 200}
    turn = {"letter": "B", "axis": [0, 0, 1], "point": [0, 0, 0]}
    if reach is not None:
        turn |= {"min": -reach, "max": reach}
    rotary = [{**table, "side": "work", "type": "rotary"} for table in (tilt, turn)]
    return built([*linear, *rotary], [0, 0, 0], [0, 0, 1])


def anything(rng: np.random.Generator) -> MachineProfile:
    """Three linear and two rotary joints in any order, on any side, in general position."""
    joints: list[dict[str, Any]] = []
    for letter, kind in zip("XYZAB", rng.permutation(["linear"] * 3 + ["rotary"] * 2), strict=True):
        joint = {"letter": letter, "side": str(rng.choice(["tool", "work"])), "axis": rng.normal(size=3).tolist()}
        limits = {"min": -1e6, "max": 1e6} if kind == "linear" else {"point": rng.uniform(-100, 100, 3).tolist()}
        joints.append({**joint, "type": str(kind), **limits})
    return built(joints, rng.uniform(-100, 100, 3).tolist(), rng.normal(size=3).tolist())


def built(joints: list[dict[str, Any]], tip: list[float], axis: list[float]) -> MachineProfile:
    data = {
        "machine": {"name": "bench", "firmware": "marlin"},
        "joint": [{"speed": 200, "acceleration": 1000, **joint} for joint in joints],
        "tool": {"tip": tip, "axis": axis},
        "work": {"bed": {"shape": "circle", "diameter": 200, "height": 100}},
    }
    return profile_from_file(ProfileFile.model_validate(data), "bench")


if __name__ == "__main__":
    main()
