"""No endpoint that could leave this machine unprotected gets through."""

import ipaddress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.zenoh.config import (
    check_endpoint,
    check_endpoints,
    parse_endpoint,
    session_config,
)
from hil.config.process import TlsConfig, ZenohConfig
from hil.errors import ConfigError

ENDS = {
    "plant_endpoint": "unixsock-stream//run/fpeg/fpeg-plant.sock",
    "controller_endpoint": "unixsock-stream//run/fpeg/fpeg-controller.sock",
}
PLAIN = ZenohConfig(**ENDS)
TLS = ZenohConfig(
    **ENDS,
    tls=TlsConfig(
        root_ca_certificate="/pki/ca.pem", certificate="/pki/me.pem", private_key="/pki/me.key"
    ),
)
KEY = "link.zenoh.plant_endpoint"

protocols = st.sampled_from(
    ["tcp", "udp", "tls", "quic", "ws", "serial", "unixpipe", "vsock", "unixsock-stream", "TCP", ""]
)
odd_hosts = """127.0.0.1 127.8.9.10 [::1] 0.0.0.0 [::] 224.0.0.224 127.1 0177.0.0.1 2130706433
    localhost localhost.other.example 127.0.0.1.other.example 127.0.0.1@10.0.0.1
    [::ffff:127.0.0.1] [::ffff:10.0.0.1] [::1%eth0] eth0 * /run/x"""
hosts = st.one_of(
    st.ip_addresses(v=4).map(str),
    st.ip_addresses(v=6).map("[{}]".format),
    st.sampled_from(odd_hosts.split()),
    st.text(max_size=20),
)
ports = st.one_of(st.integers(0, 70_000).map(":{}".format), st.text(max_size=6))
tails = st.sampled_from(["", "", "", "?rel=1", "#iface=eth0", "#bind=10.0.0.1:0", ";x", "\n", " "])
endpoints = st.one_of(
    st.builds(lambda p, h, o, t: f"{p}/{h}{o}{t}", protocols, hosts, ports, tails), st.text()
)


def stays_here(endpoint):
    """Whether an endpoint stays on this machine, judged independently of the code under test."""
    protocol, _, rest = endpoint.partition("/")
    if protocol == "unixsock-stream":
        return rest.startswith("/") and not set(rest) & set("?#; \n")
    host, _, port = rest.rpartition(":")
    try:
        loopback = ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
    return protocol in {"tcp", "tls"} and loopback and port.isascii() and port.isdigit()


def accepted(endpoint, config):
    try:
        check_endpoint(endpoint, KEY, config)
    except ConfigError:
        return False
    return True


@given(endpoints)
def test_whatever_is_accepted_by_default_stays_on_this_machine(endpoint):
    if accepted(endpoint, PLAIN):
        assert stays_here(endpoint)
        assert not endpoint.startswith("tls/")


@given(endpoints)
def test_with_certificates_only_tls_may_leave(endpoint):
    if accepted(endpoint, TLS):
        assert stays_here(endpoint) or endpoint.startswith("tls/")


@given(endpoints)
def test_no_option_of_a_locator_gets_through_even_with_allow_insecure(endpoint):
    if accepted(endpoint, ZenohConfig(allow_insecure=True)):
        assert not set(endpoint) & set("?#; \n*@%")
        assert endpoint.split("/")[0] in {"tcp", "unixsock-stream"}


@given(
    st.ip_addresses(network="127.0.0.0/8") | st.ip_addresses(network="::1/128"),
    st.integers(1, 65_535),
)
def test_every_loopback_address_is_accepted(address, port):
    host = f"[{address}]" if address.version == 6 else str(address)
    assert parse_endpoint(f"tcp/{host}:{port}", KEY) == ("tcp", True)


@pytest.mark.parametrize(
    "endpoint",
    ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/10.0.0.5:7447", "tcp/rig.example:7447",
     "tcp/localhost:7447", "tcp/169.254.1.1:7447"],
)  # fmt: skip
def test_an_open_endpoint_is_refused_with_one_line_and_allowed_by_name(endpoint):
    with pytest.raises(ConfigError, match=r"plant_endpoint = .* leaves this machine unprotected"):
        check_endpoints(ZenohConfig(**(ENDS | {"plant_endpoint": endpoint})))
    config = ZenohConfig(**(ENDS | {"plant_endpoint": endpoint}), allow_insecure=True)
    assert check_endpoints(config)[0] == ("tcp", False)


