"""Where an engine's sockets are: found by its operator, refused where a stranger could be in."""

import os
from pathlib import Path

import pytest

from drivers.zenoh import sockets
from drivers.zenoh.sockets import VARIABLE, found, made, own_directory, placed
from hil.config.process import ZenohConfig
from hil.errors import ConfigError

ROOT = os.geteuid() == 0


@pytest.fixture(autouse=True)
def nobody_elses(monkeypatch, tmp_path):
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(sockets, "SERVICES", tmp_path / "services")


def private(path):
    path.mkdir(mode=0o700)
    return path


def test_by_default_no_endpoint_is_a_port(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "own"))
    config = placed(ZenohConfig(), "plant")
    assert config.plant_endpoint == f"unixsock-stream/{tmp_path}/own/fpeg-plant.sock"
    assert config.controller_endpoint == f"unixsock-stream/{tmp_path}/own/fpeg-controller.sock"
    assert (tmp_path / "own").stat().st_mode & 0o777 == 0o700


def test_a_port_is_there_where_it_was_chosen(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "own"))
    config = placed(ZenohConfig(plant_endpoint="tcp/127.0.0.1:7447"), "controller")
    assert config.plant_endpoint == "tcp/127.0.0.1:7447"
    assert config.controller_endpoint.startswith("unixsock-stream/")
    both = ZenohConfig(plant_endpoint="tcp/127.0.0.1:1", controller_endpoint="tcp/127.0.0.1:2")
    assert placed(both, "plant") is both


def test_the_users_own_runtime_directory_comes_before_one_in_tmp(monkeypatch, tmp_path):
    assert own_directory() == Path(f"/tmp/hil-{os.geteuid()}")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(private(tmp_path / "xdg")))
    assert own_directory() == tmp_path / "xdg" / "hil"
    (tmp_path / "xdg").chmod(0o777)  # not one that a session made
    assert own_directory() == Path(f"/tmp/hil-{os.geteuid()}")


@pytest.mark.parametrize("mode", [0o777, 0o755, 0o770, 0o701])
def test_a_directory_that_others_enter_or_change_is_refused(tmp_path, mode):
    private(tmp_path / "open").chmod(mode)
    with pytest.raises(ConfigError, match=rf"open: has the mode {mode:04o}; accepted is") as told:
        made(tmp_path / "open")
    assert len(str(told.value).splitlines()) == 1


def test_a_group_may_enter_but_change_nothing(tmp_path):
    private(tmp_path / "group").chmod(0o750)
    assert made(tmp_path / "group") == tmp_path / "group"


@pytest.mark.skipif(not ROOT, reason="only root makes a stranger's directory")
def test_a_strangers_directory_is_refused(tmp_path):
    os.chown(private(tmp_path / "theirs"), 65534, 65534)
    with pytest.raises(ConfigError, match="theirs: belongs to user 65534"):
        made(tmp_path / "theirs")


def test_a_link_to_a_directory_and_a_file_are_none(tmp_path):
    (tmp_path / "link").symlink_to(private(tmp_path / "there"))
    with pytest.raises(ConfigError, match="link: is no directory"):
        made(tmp_path / "link")
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="file: "):
        made(tmp_path / "file")


def test_a_path_that_no_socket_can_have_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, str(tmp_path / ("x" * 90)))
    with pytest.raises(ConfigError, match="too long for a unix socket"):
        placed(ZenohConfig(), "plant")


def test_an_operator_finds_its_own_engine_first_then_that_of_the_units(monkeypatch, tmp_path):
    own, services = tmp_path / "own", private(tmp_path / "services")
    monkeypatch.setenv(VARIABLE, str(own))
    assert found("fpeg") == own
    (services / "fpeg-plant.sock").write_text("")
    assert found("fpeg") == services
    assert found("other") == own
    (own / "fpeg-controller.sock").write_text("")
    assert found("fpeg") == own


def test_an_operator_looks_for_nothing_in_a_strangers_directory(monkeypatch, tmp_path):
    private(tmp_path / "open").chmod(0o777)
    monkeypatch.setenv(VARIABLE, str(tmp_path / "open"))
    with pytest.raises(ConfigError, match="has the mode 0777"):
        placed(ZenohConfig(), "bench")
