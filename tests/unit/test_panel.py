"""The panel without a browser: who may enter, what is kept, what is sent, who steers."""

import asyncio
import json
import struct
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("starlette", reason="needs the extra panel")

from bench.panel import signals
from bench.panel.access import Guard
from bench.panel.feed import taken
from bench.panel.memory import Memory, Ring
from bench.panel.signals import thinned
from bench.panel.steering import Steering, offered
from bench.panel.viewers import Audience, Viewer, packed
from hil.errors import LinkError
from hil.log import topics
from hil.wire.answers import CommandAnswer
from hil.wire.commands import DECLARED

PORT, TOKEN = 8765, "a-token"


def scope(host=f"127.0.0.1:{PORT}", origin=None, token=TOKEN, kind="http"):
    heads = [(b"host", host.encode())] + ([(b"origin", origin.encode())] if origin else [])
    return {"type": kind, "headers": heads, "query_string": f"token={token}".encode()}


@pytest.mark.parametrize(
    ("change", "admitted"),
    [
        ({}, True),
        ({"host": f"localhost:{PORT}"}, True),
        ({"origin": f"http://127.0.0.1:{PORT}"}, True),
        ({"token": ""}, False),
        ({"token": "another"}, False),
        ({"origin": "http://evil.example"}, False),
        ({"origin": f"http://127.0.0.1:{PORT + 1}"}, False),
        ({"origin": f"http://localhost:{PORT}"}, False),
        ({"origin": "null"}, False),
        ({"host": f"rebound.example:{PORT}"}, False),
        ({"host": "127.0.0.1"}, False),
        ({"host": ""}, False),
    ],
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_who_has_the_token_and_comes_from_here_is_let_in(change, admitted, kind):
    reached, sent = [], []

    async def app(_scope, _receive, _send):
        reached.append(True)

    async def send(message):
        sent.append(message)

    asyncio.run(Guard(app, TOKEN, PORT)(scope(kind=kind, **change), None, send))
    assert bool(reached) is admitted
    if not admitted:
        assert sent[0].get("status", sent[0].get("code")) in (403, 1008)


@given(st.lists(st.integers(0, 9), max_size=20), st.integers(0, 60))
def test_a_ring_keeps_the_newest_in_their_order(sizes, before):
    ring, told = Ring(np.dtype("<i8"), 16), 0
    for size in sizes:
        ring.append(np.arange(told, told + size))
        told += size
    kept = ring.since(before)
    assert kept.tolist() == list(range(max(before, told - 16, 0), told))


def test_thinning_keeps_every_extreme():
    t_s = np.arange(1000) * 1e-3
    y = np.zeros(1000)
    y[[123, 777]] = 5.0, -7.0
    thin = thinned(np.stack([t_s, y]), 100)
    assert thin.shape == (2, 100)
    assert (thin[1].min(), thin[1].max()) == (-7.0, 5.0)


def records():
    """Three ticks of a plant: truth, an event, frames."""
    data = b""
    for tick in range(3):
        t_ns = tick * 1_000_000
        data += topics.TRUTH.pack(
            tick, t_ns, 0.01 * tick, 1.0, 0.0, 810.0, 0, 0, 0, 0.0, 0, 1.4, 1.3e5
        )
        data += topics.FRAMES_SENT.pack(tick, t_ns, bytes(20))
        data += topics.FRAMES_RECEIVED.pack(tick, t_ns, bytes(30))
    return data + topics.EVENT.pack(2, 2_000_000, 2, "misfire", "left: no spark")


NAMES = {topic.channel_id: topic.name for topic in topics.ALL}


def test_records_are_rows_words_and_frames():
    batch = taken(records(), "plant", NAMES)
    assert batch.rows["plant.truth"]["x_m"].tolist() == [0.0, 0.01, 0.02]
    assert batch.frames == 15
    (word,) = batch.words
    assert (word.t_s, word.severity, word.code, word.text) == (
        0.002, "fault", "misfire", "left: no spark",
    )  # fmt: skip


def test_words_are_told_in_the_order_in_which_they_happened():
    data = topics.EVENT.pack(1, 1_000_000, 1, "mark", "here")
    data += topics.COMMAND.pack(2, 2_000_000, "panel", b'{"kind": "emergency-stop"}')
    data += topics.EVENT.pack(3, 3_000_000, 2, "mode safe", "emergency stop")
    told = [word.code for word in taken(data, "controller", NAMES).words]
    assert told == ["mark", "order", "mode safe"]


def test_every_number_of_a_log_can_be_shown():
    known = signals.sources()
    assert "plant.truth.x_m" in known
    assert "controller.actuator.pulse_open_t_ns.3" in known
    assert "plant.timing.late_us" in known
    assert not any(name.endswith(".text") for name in known)


class Page:
    """What a viewer's browser takes; a slow one takes nothing for ever."""

    def __init__(self, slow=False):
        self.words, self.frames, self.slow = [], [], slow

    async def send_text(self, data):
        self.words.append(json.loads(data))

    async def send_bytes(self, data):
        if self.slow:
            await asyncio.sleep(3600)
        self.frames.append(data)


def unpacked(frame):
    size = struct.unpack_from("<I", frame)[0]
    head, at, columns = json.loads(frame[4 : 4 + size]), 4 + size, {}
    for names, count in head["groups"]:
        for name in ("t", *names):
            columns[name] = np.frombuffer(frame, "<f8", count, at)
            at += 8 * count
    return head, columns


def memory_of(batches):
    memory = Memory(1000)
    for batch in batches:
        for key, rows in batch.rows.items():
            memory.append(key, rows)
    return memory


def follow(viewer, memory, steps):
    """Let a viewer follow while something happens."""

    async def run():
        following = asyncio.create_task(viewer.follow(memory))
        for step in steps:
            step()
            await asyncio.sleep(0.06)
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)

    asyncio.run(run())


