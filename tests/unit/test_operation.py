"""What the mode table looks at, from bounds and motion."""

import pytest

from controller.mode.operation import Bounds, Operation
from controller.mode.start_restart import Mode

BOUNDS = Bounds(limit_m=0.0195, stale_ticks=10, misfires=3, motoring_ns=5_000_000_000)


@pytest.mark.parametrize(("x", "beyond"), [(0.0195, False), (0.01951, True), (-0.02, True)])
def test_limit_of_the_position_counts_on_both_sides(x, beyond):
    assert BOUNDS.excludes(x) is beyond


@pytest.mark.parametrize("mode", [Mode.SAFE, Mode.OFF, Mode.STOPPING])
def test_where_nothing_fires_no_combustion_is_judged_any_more(mode):
    entered = Operation(Mode.GENERATING, 5, fired_t_ns=70, misfires=2).entered(mode, 80)
    assert (entered.mode, entered.since_t_ns) == (mode, 80)
    assert (entered.fired_t_ns, entered.misfires) == (-1, 0)


def test_generating_begins_with_the_combustion_that_leads_to_it():
    entered = Operation(Mode.MOTORING, 5, fired_t_ns=70, fired_strokes=9).entered(
        Mode.GENERATING, 80
    )
    assert (entered.fired_strokes, entered.fired_t_ns) == (1, 70)
