"""Shared memory is this user's alone and really there; what a killed process left is no bar."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.links import open_link
from drivers.shm import memory
from drivers.shm.link import BATCH_MAX_BYTES
from drivers.zenoh.sockets import VARIABLE
from hil.config.process import LinkConfig, LoopConfig
from hil.errors import ConfigError, LinkError, MissingExtraError

LOOP = LoopConfig(clock="realtime")
CHILD = """
import sys, time
from drivers.links import open_link
from hil.config.process import LinkConfig, LoopConfig
config = LinkConfig.model_validate_json(sys.argv[2])
connection = open_link(sys.argv[1], config, LoopConfig(clock="realtime"))
connection.link.wait_for_peer(10.0)
print("there", flush=True)
while True:
    connection.link.send(b"x" * 60)
    time.sleep(0.001)
"""


@pytest.fixture
def shm_config(socket_config):
    return LinkConfig(kind="shm", zenoh=socket_config.zenoh)


def child(side, config):
    return subprocess.Popen(
        [sys.executable, "-c", CHILD, side, config.model_dump_json()],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.fixture(autouse=True)
def alone(monkeypatch, sockets):
    """Shared memory that no other test has files in."""
    monkeypatch.setenv(VARIABLE, str(sockets / "own"))
    yield
    for left in Path("/dev/shm").glob(f"{memory.prefix()}*"):  # what the library keeps of all nodes
        left.unlink()


def segments():
    return len(list(Path("/dev/shm").glob(f"{memory.prefix()}*")))


def met_and_killed(connection, config):
    """A controller that the plant has heard, and that is killed in mid-sentence."""
    peer = child("controller", config)
    connection.link.wait_for_peer(10.0)
    assert peer.stdout.readline() == "there\n"
    assert connection.link.wait(2_000_000_000) == b"x" * 60
    os.kill(peer.pid, signal.SIGKILL)
    peer.communicate()


def test_a_killed_controller_can_be_started_again_and_again(shm_config):
    plant = open_link("plant", shm_config, LOOP)
    try:
        before = None
        for _ in range(3):
            met_and_killed(plant, shm_config)
            while plant.link.peer_alive():
                pass
            while plant.link.receive() is not None:
                pass
            plant.link.send(b"y" * 60)  # to nobody: neither hangs nor fails
            before = before or segments()
        assert segments() <= before + 2
    finally:
        plant.close()


def test_both_killed_and_both_started_anew(shm_config):
    pair = [child(side, shm_config) for side in ("plant", "controller")]
    for one in pair:
        assert one.stdout.readline() == "there\n"
    for one in pair:
        os.kill(one.pid, signal.SIGKILL)
        one.communicate()
    plant = open_link("plant", shm_config, LOOP)
    controller = open_link("controller", shm_config, LOOP)
    try:
        plant.link.wait_for_peer(5.0)
        controller.link.wait_for_peer(5.0)
        assert controller.link.receive() is None  # nothing is left of the earlier pair
        plant.link.send(b"n" * 60)
        assert controller.link.wait(2_000_000_000) == b"n" * 60
    finally:
        controller.close()
        plant.close()


def test_a_batch_that_does_not_fit_is_refused(shm_config):
    plant = open_link("plant", shm_config, LOOP)
    with pytest.raises(
        LinkError, match=f"cannot send 1025 bytes, accepted up to {BATCH_MAX_BYTES}"
    ):
        plant.link.send(bytes(BATCH_MAX_BYTES + 1))
    plant.close()


def test_without_the_library_the_extra_is_named(shm_config, monkeypatch):
    monkeypatch.setattr("drivers.shm.link.iox", None)
    with pytest.raises(MissingExtraError, match=r"fpeg-hil\[shm\]"):
        open_link("plant", shm_config, LOOP)
    monkeypatch.undo()
    open_link("plant", shm_config, LOOP).close()  # the refusal held on to nothing


def test_nobody_else_reads_or_writes_what_is_in_shared_memory(shm_config):
    umask = os.umask(0)
    try:
        plant = open_link("plant", shm_config, LOOP)
        controller = open_link("controller", shm_config, LOOP)
    finally:
        os.umask(umask)
    plant.link.wait_for_peer(5.0)
    ours = list(Path("/dev/shm").glob(f"{memory.prefix()}*"))
    assert len(ours) > 4
    assert [path for path in ours if path.stat().st_mode & 0o077] == []
    controller.close()
    plant.close()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes a stranger's directory")
def test_a_strangers_directory_is_refused(shm_config, monkeypatch, sockets):
    own = sockets / "strange"
    (own / "iceoryx2").mkdir(parents=True)
    own.chmod(0o700)
    os.chown(own / "iceoryx2", 65534, 65534)
    monkeypatch.setenv(VARIABLE, str(own))
    with pytest.raises(ConfigError, match="iceoryx2: belongs to user 65534"):
        open_link("plant", shm_config, LOOP)


SMALL = """
import sys
from drivers.links import open_link
from drivers.system.process import guarded
from hil.config.process import LinkConfig, LoopConfig
def both():
    config = LinkConfig.model_validate_json(sys.argv[1])
    pair = [open_link(side, config, LoopConfig()) for side in ("plant", "controller")]
    for connection in pair:
        connection.link.wait_for_peer(10.0)
    with open("/dev/shm/somebody-elses", "wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass
    for _ in range(4000):
        pair[0].link.send(bytes(1000))
    return 0
sys.exit(guarded(both))
"""


@pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("unshare") is None, reason="needs a mount of its own"
)
@pytest.mark.parametrize(("size", "code"), [("64k", 3), ("3m", 3), ("6m", 3), ("12m", 0)])
def test_small_or_full_shared_memory_is_one_line_and_no_bus_error(shm_config, size, code):
    mounted = f'mount -t tmpfs -o size={size} tmpfs /dev/shm || exit 77; exec "$@"'
    program = [sys.executable, "-c", SMALL, shm_config.model_dump_json()]
    told = subprocess.run(
        ["unshare", "-m", "sh", "-c", mounted, "sh", *program],
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    if told.returncode == 77 or "unshare" in told.stderr:
        pytest.skip("no mount of its own here")
    assert told.returncode == code, told.stderr
    if code:
        assert told.stderr.startswith("shm: /dev/shm has ")
        assert len(told.stderr.splitlines()) == 1
