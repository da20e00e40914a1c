import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trunnion_core.errors import UnreachableError
from trunnion_core.profile import load_profile
from trunnion_kinematics.branches import EARLY_COST, EXTRUDING_WEIGHT, REWIND_COST, STRAY, TURNING_WEIGHT, choose
from trunnion_kinematics.chain import JointChain

TURN = 2 * np.pi


def leaning(bearing, lean):
    """Unit tool axes that lean by `lean` towards `bearing`, both rad."""
    bearing, lean = np.broadcast_arrays(np.asarray(bearing, float), np.asarray(lean, float))
    return np.stack([np.sin(lean) * np.cos(bearing), np.sin(lean) * np.sin(bearing), np.cos(lean)], axis=1)


def ring(n, turns, lean_deg=30.0, radius=20.0):
    """A path round the Z axis, `turns` times, with the tool leaning outwards."""
    a = np.linspace(0, TURN * turns, n)
    points = np.stack([radius * np.cos(a), radius * np.sin(a), np.full(n, 10.0)], axis=1)
    return points, leaning(a, np.radians(lean_deg))


def every(n, step):
    return np.arange(n) % step == 0


def assert_valid(chain, machine, choice, points, tool_axes):
    reached, turned = chain.forward(choice.joints)
    assert_allclose(reached, points, rtol=0, atol=1e-9)
    assert_allclose(turned, tool_axes, rtol=0, atol=1e-9)
    assert (choice.joints >= machine.array("min") - 1e-6).all()
    assert (choice.joints <= machine.array("max") + 1e-6).all()


class Exhaustive:
    """Every sequence of states of a short path, priced as the docstring of `branches` says."""

    def __init__(self, chain, machine, points, tool_axes, travel, start, speed=np.inf):
        self.chain, self.machine, self.travel, self.start = chain, machine, travel, start
        self.floor = np.append(0, np.linalg.norm(np.diff(points, axis=0), axis=1)) / speed
        w1, w2 = chain.rotary_axes
        self.sine = np.linalg.norm(np.cross(tool_axes, w1), axis=1)
        self.sine2 = np.linalg.norm(np.cross(w2, chain.tool_axis))
        dots = np.clip((tool_axes[1:] * tool_axes[:-1]).sum(axis=1), -1, 1)
        self.sweep_limit = np.append(0, 3 * np.arccos(dots) + STRAY)
        self.known = {}
        self.states = [self.all_states(points, tool_axes, i) for i in range(len(points))]

    def all_states(self, points, tool_axes, i):
        solutions = list(self.chain.inverse(points[i : i + 1], tool_axes[i : i + 1])[:, 0])
        c1 = self.chain.rotary[0]
        if self.sine[i] < 1e-8:
            before, after = i, i
            while before >= 0 and self.sine[before] < 1e-8:
                before -= 1
            while after < len(points) and self.sine[after] < 1e-8:
                after += 1
            angles = [0.0 if self.start is None else self.start[c1]]
            for there in (before, after):
                if 0 <= there < len(points):
                    angles += list(self.chain.inverse(points[[there]], tool_axes[[there]])[:, 0, c1])
                if there == before:
                    self.known[i] = np.array(angles)
            tilts = [row[self.chain.rotary[1]] for row in solutions]
            pairs = np.array([[angle, tilts[0]] for angle in angles])
            solutions = list(self.chain.at_angles(np.repeat(points[[i]], len(pairs), axis=0), pairs))
        low, high = self.machine.array("min"), self.machine.array("max")
        states = []
        for row in solutions:
            for windings in itertools.product(range(-3, 4), repeat=2):
                state = row.copy()
                state[self.chain.rotary] += TURN * np.array(windings)
                if np.isfinite(state).all() and (state >= low - 1e-9).all() and (state <= high + 1e-9).all():
                    states.append(state)
        return np.array(states)

    def ahead(self, i, state):
        """What it costs to begin a travel i at the pole at an angle that only later rows need."""
        if not (i > 0 and self.travel[i] and i in self.known and i - 1 in self.known):
            return 0
        apart = np.mod(self.known[i] - state[self.chain.rotary[0]] + np.pi, TURN) - np.pi
        return 0 if np.abs(apart).min() < 1e-7 else EARLY_COST

    def step(self, i, before, after):
        """Price of a step and whether it is a jump."""
        move = np.abs(after - before) / self.machine.array("speed")
        turn1, turn2 = np.abs(after - before)[self.chain.rotary]
        sweep = 0.5 * (self.sine[i] + self.sine[i - 1]) * turn1 + self.sine2 * turn2
        jumps = sweep > self.sweep_limit[i]
        price = (
            max(move.max(), self.floor[i]) * (1 if self.travel[i] else EXTRUDING_WEIGHT)
            + TURNING_WEIGHT * move[self.chain.rotary].sum()
        )
        return price + (REWIND_COST if jumps else 0) + self.ahead(i, before), jumps

    def opening(self, state):
        move = np.abs(state - (0 if self.start is None else self.start)) / self.machine.array("speed")
        turning = TURNING_WEIGHT * move[self.chain.rotary].sum()
        return turning + (0 if self.start is None else move.max())

    def prices(self):
        """A table of prices for every step, inf where a step is barred."""
        prices, alive = [], np.ones(len(self.states[0]), dtype=bool)
        for i in range(1, len(self.states)):
            table = [[self.step(i, a, b) for b in self.states[i]] for a in self.states[i - 1]]
            price = np.array([[entry[0] for entry in line] for line in table])
            barred = np.array([[entry[1] for entry in line] for line in table]) & (not self.travel[i])
            barred[~alive] = True
            if barred.all():
                barred[alive] = False
            alive = ~barred.all(axis=0)
            prices.append(np.where(barred, np.inf, price))
        return prices

    def best_by_rows(self):
        """The same by a plain dynamic program, one full table a row, for paths too long for every sequence."""
        value = np.array([self.opening(state) for state in self.states[0]])
        for price in self.prices():
            value = (value[:, None] + price).min(axis=0)
        return value.min()

    def best(self):
        prices = self.prices()
        opening = [self.opening(state) for state in self.states[0]]
        return min(
            opening[path[0]] + sum(prices[i][path[i], path[i + 1]] for i in range(len(prices)))
            for path in itertools.product(*(range(len(states)) for states in self.states))
        )

    def price_of(self, joints):
        return self.opening(joints[0]) + sum(self.step(i, joints[i - 1], joints[i])[0] for i in range(1, len(joints)))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("name", ["cradle", "tilt_then_platter", "yaw_head", "nutating_head", "slanted"])
