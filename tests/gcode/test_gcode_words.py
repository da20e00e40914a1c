"""Numbers become words that read back exactly, in any size, without exponents."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trunnion_core.errors import GcodeError
from trunnion_gcode.words import carried_ticks, from_ticks, number, significant, ticks, words

WORD = re.compile(r"^[A-Z](0|-?(0\.\d*[1-9]|[1-9]\d*(\.\d*[1-9])?))$")
amounts = st.lists(st.floats(-9e5, 9e5), min_size=1, max_size=30)


@given(values=amounts, decimals=st.integers(0, 6))
def test_words_are_fixed_point_and_read_back_within_half_a_digit(values: list[float], decimals: int) -> None:
    for value, word in zip(values, words("X", ticks("X", np.array(values), decimals), decimals), strict=True):
        assert WORD.match(word), word
        assert abs(float(word[1:]) - value) <= 0.5 * 10.0**-decimals * (1 + 1e-9) + abs(value) * 1e-15


@pytest.mark.parametrize("value", [-0.0, -1e-9, 1e-9, -0.00004])
def test_what_rounds_to_zero_is_a_bare_zero(value: float) -> None:
    assert words("E", ticks("E", np.array([value]), 4), 4) == ["E0"]


@pytest.mark.parametrize(("value", "text"), [(100.0, "100"), (1000.5, "1000.5"), (-20.0, "-20"), (0.00001, "0.00001")])
def test_zeros_before_the_point_stay(value: float, text: str) -> None:
    assert number("value", value, 5) == text


@given(values=st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=200))
def test_carried_rounding_never_drifts(values: list[float]) -> None:
    written = np.cumsum(from_ticks(carried_ticks("E", np.array(values), 3), 3))
    assert np.abs(written - np.cumsum(values)).max() <= 0.5e-3 + 1e-9


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e12])
def test_numbers_that_are_none_are_refused_with_their_row(wrong: float) -> None:
    with pytest.raises(GcodeError, match=r"row 1: X is .* finite"):
        ticks("X", np.array([0.0, wrong]), 3)


@given(values=st.lists(st.floats(0.05, 1e5), min_size=1, max_size=30))
def test_significant_digits_hold_at_every_size(values: list[float]) -> None:
    texts, read_back = significant("F", np.array(values))
    for value, text, back in zip(values, texts, read_back.tolist(), strict=True):
        assert float(text) == pytest.approx(back, rel=1e-12)
        assert abs(float(text) - value) <= 5e-4 * value
        assert "e" not in text


def test_a_feed_of_nothing_is_refused() -> None:
    with pytest.raises(GcodeError, match="row 1: F is 0"):
        significant("F", np.array([1.0, 0.0]))
