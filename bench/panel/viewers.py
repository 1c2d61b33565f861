"""Those who look on: what each of them sees, and which one of them steers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from bench.panel.memory import Memory
from bench.panel.signals import Source, columns, sources, thinned

FRAME_S: Final = 0.04
_PATIENCE_S: Final = 3.0
_MOST_A_FRAME: Final = 200
"""Instants of a signal in one frame: those of 5 kHz; of more, the ends of each bin."""

_MOST_SHOWN: Final = 64
_MOST_WAITING: Final = 2_000
_MOST_OF_A_WINDOW: Final = 600_000
_LENGTH: Final = struct.Struct("<I")

Message = dict[str, Any]
Group = tuple[list[str], NDArray[np.float64]]


class Socket(Protocol):
    """What a viewer is reached by."""

    async def send_text(self, data: str) -> None:
        """Send words."""

    async def send_bytes(self, data: bytes) -> None:
        """Send samples."""


class Viewer:
    """One page: the signals it shows, and how far it has been told of them."""

    def __init__(self, number: int, socket: Socket) -> None:
        self.name = f"viewer {number}"
        self._socket = socket
        self._groups: dict[str, list[tuple[str, Source]]] = {}
        self._told: dict[str, int] = {}
        self._words: deque[Message] = deque(maxlen=_MOST_WAITING)
        self._has_words = asyncio.Event()

    def tell(self, message: Message) -> None:
        """Have something said at once; samples wait for the next frame."""
        self._words.append(message)
        self._has_words.set()

    def show(self, names: Iterable[object], memory: Memory) -> None:
        """Choose the signals; what is no signal is left out."""
        self._groups = grouped(names)
        self._told = {key: _count(memory, key) for key in self._groups}

    async def follow(self, memory: Memory) -> None:
        """Send frames until the page takes no more of them in time.

        Raises: TimeoutError when it has been too slow
        """
        clock = asyncio.get_running_loop().time
        while True:
            due_s = clock() + FRAME_S
            frame = self._frame(memory)
            if frame:
                await self._in_time(self._socket.send_bytes(frame))
            while (left_s := due_s - clock()) > 0.0:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._has_words.wait(), left_s)
                self._has_words.clear()
                while self._words:
                    await self._in_time(self._socket.send_text(_json(self._words.popleft())))

    async def _in_time(self, sending: Any) -> None:  # noqa: ANN401
        await asyncio.wait_for(sending, _PATIENCE_S)

    def _frame(self, memory: Memory) -> bytes:
        """What is new of the signals shown; nothing when there is nothing."""
        found: list[Group] = []
        for key, members in self._groups.items():
            ring = memory.ring(key)
            if ring is None:
                continue
            rows = ring.since(min(self._told.get(key, 0), ring.count))
            self._told[key] = ring.count
            if len(rows):
                values = columns(rows, [source for _, source in members])
                found.append(([name for name, _ in members], thinned(values, _MOST_A_FRAME)))
        return packed({"k": "new"}, found) if found else b""

    async def send_window(self, memory: Memory, asked: Mapping[str, Any]) -> None:
        """Send a stretch of the last minute at full rate.

        Parameters: asked : number of the question, names, from and to [s]
        """
        found: list[Group] = []
        low, high = float(asked.get("from", 0.0)), float(asked.get("to", 1e12))
        for key, members in grouped(asked.get("signals", ())).items():
            ring = memory.ring(key)
            if ring is not None:
                values = columns(ring.since(0), [source for _, source in members])
                inside = values[:, (values[0] >= low) & (values[0] <= high)]
                found.append(([name for name, _ in members], thinned(inside, _MOST_OF_A_WINDOW)))
        head = {"k": "window", "id": asked.get("id")}
        await self._in_time(self._socket.send_bytes(packed(head, found)))


def grouped(names: Iterable[object]) -> dict[str, list[tuple[str, Source]]]:
    """Return the signals that are meant, by the topic they are in."""
    known, found = sources(), dict[str, list[tuple[str, Source]]]()
    for name in list(dict.fromkeys(map(str, names)))[:_MOST_SHOWN]:
        if name in known:
            found.setdefault(known[name].key, []).append((name, known[name]))
    return found


def _count(memory: Memory, key: str) -> int:
    ring = memory.ring(key)
    return 0 if ring is None else ring.count


def packed(head: Message, groups: list[Group]) -> bytes:
    """Return samples as bytes: length of the head, the head as JSON, then columns of doubles.

    A group is the times of a topic and then its signals; the head says how many of each.
    """
    told = {**head, "groups": [[names, values.shape[1]] for names, values in groups]}
    text = _json(told).encode()
    text += b" " * (-(len(text) + _LENGTH.size) % 8)
    body = b"".join(np.ascontiguousarray(values).tobytes() for _, values in groups)
    return _LENGTH.pack(len(text)) + text + body


def _json(message: Message) -> str:
    """Words for a page; what is no number is null, as JSON has it."""
    return json.dumps(_finite(message), ensure_ascii=False)


def _finite(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value


class Audience:
    """All viewers; one of them may steer."""

    def __init__(self) -> None:
        self._viewers: list[Viewer] = []
        self._number = 0
        self._steers: Viewer | None = None

    def admit(self, socket: Socket) -> Viewer:
        """Take in another one."""
        self._number += 1
        viewer = Viewer(self._number, socket)
        self._viewers.append(viewer)
        self._tell_who()
        return viewer

    def dismiss(self, viewer: Viewer) -> None:
        """Let one go; the wheel is free again if it was that one's."""
        self._viewers.remove(viewer)
        if self._steers is viewer:
            self._steers = None
        self._tell_who()

    def take_wheel(self, viewer: Viewer, *, wanted: bool, by_force: bool) -> None:
        """Let a viewer steer where nobody does, or take the wheel from another one by force."""
        if wanted and (self._steers is None or by_force):
            self._steers = viewer
        elif not wanted and self._steers is viewer:
            self._steers = None
        self._tell_who()

    def steers(self, viewer: Viewer) -> bool:
        """Whether it is the one."""
        return self._steers is viewer

    def tell(self, message: Message) -> None:
        """Say something to all."""
        for viewer in self._viewers:
            viewer.tell(message)

    def _tell_who(self) -> None:
        steers = None if self._steers is None else self._steers.name
        for viewer in self._viewers:
            told = {"k": "who", "you": viewer.name, "steers": steers}
            viewer.tell(told | {"viewers": [one.name for one in self._viewers]})