def test_the_choice_is_as_cheap_as_exhaustive_search(machines, name, seed):
    rng = np.random.default_rng([seed, len(name)])
    machine = machines[name]
    chain = JointChain.from_profile(machine)
    n = 4 if name in ("yaw_head", "nutating_head", "tilt_then_platter") else 5
    points = np.cumsum(rng.normal(0, 2, (n, 3)), axis=0)
    tool_axes = leaning(np.cumsum(rng.normal(1, 1.5, n)), np.abs(rng.normal(0.3, 0.25, n)))
    if seed % 3 == 0:
        tool_axes[rng.integers(0, n)] = [0, 0, 1]
    travel = rng.random(n) < 0.4
    start = None if seed % 2 else rng.normal(0, 0.3, 5)
    search = Exhaustive(chain, machine, points, tool_axes, travel, start)
    choice = choose(chain, machine, points, tool_axes, travel=travel, start=start)
    assert_valid(chain, machine, choice, points, tool_axes)
    assert search.price_of(choice.joints) == pytest.approx(search.best(), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_exhaustive_search_agrees_where_a_narrow_machine_must_rewind(make_profile, joint_tables, seed):
    linear, rotary = joint_tables
    xyz = [linear(a, "tool", v, -300, 300) for a, v in zip("XYZ", np.eye(3).tolist(), strict=True)]
    tables = [rotary("A", "work", [1, 0, 0], [0, 0, -9], 50), rotary("C", "work", [0, 0, 1], [0, 0, 0], 230)]
    machine = make_profile("narrow", [*xyz, *tables])
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(7, 1.6)
    travel = np.random.default_rng(seed).random(7) < 0.25
    choice = choose(chain, machine, points, tool_axes, travel=travel)
    search = Exhaustive(chain, machine, points, tool_axes, travel, None)
    assert_valid(chain, machine, choice, points, tool_axes)
    assert search.price_of(choice.joints) == pytest.approx(search.best(), rel=1e-9)


@pytest.mark.parametrize("speed", [np.inf, 25.0])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["finite_platter", "yaw_head", "tilt_then_platter", "cradle"])
def test_rows_that_glide_cost_what_a_full_table_a_row_says(machines, name, seed, speed):
    """Long paths of planar and leaning stretches, of even and of uneven rows, with few and with many windings."""
    rng = np.random.default_rng([seed, 7])
    machine = machines[name]
    chain = JointChain.from_profile(machine)
    n = 48
    lean = np.repeat(rng.permutation([0.0, 0.5, 0.0, 0.3]), n // 4)
    bearing = np.cumsum(np.repeat(rng.normal(0, 0.6, 4), n // 4) + rng.normal(0, 0.1, n))
    even = seed % 2 == 0
    steps = np.where(even, 0.4, rng.exponential(2, n))[:, None] * leaning(bearing, np.full(n, np.pi / 2))
    points, tool_axes = np.cumsum(steps, axis=0), leaning(bearing, lean)
    travel = every(n, 11)
    start = None if seed < 2 else np.zeros(5)
    speeds = None if np.isinf(speed) else np.full(n, speed)
    choice = choose(chain, machine, points, tool_axes, travel=travel, start=start, speed=speeds)
    assert_valid(chain, machine, choice, points, tool_axes)
    search = Exhaustive(chain, machine, points, tool_axes, travel, start, speed)
    assert search.price_of(choice.joints) == pytest.approx(search.best_by_rows(), rel=1e-9)


def test_all_machines_follow_the_same_path(machine):
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(400, 1.3, lean_deg=25)
    points, tool_axes = np.concatenate([points, points]), np.concatenate([tool_axes, np.tile([0.0, 0, 1], (400, 1))])
    choice = choose(chain, machine, points, tool_axes, travel=every(800, 100))
    assert_valid(chain, machine, choice, points, tool_axes)
    assert choice.forced.size == 0


def test_an_endless_platter_turns_on_over_the_seam(machines):
    machine = machines["tilt_then_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(2000, 10)
    choice = choose(chain, machine, points, tool_axes, travel=every(2000, 2000))
    platter = choice.joints[:, chain.rotary[0]]
    assert choice.rewinds.size == 0
    assert np.ptp(platter) == pytest.approx(10 * TURN, rel=1e-9)
    assert np.abs(np.diff(choice.joints[:, chain.rotary], axis=0)).max() < 0.1


def test_a_finite_platter_uses_all_its_travel_and_rewinds_at_a_travel(machines):
    machine = machines["finite_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(4000, 16)
    choice = choose(chain, machine, points, tool_axes, travel=every(4000, 50))
    assert_valid(chain, machine, choice, points, tool_axes)
    assert len(choice.rewinds) == 2
    assert (choice.rewinds % 50 == 0).all()
    assert choice.forced.size == 0


def test_a_rewind_inside_a_bead_happens_only_when_nothing_else_is_possible_and_is_reported(machines):
    machine = machines["yaw_head"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(1000, 3)
    choice = choose(chain, machine, points, tool_axes, travel=every(1000, 1000))
    assert_valid(chain, machine, choice, points, tool_axes)
    assert len(choice.forced) == 1
    assert choice.forced.tolist() == choice.rewinds.tolist()


def test_start_decides_the_winding(machines):
    machine = machines["finite_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(100, 0.2)
    start = np.zeros(5)
    start[chain.rotary[0]] = 2 * TURN + 0.3
    choice = choose(chain, machine, points, tool_axes, travel=every(100, 100), start=start)
    assert abs(choice.joints[0, chain.rotary[0]] - start[chain.rotary[0]]) < np.pi
    assert_valid(chain, machine, choice, points, tool_axes)


def test_a_start_near_the_end_of_travel_winds_back_before_the_bead(machines):
    machine = machines["finite_platter"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(1000, 4)
    start = np.zeros(5)
    start[chain.rotary[0]] = np.radians(-1190)
    choice = choose(chain, machine, points, tool_axes, travel=every(1000, 1000), start=start)
    assert_valid(chain, machine, choice, points, tool_axes)
    assert choice.rewinds.size == 0


def test_over_planar_layers_the_platter_stands_still_and_turns_in_the_travel_that_follows(machines):
    machine = machines["tilt_then_platter"]
    chain = JointChain.from_profile(machine)
    flat = np.stack([np.linspace(10, 30, 300), np.full(300, 5.0), np.full(300, 3.0)], axis=1)
    bead, axes = ring(300, 0.5)
    bead, axes = bead[::-1], axes[::-1].copy()
    points = np.concatenate([flat, bead])
    tool_axes = np.concatenate([np.tile([0.0, 0, 1], (300, 1)), axes])
    travel = every(600, 100)
    choice = choose(chain, machine, points, tool_axes, travel=travel)
    assert_valid(chain, machine, choice, points, tool_axes)
    platter = choice.joints[:, chain.rotary[0]]
    turning = np.flatnonzero(np.abs(np.diff(platter[:300])) > 1e-12) + 1
    assert travel[turning].all()
    assert len(turning) <= 1
    assert (turning >= 200).all()
    assert choice.rewinds.size == 0
    assert np.abs(np.diff(platter))[~travel[1:]].max() < 0.02


def test_a_wholly_planar_print_leaves_the_rotaries_at_rest(machines):
    for name in ("tilt_then_platter", "yaw_head", "nutating_head", "head_and_table"):
        machine = machines[name]
        chain = JointChain.from_profile(machine)
        rng = np.random.default_rng(1)
        points = rng.uniform(-20, 60, (500, 3))
        choice = choose(chain, machine, points, np.tile([0.0, 0, 1], (500, 1)), travel=every(500, 7))
        assert_allclose(choice.joints[:, chain.rotary], 0, atol=1e-9)


def test_at_the_pole_an_angle_is_found_that_keeps_the_linear_joints_in_reach(make_profile, joint_tables):
    linear, rotary = joint_tables
    bed = [linear("X", "tool", [1, 0, 0], 0, 100), linear("Y", "tool", [0, 1, 0], -20, 20)]
    turns = [rotary("A", "work", [1, 0, 0], [0, 0, 0], 90), rotary("C", "work", [0, 0, 1], [0, 0, 0], None)]
    machine = make_profile("half a bed", [*bed, linear("Z", "tool", [0, 0, 1], 0, 100), *turns])
    chain = JointChain.from_profile(machine)
    bearing = np.radians([200, 205, 210])
    points = np.stack([50 * np.cos(bearing), 50 * np.sin(bearing), np.full(3, 9.0)], axis=1)
    choice = choose(chain, machine, points, np.tile([0.0, 0, 1], (3, 1)), travel=np.ones(3, dtype=bool))
    assert_valid(chain, machine, choice, points, np.tile([0.0, 0, 1], (3, 1)))


def test_an_unreachable_pose_names_row_joint_and_amount(machines):
    machine = machines["cradle"]
    chain = JointChain.from_profile(machine)
    points = np.zeros((4, 3))
    tool_axes = leaning(np.full(4, np.pi / 2), np.radians([0, 30, 71.2, 0]))
    with pytest.raises(UnreachableError, match=r"joint A would need A = 71\.20 degrees, limit 60") as caught:
        choose(chain, machine, points, tool_axes, travel=every(4, 4))
    assert caught.value.row == 2
    assert caught.value.joint == "A"
    assert_allclose(caught.value.tool_axis, tool_axes[2])


def test_a_point_outside_the_travel_names_the_linear_joint(machines):
    machine = machines["cradle"]
    chain = JointChain.from_profile(machine)
    with pytest.raises(UnreachableError, match=r"joint X would need X = 170\.00 mm, limit 160"):
        choose(chain, machine, np.array([[170.0, 0, 0]]), np.array([[0.0, 0, 1]]), travel=np.array([True]))


def test_an_orientation_outside_the_band_names_the_tilting_joint(machines):
    machine = machines["nutating_head"]
    chain = JointChain.from_profile(machine)
    with pytest.raises(UnreachableError, match=r"joint B can bring the tool to 0\.00 to 90\.00 degrees .* 120\.00"):
        choose(chain, machine, np.zeros((1, 3)), leaning([0.0], [np.radians(120)]), travel=np.array([True]))


def test_a_machine_without_rotaries_says_what_it_cannot_do():
    machine = load_profile("generic_3axis")
    chain = JointChain.from_profile(machine)
    flat = choose(chain, machine, np.zeros((1, 3)), np.array([[0.0, 0, 1]]), travel=np.array([True]))
    assert flat.joints.shape == (1, 3)
    with pytest.raises(UnreachableError, match=r"has no rotary joint beside it, and the pose leans 20\.00 degrees"):
        choose(chain, machine, np.zeros((1, 3)), leaning([0.0], [np.radians(20)]), travel=np.array([True]))
    with pytest.raises(UnreachableError, match="joint Z would need Z = 251"):
        choose(chain, machine, np.array([[0.0, 0, 251]]), np.array([[0.0, 0, 1]]), travel=np.array([True]))


def test_an_empty_path_has_no_joints(machine):
    chain = JointChain.from_profile(machine)
    none = choose(chain, machine, np.empty((0, 3)), np.empty((0, 3)), travel=np.empty(0, dtype=bool))
    assert none.joints.shape == (0, 5)


def test_same_input_same_output(machines):
    machine = machines["yaw_head"]
    chain = JointChain.from_profile(machine)
    points, tool_axes = ring(500, 3)
    first, second = (choose(chain, machine, points, tool_axes, travel=every(500, 50)) for _ in range(2))
    assert first.joints.tobytes() == second.joints.tobytes()
