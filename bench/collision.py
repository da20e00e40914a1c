"""Collision of the judge against a dense oracle on 28 scenes: what is missed, what is false, how much faster it is.

    python bench/collision.py

Both are given the same random machines and moves: 14 scenes of a head over printed walls and clamps, and 14 of beams,
tables, posts, clamps, head and part on every link of four kinds of machine, their rotaries turning by up to a radian a
row. The oracle looks at poses 0.05 mm apart and measures points all over every solid (vectorised, with k-d trees).
What it finds inside is an entry; what is farther from its points than they are from each other is free. Times are CPU
seconds of one core. Then segments per second on a print.
"""

import sys
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "sim"))
from collision_oracle import BLOCK, NOZZLE, Motion, Oracle, machine, machine_scene, names_hit, printed_scene, run

SCENES = 14
"""Of each kind."""
STEP, APART = 0.05, 0.3
"""mm between poses and between points of the oracle."""


def main() -> None:
    """Print the tally of each kind of scene, the ratio of times, and the speed on a printed block."""
    for seed in range(4):
        names_hit(*machine_scene(np.random.default_rng(seed), seed))
    print(f"{'scenes':16}{'entries':>8}{'missed':>8}{'false':>8}{'ours s':>9}{'oracle s':>10}{'ratio':>7}")
    counts = [tally(name) for name in ("printed walls", "machine bodies")]
    show("all", np.sum(counts, axis=0))
    lines = [
        [x, y, z, 0.0, 0.0]
        for z in np.arange(0.3, 12, 0.3)
        for k, y in enumerate(np.arange(-10, 10, 0.336))
        for x in (np.linspace(-10, 10, 84) if k % 2 == 0 else np.linspace(10, -10, 84))
    ]
    motion = Motion(np.array(lines), np.full(len(lines), 0.4))
    started = process_time()
    run(machine(NOZZLE, BLOCK), motion)
    taken = process_time() - started
    print(f"a block of {len(lines)} segments: {len(lines) / taken:.0f} segments/s")


def tally(kind: str) -> np.ndarray:
    """Entries, missed, false, our seconds and the oracle's, of all scenes of a kind."""
    total = np.zeros(5)
    for seed in range(SCENES):
        rng = np.random.default_rng(seed)
        profile, motion = printed_scene(rng) if kind == "printed walls" else machine_scene(rng, seed)
        started = process_time()
        found = names_hit(profile, motion)
        ours = process_time() - started
        started = process_time()
        least = Oracle(profile, motion, APART).worst(STEP)
        oracle = process_time() - started
        entered = {key for key, distance in least.items() if distance < 0}
        false = [key for key in found if least.get(key, 1.0) > STEP + APART]
        total += [len(entered), len(entered - set(found)), len(false), ours, oracle]
    show(kind, total)
    return total


def show(name: str, total: np.ndarray) -> None:
    """One row of the table."""
    entries, missed, false, ours, oracle = total
    print(f"{name:16}{entries:8.0f}{missed:8.0f}{false:8.0f}{ours:9.3f}{oracle:10.1f}{oracle / ours:7.0f}", flush=True)


if __name__ == "__main__":
    main()