def test_a_viewer_gets_what_it_shows_and_only_what_is_new():
    page, memory, batch = Page(), memory_of([]), taken(records(), "plant", NAMES)
    viewer = Viewer(1, page)
    viewer.show(["plant.truth.x_m", "plant.truth.v_m_s", "no.such"], memory)
    follow(viewer, memory, [lambda: memory.append("plant.truth", batch.rows["plant.truth"])] * 2)
    assert len(page.frames) == 2
    _, columns = unpacked(page.frames[0])
    assert list(columns) == ["t", "plant.truth.x_m", "plant.truth.v_m_s"]
    assert columns["plant.truth.x_m"].tolist() == [0.0, 0.01, 0.02]


def test_a_window_is_every_sample_of_the_last_minute_that_is_asked_for():
    page, memory = Page(), memory_of([taken(records(), "plant", NAMES)])
    asked = {"id": 7, "signals": ["plant.truth.x_m"], "from": 0.001, "to": 1.0}
    asyncio.run(Viewer(1, page).send_window(memory, asked))
    head, columns = unpacked(page.frames[0])
    assert (head["k"], head["id"]) == ("window", 7)
    assert columns["t"].tolist() == pytest.approx([0.001, 0.002])


def test_a_viewer_that_takes_nothing_is_dropped(monkeypatch):
    monkeypatch.setattr("bench.panel.viewers._PATIENCE_S", 0.02)
    memory = memory_of([])
    viewer = Viewer(1, Page(slow=True))
    viewer.show(["plant.truth.x_m"], memory)
    memory.append("plant.truth", taken(records(), "plant", NAMES).rows["plant.truth"])
    with pytest.raises(TimeoutError):
        asyncio.run(viewer.follow(memory))


def test_doubles_begin_where_a_browser_can_read_them():
    for name in ("a", "ab", "abc", "abcd", "abcdefgh"):
        frame = packed({"k": name}, [(["x"], np.zeros((2, 3)))])
        assert (4 + struct.unpack_from("<I", frame)[0]) % 8 == 0


def test_one_steers_and_another_one_by_force_or_when_it_is_free():
    audience = Audience()
    first, second = audience.admit(Page()), audience.admit(Page())
    audience.take_wheel(first, wanted=True, by_force=False)
    audience.take_wheel(second, wanted=True, by_force=False)
    assert audience.steers(first)
    audience.take_wheel(second, wanted=True, by_force=True)
    assert audience.steers(second)
    assert not audience.steers(first)
    audience.dismiss(second)
    audience.take_wheel(first, wanted=True, by_force=False)
    assert audience.steers(first)


class Pair:
    """Two processes that take what they are given."""

    def __init__(self):
        self.values = {"controller.tdc_ref_m": 0.0155}
        self.asked = []

    def ask(self, command, to, _timeout_s):
        self.asked.append(command)
        if command["kind"] == "start":
            raise LinkError("the controller did not answer start")
        return CommandAnswer(to, True, 100 + len(self.asked), "generating")


def set_values(pair, values, _timeout_s):
    pair.values |= values
    return (CommandAnswer("controller", True, 5, "set"),)


def steering_of(pair):
    return Steering(pair, set_values, lambda pair, _: dict(pair.values))


def test_changes_are_undone_one_after_the_other():
    pair = Pair()

    async def steer():
        steering = steering_of(pair)
        assert await steering.look()
        for value in (0.0150, 0.0152):
            await steering.change({"controller.tdc_ref_m": value})
        assert pair.values["controller.tdc_ref_m"] == 0.0152
        await steering.undo()
        assert pair.values["controller.tdc_ref_m"] == 0.0150
        await steering.undo()
        return await steering.undo()

    answer = asyncio.run(steer())
    assert pair.values["controller.tdc_ref_m"] == 0.0155
    assert (answer["taken"], answer["text"]) == (False, "nothing to undo")


def test_no_order_waits_for_a_look_at_all_parameters_nor_is_undone_by_it():
    pair, may_end = Pair(), threading.Event()

    def slow_look(pair, _timeout_s):
        old = dict(pair.values)
        assert may_end.wait(30.0)
        return old

    async def steer():
        steering = Steering(pair, set_values, slow_look)
        looking = asyncio.create_task(steering.look())
        await asyncio.sleep(0)
        change = steering.change({"controller.tdc_ref_m": 0.015})
        answer = await asyncio.wait_for(change, 10.0)
        may_end.set()
        await looking
        return answer, steering.values

    answer, values = asyncio.run(steer())
    assert answer["taken"]
    assert values == {"controller.tdc_ref_m": 0.015}


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ({"kind": "misfire", "count": 0}, "count = 0"),
        ({"kind": "nonsense"}, "kind must be one of"),
        ({"kind": "start"}, "did not answer start"),
    ],
)
def test_what_is_refused_is_told_and_nothing_else_happens(command, text):
    answer = asyncio.run(steering_of(Pair()).order(command))
    assert not answer["taken"]
    assert text in answer["text"]


def test_a_run_in_memory_is_only_looked_at():
    answer = asyncio.run(Steering(None, set_values, dict).order({"kind": "stop"}))
    assert not answer["taken"]
    assert "no keys" in answer["text"]


def test_every_command_is_offered_with_what_it_accepts():
    assert [command["kind"] for command in offered()] == [declared.kind for declared in DECLARED]
    json.dumps(offered())
