"""Where the sockets of an engine are: in a directory that only its user, or its group, enters.

Units share the one that their manager makes for them, which the group of the engine may enter;
processes that a user starts meet in one that is that user's alone. An operator finds both.
"""

from __future__ import annotations

import os
import socket
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, Protocol

from hil.errors import ConfigError

if TYPE_CHECKING:
    from hil.config.process import TlsConfig

Side = Literal["plant", "controller"]

VARIABLE: Final = "HIL_RUNTIME_DIRECTORY"
SERVICES: Final = Path("/run/fpeg")
"""Where the units meet; only root makes anything beside it."""

_TEMPORARY: Final = Path("/tmp")
_MAX_SOCKET_PATH: Final = 107  # sun_path of a unix socket, without its closing zero


class ZenohSection(Protocol):
    """Section `link.zenoh` of a configuration (hil/config/process.py), or the same unchecked."""

    @property
    def engine(self) -> str:
        """Name of the pair."""

    @property
    def plant_endpoint(self) -> str:
        """Where the plant listens."""

    @property
    def controller_endpoint(self) -> str:
        """Where the controller listens."""

    @property
    def tls(self) -> TlsConfig | None:
        """Certificates of what leaves the machine."""

    @property
    def allow_insecure(self) -> bool:
        """Whether an endpoint may leave the machine without."""


class Endpoints(NamedTuple):
    """That section for who has no time to read and check a whole configuration."""

    engine: str = "fpeg"
    plant_endpoint: str = ""
    controller_endpoint: str = ""
    tls: TlsConfig | None = None
    allow_insecure: bool = False


CLOSED: Final = 0o027
"""What group and others must not have in a directory of sockets: the group may look and enter."""


def own_directory() -> Path:
    """Return where processes that this user starts meet; HIL_RUNTIME_DIRECTORY puts it elsewhere.

    It is $XDG_RUNTIME_DIR/hil where that is this user's, else /tmp/hil-UID.
    """
    given = os.environ.get(VARIABLE)
    if given:
        return Path(given)
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and not _fault(Path(base), (os.geteuid(),)):
        return Path(base) / "hil"
    return _TEMPORARY / f"hil-{os.geteuid()}"


def made(folder: Path, variable: str = VARIABLE, refused: int = CLOSED) -> Path:
    """Return a directory for what is this user's, made where there is none.

    Parameters: variable : of the environment, with which another directory is named; refused : what
        group and others must not have

    Raises: ConfigError when it is another user's, or others may enter or change it
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: {error.strerror}; {variable} names another one") from None
    fault = _fault(folder, (os.geteuid(), 0), refused)
    if fault:
        raise ConfigError(
            f"{folder}: {fault}; accepted is a directory of this user that nobody else can enter"
            f" ({variable} names another one)"
        )
    return folder


def _fault(folder: Path, owners: tuple[int, ...], refused: int = CLOSED) -> str:
    """What is wrong with a directory, nothing if it will do; a link to one will not."""
    try:
        found = folder.lstat()
    except OSError as error:
        return str(error.strerror)
    if not stat.S_ISDIR(found.st_mode):
        return "is no directory"
    if found.st_uid not in owners:
        return f"belongs to user {found.st_uid}"
    if found.st_mode & refused:
        return f"has the mode {stat.S_IMODE(found.st_mode):04o}"
    return ""


def found(engine: str) -> Path:
    """Return the directory in which an engine of this name is, else this user's own.

    Raises: ConfigError when this user's own will not do
    """
    own = own_directory()
    if own != SERVICES and _has(made(own), engine):
        return own
    return SERVICES if _has(SERVICES, engine) else own


def _has(folder: Path, engine: str) -> bool:
    """Whether a process of the engine has a socket there."""
    try:
        return any((folder / _name(engine, side)).exists() for side in ("plant", "controller"))
    except OSError:  # this user may not enter it
        return False


def is_served(path: Path) -> bool:
    """Whether somebody listens at a unix socket."""
    if path.suffix != ".sock":
        return False
    with socket.socket(socket.AF_UNIX) as probe:
        return probe.connect_ex(str(path)) == 0


def _name(engine: str, side: str) -> str:
    return f"{engine}-{side}.sock"


def placed(config: ZenohSection, role: Literal[Side, "bench"]) -> ZenohSection:
    """Return the configuration with the endpoints that it leaves open: sockets of the engine.

    Raises: ConfigError when the directory for them will not do
    """
    ends = {"plant": config.plant_endpoint, "controller": config.controller_endpoint}
    if all(ends.values()):
        return config
    folder = found(config.engine) if role == "bench" else made(own_directory())
    longest = folder / _name(config.engine, "controller")
    if len(os.fsencode(longest)) > _MAX_SOCKET_PATH:
        raise ConfigError(f"{longest}: too long for a unix socket; {VARIABLE} names another place")
    plant, controller = (
        end or f"unixsock-stream/{folder / _name(config.engine, side)}"
        for side, end in ends.items()
    )
    return Endpoints(config.engine, plant, controller, config.tls, config.allow_insecure)


def records_socket(config: ZenohSection, side: Side, *, own: bool = False) -> Path:
    """Return where the recorder of a process can be joined: beside the socket of that process.

    Parameters: own : whether it is the process itself that asks, not who looks for it

    Raises: ConfigError when there is no directory for it
    """
    config = placed(config, side if own else "bench")
    endpoint = config.plant_endpoint if side == "plant" else config.controller_endpoint
    protocol, _, path = endpoint.partition("/")
    if protocol != "unixsock-stream":
        folder = made(own_directory()) if own else found(config.engine)
        path = str(folder / _name(config.engine, side))
    return Path(path).with_suffix(".records")


def guard(endpoint: str) -> None:
    """Let those connect to a socket of ours who may enter its directory: this user, or a group."""
    protocol, _, path = endpoint.partition("/")
    if protocol == "unixsock-stream":
        guard_socket(Path(path))


def guard_socket(path: Path) -> None:
    """The same of a socket by its path."""
    is_of_group = path.parent.stat().st_mode & 0o017 == 0o010
    path.chmod(0o660 if is_of_group else 0o600)
