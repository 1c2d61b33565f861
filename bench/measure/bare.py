"""The least that two Python processes need to pass bytes: what our own loop is compared with."""

from __future__ import annotations

import ctypes
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, Literal

from hil.config.resolved import Resolved
from hil.errors import RunError

Side = Literal["plant", "controller"]
Send = Callable[[bytes], object]
Take = Callable[[float | None], bytes | None]
END: Final = b"end"

_RETRY_S: Final = 0.05
_NAP_S: Final = 1e-4
_FOREVER: Final = 1 << 63


@contextmanager
def opened(scenario: Resolved, side: Side) -> Iterator[tuple[Send, Take]]:
    """Yield (send, take) of one side; take waits for so many seconds, or with None for ever."""
    way = _shm if scenario.link.kind == "shm" else _zenoh
    with way(scenario, side) as ends:
        yield ends


def join(send: Send, take: Take, timeout_s: float) -> None:
    """Ask until the other side answers, then forget what else was asked.

    Raises: RunError when nobody does
    """
    end_s = time.monotonic() + timeout_s
    while True:
        send(b"join")
        if take(_RETRY_S) is not None:
            break
        if time.monotonic() > end_s:
            raise RunError(f"bare ping-pong: nobody answered within {timeout_s:g} s")
    while take(_RETRY_S) is not None:
        pass


@contextmanager
def _zenoh(scenario: Resolved, side: Side) -> Iterator[tuple[Send, Take]]:
    """Publisher and blocking subscriber on the endpoints and transport of the real link."""
    import zenoh

    from drivers.zenoh.config import session_config
    from drivers.zenoh.node import PEER

    there, back = side, PEER[side]
    tree = session_config(side, scenario.link.zenoh, lockstep=False)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session:
        publisher = session.declare_publisher(
            f"bare/{there}", priority=zenoh.Priority.REAL_TIME, express=True,
            congestion_control=zenoh.CongestionControl.DROP,
        )  # fmt: skip
        subscriber = session.declare_subscriber(f"bare/{back}", zenoh.handlers.FifoChannel(64))
        handler = subscriber.handler

        def take(timeout_s: float | None) -> bytes | None:
            if timeout_s is None:
                return handler.recv().payload.to_bytes()
            return _patient(handler.try_recv, timeout_s)

        yield publisher.put, take


def _patient(try_recv: Callable[[], Any], timeout_s: float) -> bytes | None:
    """Poll for a sample up to the timeout."""
    end_ns = time.monotonic_ns() + round(timeout_s * 1e9)
    while (sample := try_recv()) is None:
        if time.monotonic_ns() > end_ns:
            return None
        time.sleep(_NAP_S)
    payload: bytes = sample.payload.to_bytes()
    return payload


@contextmanager
def _shm(scenario: Resolved, side: Side) -> Iterator[tuple[Send, Take]]:
    """Publisher and polled subscriber of iceoryx2."""
    import iceoryx2 as iox

    from drivers.shm.link import open_node
    from drivers.zenoh.node import PEER

    node = open_node()
    there, back = side, PEER[side]
    endpoint = scenario.link.zenoh.plant_endpoint

    def service(end: str) -> Any:  # noqa: ANN401
        name = iox.ServiceName.new(f"bare/{end}/{endpoint}")
        return node.service_builder(name).publish_subscribe(iox.Slice[ctypes.c_uint8])

    out = service(there).open_or_create()
    publisher = out.publisher_builder().initial_max_slice_len(64).create()
    subscriber = service(back).open_or_create().subscriber_builder().create()

    def send(data: bytes) -> None:
        loan = publisher.loan_slice_uninit(len(data))
        ctypes.memmove(loan.payload_ptr, data, len(data))
        loan.assume_init().send()

    def take(timeout_s: float | None) -> bytes | None:
        end_ns = _FOREVER if timeout_s is None else time.monotonic_ns() + round(timeout_s * 1e9)
        while (sample := subscriber.receive()) is None:
            if time.monotonic_ns() > end_ns:
                return None
        payload = sample.payload()
        data = ctypes.string_at(payload.as_ptr(), payload.len())
        sample.delete()
        return data

    try:
        yield send, take
    finally:
        publisher.delete()
        subscriber.delete()
