"""From the configuration to an open link: one table from the kind of link to what opens it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal, NamedTuple

from drivers.channels import MemoryCommands, MemoryStatus
from drivers.memory_link import MemoryLink, memory_pair
from drivers.zenoh.channels import ZenohCommands, ZenohOperator, ZenohStatus
from drivers.zenoh.link import ZenohLink
from drivers.zenoh.node import ZenohNode
from hil.config.process import LinkConfig, LoopConfig
from hil.errors import ConfigError, HilError
from hil.ports import CommandSource, Link, StatusSink
from hil.wire.terms import Terms

Side = Literal["plant", "controller"]


class Connection(NamedTuple):
    """What one process has of the outside world; `close` gives all of it back, in order."""

    link: Link
    commands: CommandSource
    status: StatusSink
    close: Callable[[], None]


def _node(side: Side, config: LinkConfig, loop: LoopConfig, terms: Terms | None) -> ZenohNode:
    """Open a process's session."""
    return ZenohNode(side, config.zenoh, lockstep=loop.clock == "lockstep", terms=terms)


def _open_zenoh(
    side: Side, config: LinkConfig, loop: LoopConfig, terms: Terms | None
) -> Connection:
    """Open a process's session with its link, command source and status sink on it."""
    node = _node(side, config, loop, terms)
    link, commands, status = ZenohLink(node, loop.period_ns), ZenohCommands(node), ZenohStatus(node)
    node.announce()

    def close() -> None:
        for part in (link, commands, status, node):
            part.close()

    return Connection(link, commands, status, close)


def _open_shm(side: Side, config: LinkConfig, loop: LoopConfig, terms: Terms | None) -> Connection:
    """Open a process's end in shared memory, with commands and status on a Zenoh session."""
    from drivers.shm.link import ShmLink  # noqa: PLC0415 - an extra, loaded where it is used

    node = _node(side, config, loop, terms)
    try:
        link = ShmLink(node, loop.period_ns)
    except HilError:
        node.close()
        raise
    commands, status = ZenohCommands(node), ZenohStatus(node)
    node.announce()

    def close() -> None:
        for part in (link, commands, status, node):
            part.close()

    return Connection(link, commands, status, close)


def _open_can(side: Side, config: LinkConfig, loop: LoopConfig, terms: Terms | None) -> Connection:
    """Open a process's node on a CAN bus, with commands and status on a Zenoh session."""
    from drivers.can.link import CanLink, open_port  # noqa: PLC0415 - loaded where it is used

    port = open_port(side, config, lockstep=loop.clock == "lockstep")
    try:
        node = _node(side, config, loop, terms)
    except HilError:
        port.close()
        raise
    link = CanLink(port, node, loop.period_ns, terms=terms)
    commands, status = ZenohCommands(node), ZenohStatus(node)
    node.announce()

    def close() -> None:
        for part in (link, commands, status, node):
            part.close()

    return Connection(link, commands, status, close)


Opener = Callable[[Side, LinkConfig, LoopConfig, Terms | None], Connection]
OPENERS: Final[dict[str, Opener]] = {
    "zenoh": _open_zenoh,
    "shm": _open_shm,
    "can": _open_can,
}
"""A link between two processes is one row here; `memory` stays inside one, see `open_memory`."""


def open_link(
    side: Side, config: LinkConfig, loop: LoopConfig, terms: Terms | None = None
) -> Connection:
    """Open the link of one process.

    Parameters: terms : what this side holds to; without them it agrees to anything
    Raises: ConfigError when the configuration refuses it, LinkError when it does not open
    """
    opener = OPENERS.get(config.kind)
    if opener is None:
        kinds = ", ".join(sorted(OPENERS))
        raise ConfigError(f"link.kind = {config.kind!r} between two processes: accepted {kinds}")
    return opener(side, config, loop, terms)


def open_memory() -> tuple[Connection, Connection]:
    """Return plant's and controller's connection inside one process."""
    plant, controller = memory_pair()
    return _in_memory(plant), _in_memory(controller)


def _in_memory(link: MemoryLink) -> Connection:
    """Put one end of a memory link together with its channels."""
    return Connection(link, MemoryCommands(), MemoryStatus(), link.close)


def open_operator(config: LinkConfig, loop: LoopConfig, name: str) -> ZenohOperator:
    """Open the bench's view of two processes: commands to them, status from them.

    Raises: ConfigError, LinkError as `open_link`
    """
    node = ZenohNode("bench", config.zenoh, lockstep=loop.clock == "lockstep")
    return ZenohOperator(node, name)
