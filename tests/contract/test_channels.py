"""Commands reach a process with their origin; status leaves it; both at no cost to the loop."""

import asyncio
import contextlib
import json
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
import zenoh

from drivers.channels import STOP, MemoryCommands, MemoryStatus, origin_text
from drivers.links import open_link, open_operator
from drivers.zenoh.config import session_config
from hil.config.process import LinkConfig, LoopConfig
from hil.errors import ConfigError, LinkError
from hil.wire.answers import MAX_WAITING
from hil.wire.commands import MAX_BYTES

LOCKSTEP = LoopConfig(clock="lockstep")


@pytest.fixture
def bench(config):
    """Plant, controller and an operator on one engine."""
    with contextlib.ExitStack() as stack:
        plant = open_link("plant", config, LOCKSTEP)
        stack.callback(plant.close)
        controller = open_link("controller", config, LOCKSTEP)
        stack.callback(controller.close)
        operator = open_operator(config, LOCKSTEP, "hil run")
        stack.callback(operator.close)
        asyncio.run(operator.wait_for({"plant", "controller"}, 5.0))
        yield plant, controller, operator


def eventually(poll, seconds=2.0):
    end = time.monotonic() + seconds
    while (found := poll()) is None:
        assert time.monotonic() < end
    return found


def test_a_command_reaches_both_processes_with_its_origin(bench):
    plant, controller, operator = bench
    operator.send_command({"kind": "start"})
    operator.send_command({"kind": "set", "tdc_ref_m": 0.0155})
    for process in (plant, controller):
        origin, raw = eventually(process.commands.poll)
        assert json.loads(raw) == {"kind": "start"}
        assert origin.startswith("hil run, process ")
        assert "(zenoh " in origin
        assert json.loads(eventually(process.commands.poll)[1])["tdc_ref_m"] == 0.0155
        assert process.commands.poll() is None


def test_frames_and_commands_do_not_mix(bench):
    plant, controller, operator = bench
    operator.send_command({"kind": "stop"})
    plant.link.send(b"x" * 10)
    assert controller.link.wait(2_000_000_000) == b"x" * 10
    assert json.loads(eventually(controller.commands.poll)[1]) == {"kind": "stop"}
    assert plant.link.receive() is None


def asked(operator, command, to="controller"):
    """A question under way, and what is answered."""
    pool = ThreadPoolExecutor(1)
    return pool.submit(operator.ask, command, to, 2.0)


def test_a_command_is_answered_by_its_addressee_to_the_one_who_asked(bench):
    plant, controller, operator = bench
    answer = asked(operator, {"kind": "set-point", "tdc_ref_m": 0.0155})
    for process in (plant, controller):
        origin, raw = eventually(process.commands.poll)
        assert json.loads(raw)["kind"] == "set-point"
        assert origin.startswith("hil run, process ")
    controller.commands.answer(False, 17, "accepted up to 0.015")
    controller.commands.answer(True, 18, "nobody asked twice")
    assert answer.result(3.0) == ("controller", False, 17, "accepted up to 0.015", {})


def test_what_nobody_answers_is_told(bench):
    _, controller, operator = bench
    answer = asked(operator, {"kind": "start"})
    eventually(controller.commands.poll)
    with pytest.raises(LinkError, match="the controller did not answer start within 2 s"):
        answer.result(4.0)


def test_a_stop_is_before_everything_that_waits(bench):
    _, controller, operator = bench
    for number in range(3 * MAX_WAITING):
        operator.send_command({"kind": "law", "law": f"law-{number}"})
    eventually(controller.commands.poll)
    answer = asked(operator, {"kind": "stop"})
    deadline = time.monotonic() + 2.0
    polls = 0
    while (received := controller.commands.poll()) is None or received[1] != STOP:
        polls += received is not None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert polls < MAX_WAITING / 2
    controller.commands.answer(True, 5, "stopping")
    assert answer.result(3.0).taken


def test_a_stop_that_is_put_on_the_command_key_is_before_what_waits_there(bench):
    _, controller, operator = bench
    for number in range(40):
        operator.send_command({"kind": "law", "law": f"law-{number}"})
    operator.send_command({"kind": "stop"})
    time.sleep(0.3)
    taken = [controller.commands.poll()[1] for _ in range(6)]
    assert b'{"kind": "stop"}' in taken


