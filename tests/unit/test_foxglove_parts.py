"""A server for viewers without viewers: who is let in, what is handed on, what is asked."""

import json
from types import SimpleNamespace

import pytest

pytest.importorskip("foxglove", reason="needs the extra foxglove")

from bench.cli.options import Arguments
from bench.dev.foxglove_layout import text as layout_text
from bench.live.foxglove.channels import Channels
from bench.live.foxglove.gate import Gate, unguessable_host
from bench.live.foxglove.tuning import Tuning
from hil.errors import LinkError
from hil.log import topics
from hil.log.records import CDR_LE, MESSAGE, MESSAGE_HEAD
from hil.wire.answers import CommandAnswer

KP = "controller.cascade.outer.kp"
PAGE = "https://viewer.example"


@pytest.mark.parametrize(
    ("target", "origin", "admitted"),
    [
        ("/", None, True),
        ("/?token=a-token", None, True),
        ("/?token=a-token", PAGE, True),
        ("/anything?x=1&token=a-token", PAGE, True),
        ("/", PAGE, False),
        ("/", "null", False),
        ("/", "", False),
        ("/?token=", PAGE, False),
        ("/?token=another", PAGE, False),
        ("/?token=%C3%A9", PAGE, False),
    ],
)
@pytest.mark.parametrize("name", ["Origin", "origin", "ORIGIN "])
def test_a_page_is_let_in_with_the_token_alone(target, origin, admitted, name):
    heads = ["Host: 127.0.0.1:8765", *([f"{name}: {origin}"] if origin is not None else [])]
    head = "\r\n".join([f"GET {target} HTTP/1.1", *heads, "", ""]).encode()
    assert Gate("a-token", ("127.0.0.1", 1)).admits(head) == admitted


def test_the_server_behind_is_on_this_machine_and_hard_to_guess():
    hosts = {unguessable_host() for _ in range(200)}
    assert len(hosts) > 190
    assert all(h.startswith("127.") and h != "127.0.0.1" for h in hosts)


def record(topic, t_ns, payload):
    body = CDR_LE + payload
    length = MESSAGE_HEAD.size - 9 + len(body)
    return MESSAGE_HEAD.pack(MESSAGE, length, topic.channel_id, 0, t_ns, t_ns) + body


class Channel:
    def __init__(self, wanted):
        self.wanted, self.logged = wanted, []

    def has_sinks(self):
        return self.wanted

    def log(self, payload, log_time):
        self.logged.append((log_time, payload))


def test_what_is_subscribed_to_is_handed_on_byte_for_byte():
    channels = Channels(None)
    sensor, event = Channel(wanted=True), Channel(wanted=False)
    channels._channels = {"/plant/sensor": sensor, "/plant/event": event}
    tap = SimpleNamespace(topics={t.channel_id: t.name for t in topics.ALL})
    data = b"".join([
        record(topics.SENSOR, 1_000, b"first"), record(topics.EVENT, 1_500, b"is not asked for"),
        record(topics.TRUTH, 1_700, b"is not offered"), record(topics.SENSOR, 2_000, b"second"),
    ])  # fmt: skip
    channels.put("plant", tap, data)
    assert sensor.logged == [(1_000, CDR_LE + b"first"), (2_000, CDR_LE + b"second")]
    assert (event.logged, channels.t_ns) == ([], 2_000)


class Operator:
    """An engine with one gain, which takes up to 50."""

    def __init__(self):
        self.value, self.gone = 39.0, False

    def ask_all(self, command, to, timeout_s):
        if self.gone:
            raise LinkError("the controller did not answer")
        if command["kind"] == "get":
            values = {KP: self.value} if to == ("controller",) else {}
            return [CommandAnswer(to[0], True, 7, "", values)]
        taken = command[KP] <= 50.0
        self.value = command[KP] if taken else self.value
        return [CommandAnswer(to[0], taken, 8, "" if taken else "accepted: up to 50")]


@pytest.fixture
def tuning():
    complaints = []
    made = Tuning(Operator(), complaints.append)
    made.complaints = complaints
    return made


def asked(tuning, value):
    from foxglove.websocket import Parameter

    found = tuning.on_set_parameters(None, [Parameter(KP, value=value)])
    return [(each.name, each.get_value()) for each in found]


def test_parameters_are_changed_and_what_is_in_force_is_told(tuning):
    assert [each.name for each in tuning.on_get_parameters(None, [])] == [KP]
    assert asked(tuning, 41.0) == [(KP, 41.0)]
    assert asked(tuning, 99.0) == [(KP, 41.0)]
    assert tuning.complaints == ["controller refused it: accepted: up to 50"]


def test_who_is_gone_has_changed_nothing(tuning):
    tuning.look()
    tuning._operator.gone = True
    assert asked(tuning, 41.0) == [(KP, 39.0)]
    assert tuning.complaints == ["the controller did not answer"]
    assert tuning.look() == {}


def test_only_what_has_changed_is_told_to_who_listens(tuning):
    assert tuning.look() == {KP: 39.0}
    assert tuning.look() == {}
    tuning._operator.value = 40.0
    assert tuning.look() == {KP: 40.0}


def test_the_live_layout_shows_topics_as_they_come_live():
    offered = {f"/{side}{t.name}": t for t in topics.ALL for side in t.sides}
    panels = json.loads(layout_text())["configById"]
    paths = [p["value"] for panel in panels.values() for p in panel.get("paths", [])]
    paths += [panel["topicPath"] for panel in panels.values() if "topicPath" in panel]
    assert len(paths) > 10
    for path in paths:
        topic, _, field = path.partition(".")
        assert not field or field in {f.name for f in offered[topic].layout.fields}


@pytest.mark.parametrize(
    ("given", "read"),
    [
        (["run", "steady", "--panel"], ["run", "steady", "--panel", "0"]),
        (["run", "--panel", "steady"], ["run", "--panel", "0", "steady"]),
        (["run", "steady", "--panel", "--foxglove", "8765"],
         ["run", "steady", "--panel", "0", "--foxglove", "8765"]),
        (["run", "steady", "--panel", "9"], ["run", "steady", "--panel", "9"]),
        (["panel", "--port", "7"], ["panel", "--port", "7"]),
    ],
)  # fmt: skip
def test_a_server_beside_a_run_may_be_given_no_port(given, read, monkeypatch):
    seen = []
    monkeypatch.setattr("typer.core.TyperGroup.parse_args", lambda _, __, args: seen.append(args))
    Arguments.parse_args(Arguments.__new__(Arguments), None, given)
    assert seen == [read]
