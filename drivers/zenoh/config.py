"""Which Zenoh endpoints are accepted, and the session configuration that follows from them.

Nothing is found by scouting: a session talks to the endpoints it was told, and those stay on this
machine unless mutual TLS protects them or the configuration takes the risk by name.
"""

from __future__ import annotations

import ipaddress
import re
from typing import Final, Literal, NamedTuple

from drivers.zenoh.access import access_control
from drivers.zenoh.sockets import ZenohSection
from hil.errors import ConfigError
from hil.wire import commands, status

Role = Literal["plant", "controller", "bench"]

FRAMES_BYTES: Final = 1024
"""The longest batch of one tick that is taken in."""

LONGEST_BYTES: Final = 4 * commands.MAX_BYTES
"""The longest message of any kind; a command beyond its own limit is refused where it is read."""

ACCEPTED: Final = "tcp/HOST:PORT, tls/HOST:PORT or unixsock-stream//PATH"
_SOCKET: Final = re.compile(r"unixsock-stream/(?P<path>/[A-Za-z0-9._/-]{1,99})", re.ASCII)
_NETWORK: Final = re.compile(
    r"(?P<protocol>tcp|tls)/(?:\[(?P<six>[0-9A-Fa-f:.]{2,45})\]|(?P<host>[A-Za-z0-9.-]{1,253}))"
    r":(?P<port>[0-9]{1,5})",
    re.ASCII,
)


class Endpoint(NamedTuple):
    """What an endpoint says: its protocol, and whether it can reach beyond this machine."""

    protocol: str
    local: bool


def parse_endpoint(endpoint: str, key: str) -> Endpoint:
    """Read an endpoint; metadata and per-endpoint options (`?`, `#`) are not accepted.

    Raises: ConfigError when it is none of the accepted forms
    """
    if _SOCKET.fullmatch(endpoint):
        return Endpoint("unixsock-stream", local=True)
    match = _NETWORK.fullmatch(endpoint)
    if match is None or not 1 <= int(match["port"]) <= 65_535:
        raise ConfigError(f"{key} = {endpoint!r}: accepted {ACCEPTED}")
    return Endpoint(match["protocol"], _is_loopback(match["six"] or match["host"]))


def _is_loopback(host: str) -> bool:
    """Only a literal loopback address counts; a name may resolve to anything."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_endpoint(endpoint: str, key: str, config: ZenohSection) -> Endpoint:
    """Refuse what leaves the machine without mutual TLS.

    Raises: ConfigError when the endpoint is malformed, insecure or lacks its certificates
    """
    parsed = parse_endpoint(endpoint, key)
    if parsed.protocol == "tls" and config.tls is None:
        raise ConfigError(f"{key} = {endpoint!r}: needs link.zenoh.tls (mutual TLS)")
    if not (parsed.local or parsed.protocol == "tls" or config.allow_insecure):
        raise ConfigError(
            f"{key} = {endpoint!r} leaves this machine unprotected: accepted a loopback address,"
            " a unix socket, tls/ with link.zenoh.tls, or link.zenoh.allow_insecure = true"
        )
    return parsed


def check_endpoints(config: ZenohSection) -> tuple[Endpoint, Endpoint]:
    """Check both endpoints, whichever side opens them; return (plant's, controller's).

    Raises: ConfigError when one is refused or both are the same
    """
    if config.plant_endpoint == config.controller_endpoint:
        raise ConfigError(
            f"link.zenoh.controller_endpoint = {config.controller_endpoint!r}: accepted anything"
            " but the plant's endpoint"
        )
    return (
        check_endpoint(config.plant_endpoint, "link.zenoh.plant_endpoint", config),
        check_endpoint(config.controller_endpoint, "link.zenoh.controller_endpoint", config),
    )


def session_config(role: Role, config: ZenohSection, *, lockstep: bool) -> dict[str, object]:
    """Return the session's configuration tree: no scouting, only the endpoints of the role.

    In lockstep the low-latency transport halves the round trip: it writes from the sender's
    thread. In real time that write could block on a stopped peer, so the queued transport is used.

    Raises: ConfigError as `check_endpoints`
    """
    endpoints = check_endpoints(config)
    plant, controller = config.plant_endpoint, config.controller_endpoint
    listen = {"plant": [plant], "controller": [controller], "bench": []}[role]
    connect = {"plant": [], "controller": [plant], "bench": [plant, controller]}[role]
    return {
        "mode": "peer",
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # Opening returns at once; who is there is asked for by name afterwards.
        "open": {"return_conditions": {"connect_scouted": False, "declares": False}},
        "listen": {"endpoints": listen, "timeout_ms": 0, "exit_on_failure": True},
        "connect": {
            "endpoints": connect,
            "timeout_ms": -1,  # retry for as long as the session lives, in the background
            "exit_on_failure": False,
            "retry": {"period_init_ms": 20, "period_max_ms": 200, "period_increase_factor": 1.5},
        },
        "low_pass_filter": _bounds(config),
        **access_control(config),
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": {"lowlatency": lockstep, "qos": {"enabled": not lockstep}},
            "link": {
                "protocols": sorted({endpoint.protocol for endpoint in endpoints}),
                "rx": {"max_message_size": LONGEST_BYTES},
                # A send finds one of 16 buffers free or drops at once: it never waits.
                "tx": {
                    "queue": {
                        "size": {"real_time": 16},
                        "congestion_control": {"drop": {"wait_before_drop": 0}},
                    }
                },
                **_tls(config),
            },
        },
    }


def _bounds(config: ZenohSection) -> list[dict[str, object]]:
    """Return how long what comes from outside may be; what is longer never reaches a queue."""
    longest = {"frames/*": FRAMES_BYTES, "status/*": 2 * status.MAX_BYTES, "**": LONGEST_BYTES}
    return [
        {
            "flows": ["ingress"],
            "messages": ["put", "delete", "query", "reply"],
            "key_exprs": [f"hil/{config.engine}/{keys}"],
            "size_limit": size,
        }
        for keys, size in longest.items()
    ]


def _tls(config: ZenohSection) -> dict[str, object]:
    """Return the TLS part: both sides show a certificate and check the other's."""
    if config.tls is None:
        return {}
    certificate, key = str(config.tls.certificate), str(config.tls.private_key)
    return {
        "tls": {
            "root_ca_certificate": str(config.tls.root_ca_certificate),
            "listen_certificate": certificate,
            "listen_private_key": key,
            "connect_certificate": certificate,
            "connect_private_key": key,
            "enable_mtls": True,
            "verify_name_on_connect": True,
        }
    }
