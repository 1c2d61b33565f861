"""One process's session: its endpoints, who else takes part, and whether the two fit.

Presence is a liveliness token, alive/ROLE/WHO/TERMS: it is there at once for whoever comes later,
and goes with its process. So each side reads the other's terms off it before the first tick. The
plant says with a token of its own, alive/pair/WHO, which controller it has; another one is refused.
That controller says with alive/ready/WHO that it waits for the first sample: the plant, whose clock
begins with its first tick, begins no sooner.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import struct
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import zenoh

from drivers.zenoh.config import Role, session_config
from drivers.zenoh.sockets import ZenohSection, guard, placed
from hil.errors import ConfigError, LinkError, RefusedError

if TYPE_CHECKING:
    from hil.wire.terms import Terms

PEER: Final[dict[Role, Role]] = {"plant": "controller", "controller": "plant"}
_PAIR: Final = "pair"
_READY: Final = "ready"
_NO_TERMS: Final = "-"
_MOST_KNOWN: Final = 64
_LINGER_S: Final = 0.3
"""Who refuses stays for so long, so that the other side reads why."""

_PATIENCE_S: Final = 1.0
"""How long a plant may take to let go of a controller that has ended."""

_UCRED: Final = struct.Struct("3i")


def give_back(*closers: Callable[[], object]) -> None:
    """Undeclare or close one after the other, whatever became of the session meanwhile."""
    for closer in closers:
        with contextlib.suppress(zenoh.ZError):
            closer()


class ZenohNode:
    """One process's session.

    Parameters: terms : what this side holds to; without them it agrees to anything
    Raises: ConfigError when an endpoint is refused, LinkError when the session does not open
    """

    def __init__(
        self, role: Role, config: ZenohSection, *, lockstep: bool, terms: Terms | None = None
    ) -> None:
        self.role = role
        self.config = config = placed(config, role)
        self.lockstep = lockstep
        self._terms = terms
        self._notices: list[tuple[str, str]] = []
        self.session = _opened(role, config, lockstep=lockstep)
        self._who = f"{os.getpid()}-{self.session.zid()}"
        self._alive: set[str] = set()
        self._there: dict[tuple[str, str], str] = {}  # terms by role and who, oldest first
        self._told = ""  # terms of the newest peer, gone or not
        self._others: dict[str, str] = {}  # engines by role, of those that are not ours
        self._seen = self.session.liveliness().declare_subscriber(
            "hil/*/alive/**", zenoh.handlers.RingChannel(256), history=True
        )
        self._token: zenoh.LivelinessToken | None = None
        self._pair: zenoh.LivelinessToken | None = None
        self._ready: zenoh.LivelinessToken | None = None
        self._partner = ""
        self._vain_s = 0.0

    def key(self, end: str) -> str:
        """Return a key of this engine."""
        return f"hil/{self.config.engine}/{end}"

    def announce(self) -> None:
        """Tell the others that this process takes part; call it when everything is declared."""
        told = _NO_TERMS
        if self._terms is not None:
            from hil.wire import terms as wire  # noqa: PLC0415 - all messages, which no operator needs

            told = wire.encode(self.role, self._terms).hex()
        self._token = self._present(f"{self.role}/{self._who}/{told}")

    def _present(self, what: str) -> zenoh.LivelinessToken:
        return self.session.liveliness().declare_token(self.key(f"alive/{what}"))

    def alive(self) -> set[str]:
        """Return the roles of the processes that take part by now."""
        while (sample := self._seen.handler.try_recv()) is not None:
            self._note(str(sample.key_expr).split("/"), sample.kind == zenoh.SampleKind.PUT)
        return self._alive

    def _note(self, key: list[str], is_there: bool) -> None:
        """Take note of who has come or gone; what is no presence of ours is passed over."""
        if len(key) != 6 or key[0] != "hil" or key[2] != "alive":
            return
        _, engine, _, role, who, told = key
        if engine != self.config.engine:
            if is_there and role in PEER:
                self._others[role] = engine
            return
        if not is_there:
            self._there.pop((role, who), None)
        elif len(self._there) < _MOST_KNOWN:
            self._there[role, who] = told
            self._judge(role, who, told)
        self._alive = {role for role, _ in self._there} - {_PAIR, _READY}

    def _judge(self, role: str, who: str, told: str) -> None:
        """Tell a second one of a kind as an event."""
        if role == PEER.get(self.role):
            self._told = told
        elif role != self.role:
            return
        first = next(other for other in self._there if other[0] == role)
        if first != (role, who) or (role == self.role and who != self._who):
            text = f"a second {role} ({_process(who)}) of engine {self.config.engine!r} is refused"
            self.note(f"second-{role}", text)

    def note(self, code: str, text: str) -> None:
        """Let the log of this process have an event; of a flood the first."""
        if len(self._notices) < _MOST_KNOWN:
            self._notices.append((code, text))

    def attend(self) -> None:
        """Look who is there, and say which controller this plant has; a few times a second."""
        self.alive()
        if self.role != "plant":
            return
        partner = next((who for role, who in self._there if role == "controller"), "")
        if partner != self._partner:
            if self._pair is not None:
                give_back(self._pair.undeclare)
            self._partner = partner
            self._pair = self._present(f"{_PAIR}/{partner}/{_NO_TERMS}") if partner else None

    def is_met(self) -> bool:
        """Whether the peer takes part, fits, and has no other partner.

        Raises: ConfigError when the two do not fit; RefusedError when the plant has another one
        """
        self.attend()
        peer = PEER[self.role]
        if self._told and self._terms is not None and self._told != _NO_TERMS:
            self._agree(peer)
        if peer not in self._alive:
            return False
        if self.role == "plant":
            return self._is_awaited()
        paired = [who for role, who in self._there if role == _PAIR]
        if self._who in paired:
            return True
        if paired:
            self._wait_in_vain(paired[0])
        return False

    def _is_awaited(self) -> bool:
        """Whether the controller of this plant waits for it; one without terms does not say so."""
        is_silent = self._there.get(("controller", self._partner)) == _NO_TERMS
        return is_silent or (_READY, self._partner) in self._there

    def ready(self) -> None:
        """Tell the plant, as its controller, that it may begin."""
        if self.role == "controller" and self._ready is None:
            self._ready = self._present(f"{_READY}/{self._who}/{_NO_TERMS}")

    def _wait_in_vain(self, partner: str) -> None:
        """A plant lets go of a controller that has ended; of one that goes on it does not.

        Raises: RefusedError
        """
        now_s = time.monotonic()
        self._vain_s = self._vain_s or now_s
        if now_s - self._vain_s > _PATIENCE_S:
            raise RefusedError(
                f"the plant of engine {self.config.engine!r} has a controller already:"
                f" {_process(partner)}"
            )

    def _agree(self, peer: Role) -> None:
        """Compare the peer's terms with ours.

        Raises: ConfigError naming what differs
        """
        assert self._terms is not None
        line = misfit(self.role, self._terms, _values(peer, self._told))
        if line:
            time.sleep(_LINGER_S)
            raise ConfigError(line)

    def absence(self) -> str:
        """Say who is there in place of the peer, nothing where nobody is."""
        peer = PEER[self.role]
        if peer in self._alive:
            return f": the {peer} there does not wait for it yet"
        engine = self._others.get(peer)
        return f": the {peer} there is of engine {engine!r}" if engine else ""

    def notices(self) -> list[tuple[str, str]]:
        """Return (code, text) of what happened around the session since the last time."""
        if not self._notices:
            return []
        taken, self._notices = self._notices, []
        return taken

    def close(self) -> None:
        """Leave; a second call does nothing."""
        if not self.session.is_closed():
            held = (self._token, self._pair, self._ready)
            tokens = [token.undeclare for token in held if token is not None]
            give_back(*tokens, self._seen.undeclare, self.session.close)


def is_heard(publisher: zenoh.Publisher) -> bool:
    """Whether a subscriber is known by now; a put before that would go nowhere."""
    # The stub declares a bool; the library returns an object with this one field.
    status: object = publisher.matching_status
    return bool(getattr(status, "matching", status))


def misfit(role: Role, ours: Terms, theirs: tuple[int, ...]) -> str:
    """Say in one line in what the peer differs, nothing when it fits."""
    from hil.config.terms import known_names  # noqa: PLC0415 - all engines, for a refusal alone
    from hil.wire import terms as wire  # noqa: PLC0415 - as in `announce`

    differing = wire.differences(ours, theirs, known_names())
    return f"{role} and {PEER[role]} do not fit: {'; '.join(differing)}" if differing else ""


def _values(sender: str, told: str) -> tuple[int, ...]:
    """The values of terms as presence tells them; none of what is no terms."""
    from hil.wire import terms as wire  # noqa: PLC0415 - as in `announce`

    try:
        return wire.decode(sender, bytes.fromhex(told)) or ()
    except ValueError:
        return ()


def _process(who: str) -> str:
    pid = who.partition("-")[0]
    return f"process {pid}" if pid.isdecimal() else "a process"


def _opened(role: Role, config: ZenohSection, *, lockstep: bool) -> zenoh.Session:
    """Open the session, closed to those who may not enter the directory of its socket.

    Raises: RefusedError naming who is there already, LinkError
    """
    tree = session_config(role, config, lockstep=lockstep)
    own = {"plant": config.plant_endpoint, "controller": config.controller_endpoint}.get(role)
    try:
        session = zenoh.open(zenoh.Config.from_json5(json.dumps(tree)))
    except zenoh.ZError as error:
        there = "" if own is None else _listener(own)
        if there:
            _tell_of_second(role, config, lockstep=lockstep)
            line = f"a {role} of engine {config.engine!r} is there already: {there} at {own}"
            raise RefusedError(line) from None
        raise LinkError(f"zenoh: {role} cannot open {own or 'a session'}: {error}") from None
    if own is not None:
        guard(own)
    return session


def _listener(endpoint: str) -> str:
    """Who listens at a unix socket, nothing where nobody does."""
    protocol, _, path = endpoint.partition("/")
    if protocol != "unixsock-stream":
        return ""
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(path)
            found = probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _UCRED.size)
        except OSError:
            return ""
    pid, uid, _ = _UCRED.unpack(found)
    return f"process {pid} of user {uid}"


def _tell_of_second(role: Role, config: ZenohSection, *, lockstep: bool) -> None:
    """Let the one that is there log that another one came."""
    tree = session_config("bench", config, lockstep=lockstep)
    with (
        contextlib.suppress(zenoh.ZError),
        zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session,
    ):
        token = f"hil/{config.engine}/alive/{role}/{os.getpid()}-{session.zid()}/{_NO_TERMS}"
        with session.liveliness().declare_token(token):
            time.sleep(_LINGER_S)
