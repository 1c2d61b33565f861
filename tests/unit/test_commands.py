"""Operator commands from outside: accepted as they are meant, or refused in one line."""

import json

import pytest

from controller.commands import OperatorCommand, parse
from hil.errors import ConfigError


@pytest.mark.parametrize(
    ("fields", "command"),
    [
        ({"kind": "start"}, OperatorCommand("start", origin="me")),
        ({"kind": "stop"}, OperatorCommand("stop", origin="me")),
        (
            {"kind": "set-point", "tdc_ref_m": 0.015},
            OperatorCommand("set-point", tdc_ref_m=0.015, origin="me"),
        ),
        (
            {"kind": "set-point", "target_power_w": 0, "tdc_ref_m": 0.001},
            OperatorCommand("set-point", tdc_ref_m=0.001, target_power_w=0.0, origin="me"),
        ),
        (
            {"kind": "set-point", "target_power_w": 3000, "tdc_ref_m": None},
            OperatorCommand("set-point", target_power_w=3000.0, origin="me"),
        ),
    ],
)
def test_command_is_read_with_its_origin(fields, command):
    assert parse(json.dumps(fields).encode(), "me") == command


@pytest.mark.parametrize(
    ("raw", "text"),
    [
        (b"", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"{", "not JSON"),
        (b"[" * 4096, "not JSON"),
        (b'{"a":' * 800, "not JSON"),
        (b"null", "kind must be one of start, stop, set-point"),
        (b"[]", "kind must be one of start, stop, set-point"),
        (b"{}", "kind must be one of start, stop, set-point"),
        (b'{"kind": "explode"}', "kind must be one of"),
        (b'{"kind": ["start"]}', "kind must be one of"),
        (b'{"kind": "start", "x": 1}', "unknown key 'x'; accepted: kind, "),
        (b'{"kind": "start", "tdc_ref_m": 0.015}', "belong to set-point, and only there"),
        (b'{"kind": "set-point"}', "belong to set-point, and only there"),
        (b'{"kind": "set-point", "tdc_ref_m": 0.06}', "tdc_ref_m = 0.06; accepted: 0.001 to 0.05"),
        (b'{"kind": "set-point", "tdc_ref_m": NaN}', "tdc_ref_m = nan; accepted"),
        (b'{"kind": "set-point", "tdc_ref_m": 1e999}', "tdc_ref_m = inf; accepted"),
        (b'{"kind": "set-point", "tdc_ref_m": true}', "tdc_ref_m = True; accepted"),
        (b'{"kind": "set-point", "tdc_ref_m": "0.015"}', "tdc_ref_m = '0.015'; accepted"),
        (b'{"kind": "set-point", "target_power_w": -1}', "target_power_w = -1; accepted: 0 to"),
        (b'{"kind": "set-point", "target_power_w": {}}', "target_power_w = {}; accepted: 0 to"),
    ],
)
def test_what_is_no_command_is_refused_in_one_line_with_its_origin(raw, text):
    with pytest.raises(ConfigError) as caught:
        parse(raw, "somebody")
    line = str(caught.value)
    assert line.startswith("command from somebody: ")
    assert text in line
    assert "\n" not in line
