"""Collision of the judge against a dense oracle on 20 scenes: what is missed, and how much faster it is.

    python bench/collision.py

Both are given the same random clamps and random tilted moves. The oracle looks at poses 0.05 mm apart and measures
every sample of everything on the bed near the body (vectorised, with a k-d tree). Then segments per second on a print.
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "sim"))
from test_collision import BLOCK, NOZZLE, dense_oracle, machine, random_clamps, run, upright

SCENES = 20
STEP = 0.05


def main() -> None:
    """Print the tally of the scenes, the ratio of times, and the speed on a printed block."""
    rng = np.random.default_rng(7)
    ours = oracle = 0.0
    missed = false = entries = 0
    run(machine(NOZZLE), upright([[0, 0, 9], [1, 0, 9]]), np.zeros(2))
    for _ in range(SCENES):
        clamps = random_clamps(rng)
        profile = machine(NOZZLE, BLOCK, clamps=clamps)
        joints = np.column_stack([rng.uniform(-12, 12, (5, 2)), rng.uniform(1, 14, 5), rng.uniform(-0.2, 0.2, (5, 2))])
        started = perf_counter()
        hits = run(profile, joints, np.zeros(5))
        ours += perf_counter() - started
        started = perf_counter()
        expected = dense_oracle(profile, joints, STEP)
        oracle += perf_counter() - started
        found = np.zeros(expected.shape, dtype=bool)
        found[hits.rows, hits.body] = True
        entries += int((expected < 0).sum())
        missed += int(((expected < 0) & ~found).sum())
        false += int((found & (expected > STEP)).sum())
    print(f"{SCENES} scenes: {entries} entries, {missed} missed, {false} false; oracle / ours = {oracle / ours:.0f}")
    lines = [
        [x, y, z]
        for z in np.arange(0.3, 12, 0.3)
        for k, y in enumerate(np.arange(-10, 10, 0.336))
        for x in (np.linspace(-10, 10, 84) if k % 2 == 0 else np.linspace(10, -10, 84))
    ]
    width = np.full(len(lines), 0.4)
    started = perf_counter()
    run(machine(NOZZLE, BLOCK), upright(lines), width)
    taken = perf_counter() - started
    print(f"a block of {len(lines)} segments: {len(lines) / taken:.0f} segments/s")


if __name__ == "__main__":
    main()
