"""What orientation smoothing brings with default settings, measured in final programs."""

from collections.abc import Callable
from types import ModuleType

import pytest

ROWS = (
    ("freeform", "generic_ab_cradle"),
    ("freeform", "open5x_voron0"),
    ("propeller", "generic_ab_cradle"),
    ("propeller", "rep5x_ender3"),
)
"""The tightest of the eight that `bench/smoothing.py` prints, a cradle and a platter or turning head for each part."""


@pytest.fixture(scope="module")
def bench(load_bench: Callable[[str], ModuleType]) -> ModuleType:
    return load_bench("smoothing")


@pytest.mark.parametrize(("name", "machine"), ROWS)
def test_two_degrees_from_the_normals_spare_the_rotaries_a_third(bench: ModuleType, name: str, machine: str) -> None:
    """30 % less time, or less rotary acceleration at the wanted tip speed, of both rotaries."""
    plain, smooth = bench.measured(name, machine, "plain"), bench.measured(name, machine, "smooth")
    assert smooth.off <= 2.0
    assert smooth.meets(plain)
    assert smooth.time < 0.97 * plain.time
