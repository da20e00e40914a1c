"""The published table of faults is what happens, no row of it is wrong, and a run can be had again byte for byte."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from trunnion_sim.firmware.faults import KINDS

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def bench(load_bench: Callable[[str], ModuleType]) -> ModuleType:
    return load_bench("faults")


def test_the_published_table_is_what_happens(bench: ModuleType) -> None:
    assert bench.table() == (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", KINDS)
def test_every_fault_ends_exactly_or_with_its_reason(bench: ModuleType, kind: str) -> None:
    once = bench.single(kind)
    if kind in bench.STOPS:
        assert once.verdict == "stopped"
        assert once.reason
    elif kind in bench.WARNED:
        assert once.verdict == "moved elsewhere"
        assert len(once.warnings) == 1
    else:
        assert once.verdict == "exact"
    again = bench.repeated(kind)
    assert again is None or again.verdict == "exact"


def test_a_host_that_was_suspended_goes_on_exactly(bench: ModuleType) -> None:
    assert bench.run([], sleep=60.0).verdict == "exact"


def test_the_same_seed_is_the_same_print_byte_for_byte(bench: ModuleType) -> None:
    faults = ["flip-up:p=0.03", "flip-down:p=0.03", "lose-ok:p=0.02", "noise-up:p=0.02", "resend-old:p=0.02"]
    heat = ["M104 S210", "M155 S1", *bench.PROGRAM]
    one, two, other = (bench.run(faults, heat, seed=seed) for seed in (5, 5, 6))
    assert one.verdict == other.verdict == "exact"
    assert one.talk == two.talk
    assert one.seconds == two.seconds
    assert one.talk != other.talk
