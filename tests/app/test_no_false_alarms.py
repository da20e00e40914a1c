"""A part of `bench/false_alarms.py` that is quick: a planar sample has no finding in several dialects."""

from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.mark.parametrize(
    ("machine", "name", "firmwares"),
    [
        ("generic_3axis", "rib", ("klipper", "marlin")),
    ],
)
def test_samples_have_no_finding(
    load_bench: Callable[[str], ModuleType], machine: str, name: str, firmwares: tuple[str, ...]
) -> None:
    bench = load_bench("false_alarms")
    found = {firmware: report.counts for firmware, report in bench.reports(machine, name, firmwares)}
    assert found == {firmware: {} for firmware in firmwares}
