"""A slow second road to collisions, and random scenes for both: poses close together, and points all over every solid.

Shares nothing with `trunnion_sim.collision` but the heights of what is printed and the amount that a nozzle may press.
"""

import math
import tomllib
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from trunnion_core.profile import MachineProfile, profile_from_file, shipped_profiles
from trunnion_core.profile_file import ProfileFile
from trunnion_core.solid_tables import BoxTable, SolidTable
from trunnion_sim.chain import forward, joint_matrices
from trunnion_sim.collision.field import CELL, PRESS, empty_field
from trunnion_sim.collision.material import raise_bead
from trunnion_sim.collision.scene import PART, make_scene
from trunnion_sim.collision.sweep import Hits, sweep

NOZZLE = {"shape": "cone", "name": "nozzle", "bottom": 0, "top": 6, "bottom_diameter": 0.8, "top_diameter": 7}
BLOCK = {"shape": "box", "name": "block", "min": [-10, -8, 6], "max": [10, 8, 16]}
ARM = 60.0
"""mm from any rotary axis: nothing in a random scene is farther."""


def machine(
    *tool: dict[str, object],
    clamps: tuple[dict[str, object], ...] = (),
    bodies: tuple[dict[str, object], ...] = (),
    shipped: str = "generic_ab_cradle",
) -> MachineProfile:
    """A shipped machine's joints with other bodies and a small bed."""
    data = tomllib.loads(shipped_profiles()[shipped].read_text())
    data["tool"]["body"] = list(tool)
    data["body"] = list(bodies)
    data["work"]["body"] = list(clamps)
    data["work"]["bed"] = {"shape": "rectangle", "min": [-16, -16], "max": [16, 16], "height": 100, "thickness": 3}
    data["work"]["origin"] = [0, 0, 0]
    return profile_from_file(ProfileFile.model_validate(data), "test")


@dataclass(frozen=True)
class Motion:
    """Joints (n, k), and what the row that ends there lays down: width and height (n,) mm, 0 in mid-air."""

    joints: np.ndarray
    width: np.ndarray
    height: float = 0.3
    blind: int = 0
    """Rows at the start that only lay material down and are not looked at."""


def run(profile: MachineProfile, motion: Motion) -> Hits:
    """What the sweep finds."""
    points, axes = forward(profile, motion.joints)
    n = len(motion.joints)
    checked = np.arange(n) >= motion.blind
    height = np.full(n, motion.height)
    return sweep(make_scene(profile), motion.joints, points, axes, motion.width, height, checked)


def names_hit(profile: MachineProfile, motion: Motion) -> dict[tuple[int, frozenset[str]], float]:
    """Depth in mm of every row and pair of names that the sweep finds."""
    hits, names = run(profile, motion), make_scene(profile).names
    found = zip(hits.rows.tolist(), hits.body.tolist(), hits.other.tolist(), hits.depth.tolist(), strict=True)
    return {(row, frozenset((names[a], names[b]))): depth for row, a, b, depth in found}


def signed(solid: SolidTable, points: np.ndarray) -> np.ndarray:
    """Signed distance: to the faces of a box, to the revolved outline as a polygon in 2D by the crossing rule."""
    if isinstance(solid, BoxTable):
        low, high = np.array(solid.min), np.array(solid.max)
        outside = np.maximum(np.maximum(low - points, points - high), 0)
        depth = np.minimum(points - low, high - points).min(axis=1)
        return np.where(depth > 0, -depth, np.linalg.norm(outside, axis=1))
    rho = np.hypot(points[:, 0] - solid.center[0], points[:, 1] - solid.center[1])
    r0, r1 = _radii(solid)
    outline = np.array([[-r0, solid.bottom], [r0, solid.bottom], [r1, solid.top], [-r1, solid.top]])
    p = np.column_stack([rho, points[:, 2]])
    distance = np.full(len(p), np.inf)
    inside = np.ones(len(p), dtype=bool)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        edge = b - a
        if not edge.any():
            continue
        t = np.clip((p - a) @ edge / (edge @ edge), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(p - a - t[:, None] * edge, axis=1))
        inside &= edge[0] * (p[:, 1] - a[1]) - edge[1] * (p[:, 0] - a[0]) >= 0
    return np.where(inside, -distance, distance)