def test_commands_that_find_no_room_are_refused_and_told_as_an_event(bench):
    _, controller, operator = bench
    for _ in range(12):  # a loop that takes one at a look
        for number in range(MAX_WAITING // 2):
            operator.send_command({"kind": "law", "law": f"law-{number}"})
        time.sleep(0.05)
        controller.commands.poll()
        controller.commands.poll()
    codes = dict(controller.link.notices())
    assert "64 commands wait already" in codes["command-flood"]


@pytest.mark.parametrize(
    "name", ["frames/plant", "status/plant", "command"]
)  # fmt: skip
def test_what_is_too_long_does_not_reach_the_memory_of_a_process(bench, name):
    _, controller, operator = bench
    tree = session_config("bench", operator._node.config, lockstep=True)
    del tree["low_pass_filter"]
    with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session:
        time.sleep(0.5)
        for size in (70_000, 200_000):
            session.put(f"hil/contract/{name}", bytes(size))
        time.sleep(0.5)
    assert controller.link.receive() is None
    assert controller.commands.poll() is None
    assert operator.poll_status() is None


def test_an_oversized_command_is_cut_so_that_it_cannot_be_parsed(bench):
    _, controller, operator = bench
    operator.send_command({"kind": "x" * 2 * MAX_BYTES})
    _, raw = eventually(controller.commands.poll)
    assert len(raw) < MAX_BYTES + 10
    with pytest.raises(json.JSONDecodeError):
        json.loads(raw)


def test_status_is_followed_from_a_loop(bench):
    plant, controller, operator = bench

    async def follow():
        seen = {}
        statuses = operator.statuses()
        while len(seen) < 2:
            plant.status.publish({"tick": 4, "tdc_mm": float("nan")})
            controller.status.publish({"mode": "run"})
            process, status = await anext(statuses)
            seen[process] = status
        return seen

    seen = asyncio.run(asyncio.wait_for(follow(), 5.0))
    assert seen == {"plant": {"tick": 4, "tdc_mm": None}, "controller": {"mode": "run"}}


def test_the_operator_sees_who_leaves(bench):
    _, controller, operator = bench
    assert operator.alive() >= {"plant", "controller"}
    controller.close()
    eventually(lambda: None if "controller" in operator.alive() else True)
    assert "plant" in operator.alive()


def test_a_command_that_nobody_takes_is_an_error(bench):
    plant, controller, operator = bench
    plant.close()
    controller.close()
    eventually(lambda: None if operator.alive() else True)
    with pytest.raises(LinkError, match="no process of engine 'contract' takes commands"):
        operator.send_command({"kind": "start"})
    with pytest.raises(LinkError, match=r"no controller and no plant after 0\.05 s"):
        asyncio.run(operator.wait_for({"plant", "controller"}, 0.05))


def test_publishing_after_the_end_is_no_error(bench):
    plant, _, _ = bench
    plant.close()
    plant.close()
    plant.status.publish({"tick": 1})
    assert plant.commands.poll() is None


def test_a_controller_may_be_started_before_the_plant(config):
    controller = open_link("controller", config, LOCKSTEP)
    plant = open_link("plant", config, LOCKSTEP)
    try:
        plant.link.wait_for_peer(5.0)
        controller.link.wait_for_peer(5.0)
    finally:
        plant.close()
        controller.close()


def test_a_missing_peer_is_named_with_its_endpoint(config):
    plant = open_link("plant", config, LOCKSTEP)
    endpoint = config.zenoh.controller_endpoint
    with pytest.raises(LinkError, match=rf"^no controller at {endpoint} after 0\.05 s$"):
        plant.link.wait_for_peer(0.05)
    plant.close()


def test_a_second_plant_on_the_same_endpoint_is_refused(config):
    plant = open_link("plant", config, LOCKSTEP)
    with pytest.raises(LinkError, match="plant cannot open"):
        open_link("plant", config, LOCKSTEP)
    plant.close()


def test_a_link_is_open_again_where_it_was_closed(socket_config):
    for _ in range(2):
        connection = open_link("plant", socket_config, LOCKSTEP)
        connection.close()


def test_a_kind_that_joins_no_two_processes_is_refused():
    with pytest.raises(ConfigError, match=r"link\.kind = 'memory' between two processes: accepted"):
        open_link("plant", LinkConfig(kind="memory"), LOCKSTEP)


def test_a_session_that_never_said_its_name_is_logged_as_such(bench):
    _, controller, operator = bench
    tree = session_config("bench", operator._node.config, lockstep=True)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session:
        publisher = session.declare_publisher("hil/contract/command")

        def taken():
            publisher.put(b"\xff{")
            return controller.commands.poll()

        assert eventually(taken) == ("unnamed (unknown session)", b"\xff{")


def test_an_origin_is_fit_for_a_log_line():
    assert origin_text(b"") == "unnamed"
    assert origin_text(b"hil run\n\x1b[31m") == "hil run??[31m"
    assert len(origin_text(b"\xff" * 1000)) == 64


def test_channels_inside_one_process():
    commands, status = MemoryCommands(), MemoryStatus()
    shown = []
    status.on_publish = shown.append
    commands.submit("test", {"kind": "start"})
    status.publish({"tick": 1, "x_m": float("inf")})
    assert commands.poll() == ("test", b'{"kind": "start"}')
    assert commands.poll() is None
    assert status.newest == {"tick": 1, "x_m": None}
    assert shown == [status.newest]
