"""What is answered to a command, and that nothing of a stranger's reaches a terminal as it is."""

import json

import pytest

from drivers.channels import is_stop, origin_text
from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from hil.wire import answers, commands, status
from hil.wire.answers import CommandAnswer
from plant import faults

ANSWER = CommandAnswer("controller", False, 4711, "tdc_ref_m=0.03 from hil: accepted up to 0.016")
ESCAPES = "\x1b[31mred\x07\r\n\u202e"


def test_an_answer_comes_through():
    assert answers.read(answers.write(ANSWER)) == ANSWER


def test_an_answer_is_never_too_long():
    raw = answers.write(ANSWER._replace(text="\u4e2d" * 10_000, tick=2**63))
    assert len(raw) <= answers.MAX_BYTES
    assert len(json.loads(raw)["text"]) == 500


@pytest.mark.parametrize(
    "raw",
    [
        b"", b"\xff\xfe", b"[]", b"{}", b"[" * 3000, b"x" * 5000,
        b'{"process": "controller", "taken": 1, "tick": 1, "text": ""}',
        b'{"process": "controller", "taken": true, "tick": 1.5, "text": ""}',
        b'{"process": "controller", "taken": true, "tick": 1, "text": "", "more": 1}',
    ],
)  # fmt: skip
def test_what_is_no_answer_is_none(raw):
    assert answers.read(raw) is None


def test_no_escape_of_a_stranger_reaches_a_terminal():
    raw = answers.write(ANSWER._replace(process=ESCAPES, text=ESCAPES))
    answer = answers.read(raw)
    assert answer.text.isprintable()
    assert answer.process.isprintable()
    assert origin_text(ESCAPES.encode()).isprintable()
    told = {"mode": ESCAPES, "reception": {ESCAPES: 1}, "tick": 3}
    assert status.read("controller", status.write(told)) == {"tick": 3}
    with pytest.raises(ConfigError) as refused:
        commands.parse(commands.encode({"kind": "law", "law": ESCAPES, ESCAPES: 1}), "hil")
    assert str(refused.value).isprintable()


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-32", "utf-7"])
def test_a_command_in_another_encoding_is_refused_or_not_ours(encoding):
    raw = '{"kind": "misfire", "count": 2, "cause": "spark"} +'.encode(encoding)
    assert faults.parse(raw, "hil", 0, PlantConfig()) is None
    with pytest.raises(ConfigError, match="command from hil: not JSON in UTF-8"):
        commands.parse(raw, "hil")


@pytest.mark.parametrize(
    ("raw", "stops"),
    [
        (b'{"kind": "stop"}', True), (b' { "kind" : "stop" } ', True),
        (b'{"kind": "start"}', False),
        (b'{"kind": "stop", "more": 1}', False), (b"stop", False), (b'{"kind": "stop"}' * 9, False),
    ],
)  # fmt: skip
def test_a_stop_is_told_from_anything_else(raw, stops):
    assert is_stop(raw) is stops