def spread(solid: SolidTable, apart: float) -> np.ndarray:
    """Points at most `apart` from each other along and across, all over the surface."""
    if isinstance(solid, BoxTable):
        ticks = [np.linspace(a, b, 1 + math.ceil((b - a) / apart)) for a, b in zip(solid.min, solid.max, strict=True)]
        faces = []
        for axis in range(3):
            for end in (ticks[axis][0], ticks[axis][-1]):
                grid = np.meshgrid(*(ticks[k] if k != axis else [end] for k in range(3)), indexing="ij")
                faces.append(np.stack([part.ravel() for part in grid], axis=1))
        return np.concatenate(faces)
    r0, r1 = _radii(solid)
    long = math.hypot(r1 - r0, solid.top - solid.bottom)
    up = np.linspace(0, 1, 1 + math.ceil(long / apart))
    rings = [(r0 + t * (r1 - r0), solid.bottom + t * (solid.top - solid.bottom)) for t in up]
    rings += [(r, z) for end, z in ((r0, solid.bottom), (r1, solid.top)) for r in np.arange(0, end, apart)]
    points = []
    for radius, z in rings:
        angle = np.linspace(0, 2 * np.pi, 1 + math.ceil(2 * np.pi * radius / apart), endpoint=False)
        x, y = solid.center[0] + radius * np.cos(angle), solid.center[1] + radius * np.sin(angle)
        points.append(np.column_stack([x, y, np.full(len(angle), z)]))
    return np.concatenate(points)


