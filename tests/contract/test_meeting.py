"""Plant and controller shake hands before the first tick; a second one of either is refused."""

import contextlib
import os
import threading

import pytest
from meetings import eventually, refusals

from drivers.links import open_link
from hil.config.process import LoopConfig
from hil.errors import LinkError, RefusedError
from hil.wire.terms import DECLARED

REAL_TIME = LoopConfig()
TERMS = (1, "frames", 1000, "realtime", "contract", "nu", "harmonic", "settled", "figures")
KINDS = ("zenoh", "shm")


def with_term(key, value):
    place = [term.key for term in DECLARED].index(key)
    return (*TERMS[:place], value, *TERMS[place + 1 :])


def kind(config, name):
    return config.model_copy(update={"kind": name})


@contextlib.contextmanager
def opened(side, config, terms=TERMS):
    connection = open_link(side, config, REAL_TIME, terms)
    try:
        yield connection
    finally:
        connection.close()


@pytest.mark.parametrize("name", KINDS)
def test_those_that_fit_meet(socket_config, name):
    config = kind(socket_config, name)
    with opened("plant", config) as plant, opened("controller", config) as controller:
        assert refusals(plant, controller) == {}


@pytest.mark.parametrize("name", KINDS)
def test_a_plant_does_not_begin_before_its_controller_waits_for_it(socket_config, name):
    config = kind(socket_config, name)
    with opened("plant", config) as plant, opened("controller", config) as controller:
        with pytest.raises(LinkError, match="no controller"):
            plant.link.wait_for_peer(0.3)
        assert refusals(plant, controller) == {}


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("version of the wire", 2, "version of the wire = 1 here, 2 there"),
        ("loop.rate_hz", 2000, "loop.rate_hz = 1000 here, 2000 there"),
        ("loop.clock", "lockstep", "loop.clock = realtime here, lockstep there"),
        ("plant.prototype", "bit", "plant.prototype = nu here, bit there"),
        ("plant.prototype", "mine", "plant.prototype = nu here, another one there"),
        ("plant.model", "nonlinear", "plant.model = harmonic here, nonlinear there"),
        ("begins", "at-rest", "begins = settled here, at-rest there"),
        ("plant.engine", "changed", "plant.engine = figures here, another one there"),
    ],
)
def test_those_that_do_not_fit_both_say_in_one_line_what_differs(
    socket_config, name, key, value, told
):
    config = kind(socket_config, name)
    theirs = with_term(key, value)
    with opened("plant", config) as plant, opened("controller", config, theirs) as controller:
        found = refusals(plant, controller)
    assert str(found["plant"]) == f"plant and controller do not fit: {told}"
    assert str(found["controller"]).startswith(f"controller and plant do not fit: {key} = ")
    assert {error.exit_code for error in found.values()} == {2}


def test_the_engine_of_somebody_else_is_named(socket_config):
    other = socket_config.model_copy(
        update={"zenoh": socket_config.zenoh.model_copy(update={"engine": "other"})}
    )
    with opened("plant", socket_config) as plant, opened("controller", other) as controller:
        found = refusals(plant, controller, 0.7)
    assert "the controller there is of engine 'other'" in str(found["plant"])
    assert "the plant there is of engine 'contract'" in str(found["controller"])


def told_by(connection):
    """What a connection has noticed, looked for as the loop does with each status."""
    connection.status.publish({"tick": 1})
    return dict(connection.link.notices())


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("side", ["plant", "controller"])
def test_a_second_one_at_the_same_endpoint_is_refused_by_name(socket_config, name, side):
    config = kind(socket_config, name)
    with opened("plant", config) as plant, opened("controller", config) as controller:
        assert refusals(plant, controller) == {}
        line = rf"^a {side} of engine 'contract' is there already: process {os.getpid()} of user"
        with pytest.raises(LinkError, match=line):
            open_link(side, config, REAL_TIME, TERMS)
        first = plant if side == "plant" else controller
        notices = eventually(lambda: told_by(first))
        assert list(notices) == [f"second-{side}"]
        assert f"a second {side} (process {os.getpid()})" in notices[f"second-{side}"]


@pytest.mark.parametrize("name", KINDS)
def test_a_second_controller_elsewhere_is_refused_by_name(socket_config, name):
    config = kind(socket_config, name)
    end = f"{config.zenoh.controller_endpoint}-2"
    zenoh = config.zenoh.model_copy(update={"controller_endpoint": end})
    second = config.model_copy(update={"zenoh": zenoh})
    with opened("plant", config) as plant, opened("controller", config) as controller:
        assert refusals(plant, controller) == {}
        with opened("controller", second) as late:
            line = f"the plant of engine 'contract' has a controller already: process {os.getpid()}"
            with pytest.raises(LinkError, match=line):
                late.link.wait_for_peer(3.0)
            assert list(eventually(lambda: told_by(plant))) == ["second-controller"]


def test_on_a_bus_those_that_fit_meet_by_their_frames(strangers):
    with opened("plant", strangers()) as plant, opened("controller", strangers()) as controller:
        assert refusals(plant, controller) == {}
        assert told_by(plant) == told_by(controller) == {}


@pytest.mark.parametrize("order", [("plant", "controller"), ("controller", "plant")])
def test_on_a_bus_both_say_what_differs(strangers, order):
    theirs = with_term("plant.prototype", "bit")
    with contextlib.ExitStack() as stack:
        ends = {}
        for side in order:
            terms = TERMS if side == "plant" else theirs
            ends[side] = stack.enter_context(opened(side, strangers(), terms))
        found = refusals(ends["plant"], ends["controller"])
    assert str(found["plant"]) == (
        "plant and controller do not fit: plant.prototype = nu here, bit there"
    )
    assert str(found["controller"]) == (
        "controller and plant do not fit: plant.prototype = bit here, nu there"
    )


def test_on_a_bus_a_controller_that_tells_no_terms_is_taken_and_told(strangers):
    with (
        opened("plant", strangers()) as plant,
        opened("controller", strangers(), None) as controller,
    ):
        assert refusals(plant, controller) == {}
        assert list(told_by(plant)) == ["peer-without-terms"]


@contextlib.contextmanager
def running(connection, batch):
    """Let a side send as one that runs."""
    over = threading.Event()

    def send():
        while not over.wait(0.01):
            connection.link.send(batch)

    thread = threading.Thread(target=send)
    thread.start()
    yield
    over.set()
    thread.join()


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_on_a_bus_a_second_one_is_refused_and_told(strangers, ticks, side):
    with opened("plant", strangers()) as plant, opened("controller", strangers()) as controller:
        assert refusals(plant, controller) == {}
        first = plant if side == "plant" else controller
        with opened(side, strangers()) as late:
            with (
                running(first, ticks.batch(side, 0)),
                pytest.raises(RefusedError, match=f"a {side} is there already on zenoh:m"),
            ):
                late.link.wait_for_peer(3.0)
            late.link.send(ticks.batch(side, 0))  # one that waits for nobody

            def noticed():
                first.link.receive()
                return told_by(first)

            assert list(eventually(noticed)) == [f"second-{side}"]


def test_another_controller_is_taken_when_the_first_has_gone(socket_config):
    with opened("plant", socket_config) as plant:
        for _ in range(2):
            with opened("controller", socket_config) as controller:
                assert refusals(plant, controller) == {}
            eventually(lambda: not plant.link.peer_alive())
