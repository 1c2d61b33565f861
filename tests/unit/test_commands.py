"""Commands: the scenario's events and the bytes of the key are the same declarations."""

import ast
import json
import math
import subprocess
import sys

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hil.config.load import build
from hil.errors import ConfigError
from hil.wire import commands
from hil.wire.commands import CONTROLLER, DECLARED, PLANT, OperatorCommand, parse, write
from hil.wire.quantities import Choice, Name, Number

BESIDE = 1e-9
"""Share of a bound by which a value lies beside it."""


def example_of(field):
    if isinstance(field, Name):
        return "pdf"
    return field.names[0] if isinstance(field, Choice) else field.low if field.whole else field.high


def needed(declared):
    """A table that is accepted; of optional fields it holds those without which it says nothing."""
    fields = [f for f in declared.fields if f.default is None and f.name != "until_s"]
    return {"kind": declared.kind, **{field.name: example_of(field) for field in fields}}


def beside(field):
    """Values at, below and above each bound, and of other types: (value, whether accepted)."""
    if isinstance(field, Choice):
        return [*((name, True) for name in field.names), ("nix", False), ("", False), (1, False)]
    if isinstance(field, Name):
        good, bad = ("pdf", "my-law2"), ("", "A", "a" * 41, 1)
        if field.name == "text":
            good, bad = ("pdf", "Lüfter an: 3 °C", "a" * 80), ("", "a\nb", "\x1b[2J", "a" * 81, 1)
        return [*((name, True) for name in good), *((name, False) for name in bad)]
    step = 1 if field.whole else max(abs(field.low), abs(field.high), 1e-3) * BESIDE
    found = [(field.low, True), (field.high, True), (str(field.low), False), (True, False)]
    found += [(field.low - step, False), (field.high + step, False), (math.inf, False)]
    if field.high > field.low:
        found += [(field.low + step, True), (field.high - step, True)]
    if field.whole:
        found += [(field.low + 0.5, False), (float(field.low), True)]
    return [*found, (math.nan, False), ([], False), ({}, False), (10**400, False)]


CASES = [
    pytest.param(declared, field, value, accepted, id=f"{declared.kind}-{field.name}-{value!r:.24}")
    for declared in DECLARED for field in declared.fields for value, accepted in beside(field)
    # an end has also to lie behind the beginning, and a range's ends in their order
    if not (field.name == "until_s" and value == 0.0)
    and not (declared.kind == "efficiency" and field.name in ("low", "high"))
]  # fmt: skip


def from_key(table, to):
    """Whether the key accepts it, and what was said."""
    try:
        return parse(json.dumps(table).encode(), "me", to), ""
    except ConfigError as error:
        return None, str(error)


def from_scenario(table):
    try:
        return build({"events": {"a": {**table, "at_s": 0.0}}}, "file").events["a"].command, ""
    except ConfigError as error:
        return None, str(error)


@pytest.mark.parametrize(("declared", "field", "value", "accepted"), CASES)
def test_scenario_and_key_accept_and_refuse_the_same(declared, field, value, accepted):
    table = {**needed(declared), field.name: value}
    live, live_line = from_key(table, declared.to)
    planned, planned_line = from_scenario(table)
    assert (live is not None, planned is not None) == (accepted, accepted)
    if accepted:
        assert live.fields == planned.fields
        assert type(live.fields[field.name]) is type(planned.fields[field.name])
        return
    said = live_line.removeprefix("command from me: ")
    assert said.startswith(f"{field.name} = ")
    assert said.endswith(f"; accepted: {field.accepted}")
    assert planned_line == f"file: events.a.{said}"


@pytest.mark.parametrize("declared", DECLARED, ids=lambda declared: declared.kind)
def test_a_field_that_is_missing_or_unknown_is_named_by_both(declared):
    for table in (
        {**needed(declared), "x": 1},
        *({k: v for k, v in needed(declared).items() if k != name}
          for name in needed(declared) if name != "kind" and declared.kind != "set-point"),
    ):  # fmt: skip
        live, live_line = from_key(table, declared.to)
        planned, planned_line = from_scenario(table)
        assert (live, planned) == (None, None)
        name = live_line.removeprefix("command from me: ").split()[0]
        assert planned_line.startswith(f"file: events.a.{name} ")


@pytest.mark.parametrize(("low", "high", "accepted"), [(0.0, 0.0, True), (0.5, 1.0, True),
                                                       (0.6, 0.5, False)])  # fmt: skip
def test_a_range_has_its_ends_in_order(low, high, accepted):
    table = {"kind": "efficiency", "low": low, "high": high}
    found = from_key(table, PLANT)[0], from_scenario(table)[0]
    assert [command is not None for command in found] == [accepted] * 2


def test_a_set_point_says_something():
    for table in ({"kind": "set-point"}, {"kind": "set-point", "tdc_ref_m": None}):
        assert from_key(table, CONTROLLER)[1].endswith("needs tdc_ref_m or target_power_w")
        assert from_scenario(table)[1].endswith("needs tdc_ref_m or target_power_w")


def test_what_is_for_the_other_one_is_left_to_it():
    for declared in DECLARED:
        wrong = {**needed(declared), "x": 1}
        other = PLANT if declared.to == CONTROLLER else CONTROLLER
        assert from_key(wrong, other) == (None, "")


