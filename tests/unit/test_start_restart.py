"""The mode table, row by row."""

from itertools import product

import pytest

from controller.mode.start_restart import RULES, Facts, Mode, Rule, next_mode
from controller.observe.plausibility import NAMES
from hil.values import fields_of, replace

OFF, MOTORING, GENERATING, STOPPING, SAFE = Mode

_ACTIVE = {MOTORING, GENERATING}

ROWS = [
    ("emergency stop", {OFF, MOTORING, GENERATING, STOPPING}, {"emergency": True}, SAFE),
    *((name, _ACTIVE, {"fault": number}, SAFE) for number, name in enumerate(NAMES) if number),
    ("sample lost", {MOTORING, GENERATING, STOPPING}, {"sample_stale": True}, SAFE),
    ("plant does not hear", {MOTORING, GENERATING, STOPPING}, {"unheard": True}, SAFE),
    ("piston beyond its limit", {MOTORING, GENERATING}, {"beyond_limit": True}, SAFE),
    ("too many misfires", {MOTORING, GENERATING}, {"misfires_exhausted": True}, SAFE),
    ("left cylinder does not fire", _ACTIVE, {"left_dead": True}, SAFE),
    ("right cylinder does not fire", _ACTIVE, {"right_dead": True}, SAFE),
    ("motoring did not reach the amplitude", {MOTORING}, {"motoring_too_long": True}, SAFE),
    ("stop requested", {MOTORING, GENERATING}, {"stop_requested": True}, STOPPING),
    ("piston at rest", {STOPPING}, {"at_rest": True}, OFF),
    ("start requested", {OFF, SAFE, STOPPING}, {"start_requested": True}, MOTORING),
    ("first combustion", {MOTORING}, {"fired": True}, GENERATING),
    ("misfire", {GENERATING}, {"misfired": True}, MOTORING),
]


@pytest.mark.parametrize(("name", "sources", "facts", "target"), ROWS, ids=[r[0] for r in ROWS])
def test_row_leads_from_its_modes_and_from_no_other(name, sources, facts, target):
    for mode in Mode:
        expected = (target, name) if mode in sources else (mode, "")
        assert next_mode(mode, Facts(**facts)) == expected


def test_the_rows_above_are_the_whole_table():
    assert [rule.name for rule in RULES] == [row[0] for row in ROWS]
    assert all(isinstance(rule, Rule) for rule in RULES)


@pytest.mark.parametrize("mode", Mode)
def test_nothing_happens_without_a_reason(mode):
    assert next_mode(mode, Facts()) == (mode, "")


def test_every_mode_can_be_reached_from_off():
    reached = {OFF}
    for _ in Mode:
        reached |= {rule.target for rule in RULES if rule.sources & reached}
    assert reached == set(Mode)


def test_safe_state_is_left_by_a_start_request_with_fresh_samples_and_by_nothing_else():
    names = [name for name in fields_of(Facts) if name not in {"fault", "left_dead", "right_dead"}]
    for values in product((False, True), repeat=len(names)):
        facts = Facts(**dict(zip(names, values, strict=True)))
        mode, rule = next_mode(SAFE, facts)
        if facts.start_requested and not facts.sample_stale:
            assert (mode, rule) == (MOTORING, "start requested")
        else:
            assert (mode, rule) == (SAFE, "")


@pytest.mark.parametrize("mode", [MOTORING, GENERATING])
@pytest.mark.parametrize(
    "danger",
    [
        {"sample_stale": True},
        {"unheard": True},
        {"fault": 1},
        {"left_dead": True},
        {"beyond_limit": True},
        {"misfires_exhausted": True},
    ],
    ids=lambda danger: next(iter(danger)),
)
def test_danger_comes_before_wishes(mode, danger):
    facts = Facts(start_requested=True, stop_requested=True, fired=True, misfired=True)
    assert next_mode(mode, replace(facts, **danger))[0] is SAFE
