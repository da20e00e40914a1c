"""A part of `bench/false_alarms.py` that is quick: a planar sample has no finding in several dialects."""

import importlib.util
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "bench" / "false_alarms.py"


@pytest.mark.parametrize(
    ("machine", "name", "firmwares"),
    [
        ("generic_3axis", "rib", ("klipper", "marlin")),
    ],
)
def test_samples_have_no_finding(machine: str, name: str, firmwares: tuple[str, ...]) -> None:
    spec = importlib.util.spec_from_file_location("bench_false_alarms", BENCH)
    assert spec is not None
    assert spec.loader is not None
    bench = importlib.util.module_from_spec(spec)
    sys.modules["bench_false_alarms"] = bench
    spec.loader.exec_module(bench)
    found = {firmware: report.counts for firmware, report in bench.reports(machine, name, firmwares)}
    assert found == {firmware: {} for firmware in firmwares}