class Oracle:
    """The bodies of a machine and what is printed on it, as points."""

    def __init__(self, profile: MachineProfile, motion: Motion, apart: float) -> None:
        self.profile, self.motion = profile, motion
        letters = [joint.letter for joint in profile.joints]
        work = [joint.side == "work" for joint in profile.joints]
        at = _shifted(profile.origin)
        self.solids: list[tuple[str, SolidTable, np.ndarray, list[bool]]] = []
        self.solids += [(s.name, s, _shifted(profile.tip), [not w for w in work]) for s in profile.tool_bodies]
        for body in profile.bodies:
            last = letters.index(body.carried_by) if body.carried_by != "frame" else -1
            carried = [j <= last and work[j] == work[last] for j in range(len(letters))]
            self.solids.append((body.solid.name, body.solid, np.eye(4), carried))
        self.solids += [(s.name, s, at, work) for s in profile.work_bodies]
        bed = profile.bed
        plate = BoxTable(shape="box", name="bed", min=(*bed.min, -bed.thickness), max=(*bed.max, 0))
        lower = BoxTable(shape="box", name="bed", min=(*bed.min, -bed.thickness - PRESS), max=(*bed.max, -PRESS))
        self.solids += [("bed", plate, at, work), ("bed", lower, at, work)]
        points = [spread(entry[1], apart) for entry in self.solids]
        self.trees = [cKDTree(cloud) for cloud in points]
        self.columns = self._columns()
        self.part = cKDTree(self.columns) if len(self.columns) else None

    def worst(self, step: float) -> dict[tuple[int, frozenset[str]], float]:
        """Smallest signed distance in mm of every row and pair of names, where it is below 1; poses `step` apart."""
        least: dict[tuple[int, frozenset[str]], float] = {}
        joints = self.motion.joints
        rotary = [joint.rotary for joint in self.profile.joints]
        for row in range(max(self.motion.blind, 1), len(joints)):
            change = np.abs(joints[row] - joints[row - 1])
            far = np.linalg.norm(change[np.logical_not(rotary)]) + ARM * change[rotary].sum()
            share = np.linspace(0, 1, 2 + int(far / step))[:, None]
            poses = joints[row - 1] + share * (joints[row] - joints[row - 1])
            steps = [joint_matrices(joint, poses[:, j]) for j, joint in enumerate(self.profile.joints)]
            placed = [_product(steps, entry[3]) @ entry[2] for entry in self.solids]
            part = placed[-1]
            for a in range(len(self.solids)):
                for b in range(a + 1, len(self.solids)):
                    if self._against(a, b):
                        key = row, frozenset((self.solids[a][0], self.solids[b][0]))
                        deep = min(self._nearest(a, b, placed), self._nearest(b, a, placed))
                        least[key] = min(least.get(key, 1.0), deep)
                if self.part is not None and self.solids[a][3] != self.solids[-1][3]:
                    least[row, frozenset((self.solids[a][0], PART))] = self._nearest_printed(a, placed[a], part)
        return {key: value for key, value in least.items() if value < 1.0}

    def _against(self, a: int, b: int) -> bool:
        excused = {frozenset((body.solid.name, name)) for body in self.profile.bodies for name in body.touches}
        if frozenset((self.solids[a][0], self.solids[b][0])) in excused:
            return False
        presses = a < len(self.profile.tool_bodies) and getattr(self.solids[a][1], "bottom", 1.0) < PRESS
        plates = len(self.solids) - 2, len(self.solids) - 1
        return self.solids[a][3] != self.solids[b][3] and b != plates[0 if presses else 1]

    def _nearest(self, a: int, b: int, placed: list[np.ndarray]) -> float:
        """Signed distance of b's points from solid a over all poses; 1 where none comes near."""
        solid, tree = self.solids[a][1], self.trees[b]
        middle, radius = _ball(solid)
        best = 1.0
        for from_a, from_b in zip(placed[a], placed[b], strict=True):
            b_from_a = np.linalg.inv(from_b) @ from_a
            near = tree.query_ball_point(b_from_a[:3, :3] @ middle + b_from_a[:3, 3], radius + 0.3)
            if near:
                local = (tree.data[near] - b_from_a[:3, 3]) @ b_from_a[:3, :3]
                best = min(best, float(signed(solid, local).min()))
        return best

    def _nearest_printed(self, a: int, placed: np.ndarray, part: np.ndarray) -> float:
        solid = self.solids[a][1]
        middle, radius = _ball(solid)
        best = 1.0
        for from_a, from_part in zip(placed, part, strict=True):
            part_from_a = np.linalg.inv(from_part) @ from_a
            near = self.part.query_ball_point(part_from_a[:3, :3] @ middle + part_from_a[:3, 3], radius + 0.3)
            local = (self.columns[near] - part_from_a[:3, 3]) @ part_from_a[:3, :3]
            if a < len(self.profile.tool_bodies):
                local = local[local[:, 2] > PRESS]
            if len(local):
                best = min(best, float(signed(solid, local).min()))
        return best

    def _columns(self) -> np.ndarray:
        """Points of everything printed in the blind rows, on the grid of the sweep."""
        scene = make_scene(self.profile)
        field = empty_field(scene.low, scene.high)
        tips, axes = forward(self.profile, self.motion.joints)
        for row in np.flatnonzero(self.motion.width > 0).tolist():
            raise_bead(field, tips[row - 1], tips[row], axes[row], self.motion.width[row], self.motion.height)
        i, j = np.nonzero(field.cells >= 0)
        tops = field.cells[i, j].astype(float)
        levels = np.arange(0, tops.max(initial=0.0) + CELL, CELL)
        z = np.minimum(levels[None, :], tops[:, None])
        across = field.corner + np.column_stack([i, j]) * CELL
        return np.unique(np.column_stack([np.repeat(across, len(levels), axis=0), z.ravel()]), axis=0)


def _radii(solid: SolidTable) -> tuple[float, float]:
    if solid.shape == "cylinder":
        return solid.diameter / 2, solid.diameter / 2
    return solid.bottom_diameter / 2, solid.top_diameter / 2


def _ball(solid: SolidTable) -> tuple[np.ndarray, float]:
    if isinstance(solid, BoxTable):
        low, high = np.array(solid.min), np.array(solid.max)
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    middle = np.array([*solid.center, (solid.bottom + solid.top) / 2])
    return middle, math.hypot(max(_radii(solid)), (solid.top - solid.bottom) / 2)


