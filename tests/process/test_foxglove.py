"""Viewers of a running engine: its records as they are, its parameters, and who may have them."""

import contextlib
import json
import struct
import subprocess
import sys

import pytest

from hil.log.records import CDR_LE
from hil.log.topics import ALL, STROKE, TRUTH

pytest.importorskip("foxglove", reason="needs the extra foxglove")
sync_client = pytest.importorskip("websockets.sync.client", reason="needs the extra panel")

InvalidStatus = pytest.importorskip("websockets.exceptions").InvalidStatus
pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]

REF = "controller.tdc_ref_m"
WAIT_S = 60.0


class Viewer:
    """A client of the protocol, as the tools are."""

    def __init__(self, socket):
        self.socket = socket
        self.channels = {}
        self.told = []

    def hear(self):
        message = self.socket.recv(timeout=WAIT_S)
        if isinstance(message, str):
            message = json.loads(message)
            if message["op"] == "advertise":
                self.channels |= {c["topic"]: c for c in message["channels"]}
        return message

    def wait_for(self, op):
        while True:
            message = self.hear()
            if isinstance(message, dict):
                self.told.append(message)
                if message["op"] == op:
                    return message

    def ask(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def subscribe(self, *names):
        while not set(names) <= self.channels.keys():
            self.hear()
        asked = [{"id": i, "channelId": self.channels[n]["id"]} for i, n in enumerate(names)]
        self.ask("subscribe", subscriptions=asked)

    def records(self, count):
        """Yield (number of the subscription, log time, bytes)."""
        while count:
            message = self.hear()
            if isinstance(message, bytes) and message[0] == 1:
                yield *struct.unpack_from("<IQ", message, 1), message[13:]
                count -= 1


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run served to viewers: (address, directory)."""
    out = tmp_path_factory.mktemp("run") / "out"
    command = [sys.executable, "-m", "bench.cli", "run", "steady", "--foxglove", "--no-report"]
    command += ["--out", str(out), "--set", "run.duration_s=600", "--clock", "realtime"]
    # A stall of a busy machine is not what is tried here: it takes no engine.
    command += ["--set", "plant.stale_s=0.1", "--set", "controller.limits.stale_s=0.1"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    address = child.stdout.readline().strip()
    yield address, out
    child.terminate()
    child.communicate(timeout=30)


@pytest.fixture
def joined(run):
    """Join as a viewer."""
    with contextlib.ExitStack() as stack:

        def join(address=run[0], protocol="foxglove.sdk.v1", **options):
            connection = sync_client.connect(
                address,
                subprotocols=[protocol],
                max_size=None,
                open_timeout=WAIT_S,
                close_timeout=0.1,
                **options,
            )
            viewer = Viewer(stack.enter_context(connection))
            assert viewer.socket.subprotocol == protocol
            assert "parameters" in viewer.wait_for("serverInfo")["capabilities"]
            return viewer

        yield join


def test_every_topic_is_offered_as_the_log_describes_it(joined):
    viewer = joined()
    names = [f"/{side}{topic.name}" for topic in ALL for side in topic.sides]
    viewer.subscribe(*names)
    assert set(viewer.channels) == set(names)
    truth = viewer.channels["/plant/truth"]
    assert (truth["encoding"], truth["schemaEncoding"]) == ("cdr", "ros2msg")
    assert (truth["schemaName"], truth["schema"]) == (TRUTH.schema_name, TRUTH.definition)


def test_the_records_come_tick_by_tick_with_the_time_of_the_run(joined):
    viewer = joined()
    viewer.subscribe("/plant/truth", "/controller/stroke")
    rows = {0: [], 1: []}
    for number, t_ns, data in viewer.records(700):
        assert data.startswith(CDR_LE)
        layout = (TRUTH, STROKE)[number].layout
        names = [field.name for field in layout.fields]
        rows[number].append(dict(zip(names, layout.unpack(data[len(CDR_LE) :]), strict=True)))
        assert rows[number][-1]["t_ns"] == t_ns
    ticks = [row["tick"] for row in rows[0]]
    assert ticks == list(range(ticks[0], ticks[0] + len(ticks)))
    assert max(row["x_m"] for row in rows[0]) > 0.01
    assert len(rows[1]) > 5


def test_a_viewer_that_reads_nothing_costs_nobody_else_a_record(joined):
    slow, quick = joined(), joined()
    for viewer in (slow, quick):
        viewer.subscribe("/plant/truth", "/plant/frames/sent", "/controller/frames/received")
    ticks = [
        struct.unpack_from("<I", data, len(CDR_LE))[0]
        for number, _, data in quick.records(3000)
        if number == 0
    ]
    assert ticks == list(range(ticks[0], ticks[0] + len(ticks)))


def test_parameters_are_told_changed_and_refused_like_any_operators(joined, run):
    viewer = joined()
    viewer.ask("getParameters", parameterNames=[], id="all")
    values = {p["name"]: p["value"] for p in viewer.wait_for("parameterValues")["parameters"]}
    assert values[REF] == 0.0155
    assert len(values) > 80
    viewer.ask("setParameters", parameters=[{"name": REF, "value": 0.015}], id="set")
    told = viewer.wait_for("parameterValues")
    assert [(p["name"], p["value"]) for p in told["parameters"]] == [(REF, 0.015)]
    viewer.ask("setParameters", parameters=[{"name": REF, "value": 0.9}], id="too far")
    assert f"{REF} = 0.9" in viewer.wait_for("status")["message"]
    assert viewer.wait_for("parameterValues")["parameters"][0]["value"] == 0.015


def test_who_has_subscribed_hears_what_another_operator_changes(joined, run):
    viewer = joined()
    viewer.ask("subscribeParameterUpdates", parameterNames=[REF])
    command = [sys.executable, "-m", "bench.cli", "set", f"{REF}=0.0152", "--run", str(run[1])]
    subprocess.run(command, check=True, capture_output=True)
    told = viewer.wait_for("parameterValues")["parameters"]
    assert (REF, 0.0152) in [(p["name"], p["value"]) for p in told]


def test_a_page_needs_the_token_and_a_program_of_this_machine_does_not(joined, run):
    bare = run[0].partition("?")[0]
    assert run[0].startswith("ws://127.0.0.1:")
    joined(bare)
    joined(run[0], origin="https://viewer.example")
    joined(run[0], protocol="foxglove.websocket.v1")
    for address in (bare, f"{bare}?token=guessed"):
        with pytest.raises(InvalidStatus, match="403"):
            joined(address, origin="https://viewer.example")