@pytest.mark.parametrize(
    "endpoint",
    ["udp/127.0.0.1:7447", "udp/224.0.0.224:7446", "quic/127.0.0.1:1", "ws/127.0.0.1:1",
     "serial//dev/ttyS0#baudrate=9600", "vsock/2:1", "unixpipe/x", "tcp/127.0.0.1:0",
     "tcp/127.0.0.1:65536", "unixsock-stream/relative", "", "tcp/127.0.0.1:7447#iface=eth0"],
)  # fmt: skip
@pytest.mark.parametrize("config", [PLAIN, TLS, ZenohConfig(allow_insecure=True)])
def test_other_protocols_and_forms_are_refused_whatever_else_is_set(endpoint, config):
    with pytest.raises(ConfigError, match="accepted tcp/HOST:PORT, tls/HOST:PORT or unixsock"):
        check_endpoint(endpoint, KEY, config)


@given(st.text())
def test_a_refusal_is_one_line_that_names_the_key(endpoint):
    with pytest.raises(ConfigError) as refusal:
        check_endpoint("udp/" + endpoint, KEY, PLAIN)
    assert len(str(refusal.value).splitlines()) == 1
    assert str(refusal.value).startswith(f"{KEY} = ")


def test_the_controllers_endpoint_is_checked_as_well():
    config = PLAIN.model_copy(update={"controller_endpoint": "tcp/0.0.0.0:1"})
    with pytest.raises(ConfigError, match=r"link\.zenoh\.controller_endpoint = 'tcp/0\.0\.0\.0:1'"):
        session_config("plant", config, lockstep=True)


def test_tls_without_certificates_is_refused_even_on_loopback():
    with pytest.raises(ConfigError, match=r"needs link\.zenoh\.tls"):
        check_endpoint("tls/127.0.0.1:7447", KEY, PLAIN)


def test_certificates_do_not_protect_an_endpoint_that_is_not_tls():
    with pytest.raises(ConfigError, match="unprotected"):
        check_endpoint("tcp/10.0.0.5:7447", KEY, TLS)


def test_both_processes_on_one_endpoint_are_refused():
    with pytest.raises(ConfigError, match="anything but the plant's endpoint"):
        check_endpoints(PLAIN.model_copy(update={"controller_endpoint": PLAIN.plant_endpoint}))


@pytest.mark.parametrize("role", ["plant", "controller", "bench"])
@pytest.mark.parametrize("lockstep", [True, False])
def test_no_session_scouts_or_opens_anything_but_its_endpoints(role, lockstep):
    tree = session_config(role, PLAIN, lockstep=lockstep)
    assert tree["mode"] == "peer"
    assert tree["scouting"] == {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
    plant, controller = PLAIN.plant_endpoint, PLAIN.controller_endpoint
    assert (tree["listen"]["endpoints"], tree["connect"]["endpoints"]) == {
        "plant": ([plant], []),
        "controller": ([controller], [plant]),
        "bench": ([], [plant, controller]),
    }[role]
    assert tree["transport"]["link"]["protocols"] == ["unixsock-stream"]


def test_a_tls_session_shows_its_certificate_and_demands_the_others():
    config = TLS.model_copy(update={"plant_endpoint": "tls/10.0.0.5:7447"})
    link = session_config("controller", config, lockstep=False)["transport"]["link"]
    assert link["protocols"] == ["tls", "unixsock-stream"]
    assert link["tls"] == {
        "root_ca_certificate": "/pki/ca.pem",
        "listen_certificate": "/pki/me.pem",
        "listen_private_key": "/pki/me.key",
        "connect_certificate": "/pki/me.pem",
        "connect_private_key": "/pki/me.key",
        "enable_mtls": True,
        "verify_name_on_connect": True,
    }
