"""Rounding by the format of a double: what `round` gives, and nothing else."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.rounding import nearest


@given(
    st.one_of(st.floats(-(2.0**53), 2.0**53), st.integers(-(2**50), 2**50).map(lambda n: n + 0.5))
)
def test_it_rounds_half_to_even_like_round(x):
    assert nearest(x) == round(x)


@pytest.mark.parametrize(("x", "error"), [(math.nan, ValueError), (math.inf, OverflowError)])
def test_what_is_no_number_is_refused_like_by_round(x, error):
    with pytest.raises(error):
        nearest(x)
