"""Valves that the controller moves: the engine at the tables' figures, edges where they belong."""

import numpy as np
import pytest
from valve_rig import ValveRun

from hil.log import topics

TABLE_3_3_MM = {
    ("exhaust", True): 23.0, ("exhaust", False): 31.0,
    ("intake", True): 28.0, ("intake", False): 34.0,
}  # fmt: skip
SOLENOID = {"kind": "solenoid"}
NO_FAULTS = {"disturbance"}


@pytest.fixture(scope="module")
def two_stroke():
    return ValveRun("two-stroke", 1.2, valves=SOLENOID)


def test_two_stroke_valves_move_where_table_3_3_has_them(two_stroke):
    """In the mean within 0.1 mm; 0.03 ms of an actuator at 3 m/s scatter by 0.09 mm alone."""
    gaps = two_stroke.gaps_mm(0.4)
    assert len(gaps) == 8
    for (name, is_open), found in gaps.items():
        assert len(found) > 20
        assert np.mean(found) == pytest.approx(
            TABLE_3_3_MM[name.partition("_")[0], is_open], abs=0.1
        ), (name, is_open)


def test_the_engine_runs_on_them_as_on_its_own_programme(two_stroke):
    assert not two_stroke.events
    assert two_stroke.mode == "generating"
    reached = [abs(dc.x_m) for dc in two_stroke.dead_centres[10:]]
    assert np.mean(reached) == pytest.approx(two_stroke.scenario.controller.tdc_ref_m, abs=0.1e-3)
    assert two_stroke.most_frames <= 2  # beside four fixed ones: six frames a tick


def test_each_move_is_logged_with_where_the_piston_was(two_stroke):
    """Records of /valve: a message's payload stands behind 31 bytes of MCAP and 4 of CDR."""
    size = len(topics.VALVE.pack(0, 0, 4, 1, 0.0))
    records = [two_stroke.logged[i : i + size] for i in range(0, len(two_stroke.logged), size)]
    rows = [topics.VALVE.layout.unpack(record[35:]) for record in records]
    assert len(rows) == len(two_stroke.moves)
    for (_, t_ns, channel, is_open, gap_m), move in zip(rows, two_stroke.moves, strict=True):
        x = two_stroke.position_m(move.t_ns)
        gap = 20e-3 + x if move.line < 2 else 20e-3 - x
        assert (t_ns, channel - 4, is_open) == (move.t_ns, move.line, int(move.is_open))
        assert gap_m == pytest.approx(gap, abs=2e-5)


def test_delays_are_learnt_from_the_position_switches():
    """Nothing is known of the actuators at first: the first edges are late, the later ones not."""
    knowledge = {"opening_delay_s": 0.4e-3, "closing_delay_s": 0.4e-3}
    valves = {"opening_delay_s": 0.8e-3, "closing_delay_s": 0.6e-3}
    run = ValveRun(
        "two-stroke", 0.5, valves=valves,
        controller={"name": "open-loop", "timing": {"valves": "controller"}, "valves": knowledge},
    )  # fmt: skip
    assert [round(edge.delay_ns) for edge in run.learnt] == [800_000, 600_000] * 4
    for (name, is_open), found in run.gaps_mm(0.3).items():
        expected = TABLE_3_3_MM[name.partition("_")[0], is_open]
        assert np.mean(found) == pytest.approx(expected, abs=0.1)


def test_four_stroke_valves_move_at_the_dead_centres_of_table_3_1():
    """Pneumatic, pulses of more than 65.5 ms, three edges at one dead centre."""
    run = ValveRun("four-stroke", 1.0, valves={"kind": "pneumatic"})
    assert not run.events
    assert run.mode == "generating"
    reached = np.array([dc.x_m for dc in run.dead_centres[1:]])
    ends = np.array([-17.43, 19.08, -17.49, 17.48]) * 1e-3  # of strokes 4, 1, 2 and 3
    assert np.max(np.abs(reached - np.resize(ends, len(reached)))) < 0.15e-3
    for found in run.gaps_mm(0.3).values():
        assert np.ptp(found) < 1.0


@pytest.mark.parametrize("load", [0.85, 1.15])
def test_a_load_step_is_survived(load):
    event = {"kind": "load-scale", "value": load, "at_s": 0.3, "at_stroke_fraction": 0.25}
    run = ValveRun("two-stroke", 0.8, valves=SOLENOID, name="cascade", events={"load": event})
    assert {e.code for e in run.events} <= NO_FAULTS
    errors = [abs(dc.x_m) - run.scenario.controller.tdc_ref_m for dc in run.dead_centres[-8:]]
    assert np.max(np.abs(errors)) < 0.25e-3


def test_nine_lost_ticks_in_a_row_are_survived():
    """What was ordered before them holds: openings a stroke ahead, each with its closing."""
    run = ValveRun("two-stroke", 0.7, valves=SOLENOID, name="cascade", lost=range(300, 309))
    assert {e.code for e in run.events} <= {"misfire"}
    assert run.mode == "generating"
    assert np.mean(np.abs([dc.x_m for dc in run.dead_centres[-6:]])) == pytest.approx(
        run.scenario.controller.tdc_ref_m, abs=0.4e-3
    )