def test_the_ranges_of_the_configuration_are_those_of_the_commands():
    for number in (commands.TDC_REF_M, commands.TARGET_POWER_W):
        for value, accepted in ((number.low, True), (number.low - 1e-6, False),
                                (number.high, True), (number.high * 1.001, False)):  # fmt: skip
            tree = leaf = {}
            *path, last = number.parameter.split(".")
            for part in path:
                leaf = leaf.setdefault(part, {})
            leaf[last] = value
            try:
                build(tree, "file")
            except ConfigError:
                assert not accepted
            else:
                assert accepted


# Any command, from its declaration.


def value_of(field):
    if isinstance(field, Name):
        return st.from_regex(r"[a-z][a-z0-9-]{0,39}", fullmatch=True)
    if isinstance(field, Choice):
        return st.sampled_from(field.names)
    if field.whole:
        return st.integers(int(field.low), int(field.high))
    return st.floats(field.low, field.high)


@st.composite
def any_command(draw):
    declared = draw(st.sampled_from(DECLARED))
    fields = {}
    for field in declared.fields:
        if not field.optional or draw(st.booleans()):
            fields[field.name] = draw(value_of(field))
    if declared.kind == "set-point" and not fields:
        fields["tdc_ref_m"] = 0.0155
    if declared.kind == "efficiency":
        fields["low"], fields["high"] = sorted((fields["low"], fields["high"]))
    return OperatorCommand(declared.kind, fields, "me")


@given(any_command())
def test_what_was_written_is_read_back(command):
    assert parse(write(command), "me", command.to) == command
    assert "\n" not in command.describe()


TABLE = st.dictionaries(
    st.sampled_from(["kind", *{f.name for d in DECLARED for f in d.fields}]) | st.text(),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text()
        | st.sampled_from(list(commands.BY_KIND)),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=4,
    ),
)  # fmt: skip


@given(TABLE.map(lambda table: json.dumps(table).encode()) | st.binary())
@example(json.dumps({"kind": "start"}).encode("utf-16"))
@example(b'\xef\xbb\xbf{"kind": "start"}')
@example(b'{"kind": "set-point", "tdc_ref_m": ' + b"9" * 4000 + b"}")
@example(b'{"kind": "set-point", "tdc_ref_m": 1' + b"0" * 400 + b"}")
@example(b'{"kind": "set-point", "tdc_ref_m": ' + b"[" * 2000 + b"]" * 2000 + b"}")
@example(b'{"kind": "set-point", "tdc_ref_m": ' + b"[" * 900 + b"]" * 900 + b"}")
@example(b'{"kind": "set-point", "tdc_ref_m": ' + b'{"a":' * 700 + b"1" + b"}" * 700 + b"}")
@example(b'{"kind": "law", "law": "' + b"x" * 4000 + b'"}')
@example(b'{"kind": "law", "law": "\\ud800"}')
@example(b'{"kind": "start", "\\ud800\\n": 1}')
@example(b'{"kind": "misfire", "count": 1e308}')
@example(b'{"kind": "misfire", "count": NaN}')
@example(b"x" * (1 << 20))
@example(b"[" * (1 << 20))
def test_no_bytes_do_more_than_be_refused_in_one_line(raw):
    for to in (CONTROLLER, PLANT):
        try:
            command = parse(raw, "somebody", to)
        except ConfigError as error:
            line = str(error)
            assert line.startswith("command from somebody: ")
            assert len(line) < 300
            assert line.isprintable()
            line.encode()
        else:
            assert command is None or parse(write(command), "somebody", to) == command


@pytest.mark.parametrize(
    ("raw", "text"),
    [
        (b"", "not JSON"),
        (b"null", "kind must be one of start, stop, set-point"),
        (b"{}", "kind must be one of start, stop, set-point"),
        (b'{"kind": "explode"}', "kind must be one of"),
        (b'{"kind": ["start"]}', "kind must be one of"),
        (b'{"kind": "start", "x": 1}', "x: unknown key; accepted here: kind"),
        (b'{"kind": "set-point", "tdc_ref_m": 0.0005}', "tdc_ref_m = 0.0005; accepted: 0.001 to"),
        (b'{"kind": "law"}', "law is missing; accepted: a name"),
    ],
)
def test_what_is_for_nobody_is_told_once_by_the_controller(raw, text):
    with pytest.raises(ConfigError) as caught:
        parse(raw, "somebody")
    assert str(caught.value).startswith(f"command from somebody: {text}")
    assert parse(raw, "somebody", PLANT) is None


def test_declarations_cost_a_client_nothing():
    """No numpy, no pydantic, nothing of ours but the errors."""
    code = """
import hil, sys
before = set(sys.modules)
import hil.wire.commands, hil.wire.status
print(sorted(set(sys.modules) - before))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = ast.literal_eval(done.stdout)
    assert not {name.partition(".")[0] for name in loaded} & {"numpy", "pydantic", "zenoh", "time"}
    ours = {name for name in loaded if name.startswith("hil.")}
    assert ours <= {"hil.errors", "hil.nearest", "hil.wire", "hil.wire.commands",
                    "hil.wire.quantities", "hil.wire.status"}  # fmt: skip


def test_every_number_has_a_range_and_every_field_a_meaning():
    for declared in DECLARED:
        for field in declared.fields:
            assert field.meaning
            assert not isinstance(field, Number) or field.low <= field.high
