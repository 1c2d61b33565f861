"""Arrays reach a page as they are, to a step that no plot shows, in few bytes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from web_sheets import unpacked

from bench.web.columns import TIME_STEP_S, Columns

NUMBERS = st.floats(-1e9, 1e9) | st.just(float("nan"))


@given(st.lists(NUMBERS, max_size=50))
def test_a_column_comes_back_to_a_fifty_thousandth_of_its_range(values):
    columns = Columns()
    number = columns.add(values)
    back = unpacked(columns.packed(), number)
    span = np.ptp(np.array(values)[np.isfinite(values)]) if np.isfinite(values).any() else 0.0
    assert np.array_equal(np.isnan(back), np.isnan(values))
    assert np.nan_to_num(back) == pytest.approx(np.nan_to_num(values), abs=span / 50_000 + 1e-6)


def test_columns_of_one_page_do_not_mix():
    columns = Columns()
    numbers = [columns.add([1.0, 2.5, float("nan")]), columns.add([]), columns.add([7.0, -7.0])]
    packed = columns.packed()
    assert numbers == [0, 1, 2]
    assert unpacked(packed, 2) == pytest.approx([7.0, -7.0], abs=1e-3)
    assert len(unpacked(packed, 1)) == 0


def test_an_array_that_several_plots_show_is_kept_once():
    columns = Columns()
    t_s = np.arange(1000) * 1e-3
    assert columns.add(t_s, TIME_STEP_S) == columns.add(t_s.copy(), TIME_STEP_S)
    assert len(columns.packed()["columns"]) == 1


def test_times_of_a_long_run_stay_exact_to_a_microsecond():
    t_s = np.array([0.0, 1234.567891, 1999.999999])
    columns = Columns()
    columns.add(t_s, TIME_STEP_S)
    assert unpacked(columns.packed(), 0) == pytest.approx(t_s, abs=1e-6)


def test_a_day_is_still_told_to_a_fraction_of_a_millisecond():
    columns = Columns()
    columns.add([0.0, 86_400.0, 43_200.123456], TIME_STEP_S)
    assert unpacked(columns.packed(), 0)[2] == pytest.approx(43_200.123456, abs=1e-4)