def _shifted(by: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


def _product(steps: list[np.ndarray], carried: list[bool]) -> np.ndarray:
    product = np.broadcast_to(np.eye(4), steps[0].shape)
    for step, moves in zip(steps, carried, strict=True):
        if moves:
            product = product @ step
    return product


def box(name: str, low: object, high: object) -> dict[str, object]:
    """A box as a profile writes it."""
    return {"shape": "box", "name": name, "min": [float(x) for x in low], "max": [float(x) for x in high]}


def random_boxes(rng: np.random.Generator, count: int, name: str) -> tuple[dict[str, object], ...]:
    """Boxes that stand on the small bed."""
    low = rng.uniform(-14, 8, (count, 2))
    high = low + rng.uniform(1, 6, (count, 2))
    return tuple(box(name, [*a, 0], [*b, z]) for a, b, z in zip(low, high, rng.uniform(1, 9, count), strict=True))


def towers(rng: np.random.Generator, profile: MachineProfile, count: int) -> Motion:
    """Joints that lay broad beads in mid-air, each a wall as high as it lies, then go up."""
    home = np.zeros((2 * count + 1, len(profile.joints)))
    ends = rng.uniform(-11, 11, (count, 2))
    home_tips, _ = forward(profile, home[:1])
    linear = [j for j, joint in enumerate(profile.joints) if not joint.rotary]
    toward = np.stack(
        [(-1 if profile.joints[j].side == "work" else 1) * profile.joints[j].axis for j in linear], axis=1
    )
    tips = np.repeat(np.column_stack([ends, rng.uniform(1, 9, count)]), 2, axis=0)
    tips[1::2, :2] += rng.uniform(2, 5, (count, 2))
    home[1:, linear] = np.linalg.solve(toward, (tips - home_tips[0]).T).T
    width = np.zeros(len(home))
    width[2::2] = rng.uniform(2, 5, count)
    return Motion(home, width, 0.3, len(home))


def then(motion: Motion, joints: np.ndarray) -> Motion:
    """The same, and after it rows in mid-air that are looked at."""
    joints = np.concatenate([motion.joints, joints])
    width = np.append(motion.width, np.zeros(len(joints) - len(motion.width)))
    return Motion(joints, width, motion.height, motion.blind + 1)


def printed_scene(rng: np.random.Generator, rows: int = 4) -> tuple[MachineProfile, Motion]:
    """A head over walls and clamps: random tilted moves, in mid-air and through things."""
    profile = machine(NOZZLE, BLOCK, clamps=random_boxes(rng, 2, "clamp"))
    moves = [rng.uniform(-12, 12, (rows, 2)), rng.uniform(1, 12, rows), rng.uniform(-0.25, 0.25, (rows, 2))]
    return profile, then(towers(rng, profile, 4), np.column_stack(moves))


def machine_scene(rng: np.random.Generator, kind: int, rows: int = 3) -> tuple[MachineProfile, Motion]:
    """Bodies on every link of four kinds of machine, rotaries turning by up to a radian a row."""
    arm = rng.uniform(14, 20)
    table = box("table", [arm, -6, -9], [arm + 10, 6, rng.uniform(-6, 0)])
    beam = box("beam", [-4, -20, 14], [4, 20, 20])
    post = box("post", [rng.uniform(18, 26), -5, -20], [32, 5, rng.uniform(0, 12)])
    shipped = ("generic_ab_cradle", "open5x_prusa_i3", "open5x_voron0", "rep5x_ender3")[kind % 4]
    carried = {
        "generic_ab_cradle": (("A", table), ("X", beam), ("frame", post)),
        "open5x_prusa_i3": (("A", table), ("X", beam), ("frame", post)),
        "open5x_voron0": (("B", table), ("X", beam), ("frame", post)),
        "rep5x_ender3": (("A", beam), ("Y", table), ("frame", post)),
    }[shipped]
    bodies = tuple({"carried_by": by, "solid": solid, "touches": _resting(by, solid)} for by, solid in carried)
    profile = machine(NOZZLE, BLOCK, clamps=random_boxes(rng, 1, "clamp"), bodies=bodies, shipped=shipped)
    joints = np.zeros((rows + 1, len(profile.joints)))
    for j, joint in enumerate(profile.joints):
        reach = 0.5 if joint.rotary else 14.0
        joints[:, j] = rng.uniform(-reach, reach, rows + 1)
        if not joint.rotary and abs(joint.axis[2]) > 0.5:
            joints[:, j] = (-1 if joint.side == "work" else 1) * joint.axis[2] * rng.uniform(0, 26, rows + 1)
    return profile, then(towers(rng, profile, 2), joints)


def _resting(by: str, solid: dict[str, object]) -> list[str]:
    """The table lies against the bed that turns over it; the beam carries the head."""
    return {"table": ["bed"], "beam": ["block"] if by == "A" else []}.get(str(solid["name"]), [])
