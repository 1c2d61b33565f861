"""The installer on the file system of another machine: complete, repeatable, reversible."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from drivers.zenoh.sockets import SERVICES
from hil import compiled

SYSTEMD = Path(__file__).resolve().parents[2] / "systemd"


def run(name: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [SYSTEMD / name, *map(str, arguments)], capture_output=True, text=True, check=False
    )


def install(root: Path, *arguments: str) -> list[str]:
    done = run("install", "--root", root, "--no-packages", *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def files(root: Path) -> set[str]:
    return {str(p.relative_to(root)) for p in root.rglob("*") if p.is_file() or p.is_symlink()}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("root")
    install(root, "--python", "/opt/python/bin/python3", "--cpus", "2,3")
    return root


def test_every_unit_is_there_and_knows_its_interpreter(installed: Path) -> None:
    units = installed / "etc/systemd/system"
    names = {path.name for path in (SYSTEMD / "units").iterdir()}
    assert names <= {path.name for path in units.iterdir()}
    for path in units.rglob("fpeg*"):
        if path.is_file():
            assert "@PYTHON@" not in path.read_text()
    controller = (units / "fpeg-controller.service").read_text()
    assert "ExecStart=/opt/python/bin/python3 -P -m bench.run.service controller" in controller
    assert (units / "fpeg-plant.service.d/cpu.conf").read_text() == "[Service]\nCPUAffinity=2\n"
    assert (units / "fpeg-controller.service.d/cpu.conf").read_text().endswith("CPUAffinity=3\n")


def test_all_packages_and_their_data_are_there(installed: Path) -> None:
    lib = installed / "opt/fpeg-hil/lib"
    assert {"hil", "drivers", "plant", "controller", "bench"} <= {p.name for p in lib.iterdir()}
    assert (lib / "hil/wire/fpeg.dbc").exists()
    assert (lib / "bench/scenarios/load-decrease.toml").exists()
    assert not list(lib.rglob("*.pyc"))


def test_loops_compiled_of_these_sources_are_installed_and_no_others(tmp_path: Path) -> None:
    root, made = tmp_path / "root", tmp_path / "made"
    root.mkdir()
    (made / "0123").mkdir(parents=True)
    told = install(root, "--compiled", str(made))
    assert any(line.startswith("none       /opt/fpeg-hil/compiled") for line in told)
    fitting = made / compiled.key_of(compiled.root())
    fitting.mkdir()
    (fitting / "hil__mypyc.so").write_text("code")
    assert "installed  /opt/fpeg-hil/compiled" in install(root, "--compiled", str(made))
    place = root / "opt/fpeg-hil/compiled"
    assert [path.name for path in place.iterdir()] == [fitting.name]
    assert "unchanged  /opt/fpeg-hil/compiled" in install(root, "--compiled", str(tmp_path))
    controller = (root / "etc/systemd/system/fpeg-controller.service").read_text()
    assert "HIL_COMPILED=/opt/fpeg-hil/compiled" in controller


def test_the_command_is_a_link_within_the_root(installed: Path) -> None:
    link = installed / "usr/local/bin/hil"
    assert str(link.readlink()) == "/opt/fpeg-hil/bin/hil"
    assert (installed / "opt/fpeg-hil/bin/hil").stat().st_mode & 0o111


def test_a_second_run_changes_nothing(installed: Path) -> None:
    before = {name: (installed / name).stat().st_mtime_ns for name in files(installed)
              if not (installed / name).is_symlink()}  # fmt: skip
    lines = install(installed, "--python", "/opt/python/bin/python3", "--cpus", "2,3")
    assert not [line for line in lines if line.startswith("installed")]
    assert before == {name: (installed / name).stat().st_mtime_ns for name in before}


def test_a_changed_configuration_is_kept(tmp_path: Path) -> None:
    install(tmp_path)
    config = tmp_path / "etc/fpeg-hil/engine.toml"
    config.write_text("# mine\n")
    assert any(line.split() == ["kept", "/etc/fpeg-hil/engine.toml"] for line in install(tmp_path))
    assert config.read_text() == "# mine\n"


def test_uninstall_leaves_configuration_and_purge_leaves_nothing(tmp_path: Path) -> None:
    install(tmp_path, "--cpus", "0,1")
    done = run("uninstall", "--root", tmp_path)
    assert done.returncode == 0
    assert files(tmp_path) == {"etc/fpeg-hil/engine.toml", "etc/fpeg-hil/can.conf"}
    assert run("uninstall", "--root", tmp_path, "--purge").returncode == 0
    assert files(tmp_path) == set()
    assert run("uninstall", "--root", tmp_path).stdout == "done\n"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--root", "/no/such/place"], "/no/such/place"),
        (["--cpus", "2"], "PLANT,CONTROLLER"),
        (["--python", "python3"], "absolute"),
        (["--colour", "red"], "--colour"),
        (["--root"], "--root"),
    ],
)
def test_a_wrong_argument_is_named(tmp_path: Path, arguments: list[str], named: str) -> None:
    given = arguments if "--root" in arguments else ["--root", str(tmp_path), *arguments]
    done = run("install", *given)
    assert done.returncode == 2
    assert named in done.stderr


def test_the_installed_configuration_is_accepted() -> None:
    from bench.run.service import read

    path = SYSTEMD / "config/engine.toml"
    scenario = read(path)
    assert not scenario.controller.running
    assert scenario.link.bus == "socketcan:vcan0"


EXPOSED_MOST = 2.0


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize("unit", ["can", "plant", "controller", "recorder@"])
def test_every_unit_is_hardened(installed: Path, tmp_path: Path, unit: str) -> None:
    text = (installed / f"etc/systemd/system/fpeg-{unit}.service").read_text()
    path = tmp_path / f"fpeg-{unit.replace('@', '@1')}.service"
    path.write_text(text)
    told = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", path],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    exposure = re.search(r"exposure level for .*: ([0-9.]+)", told.stdout)
    assert exposure is not None, told.stderr
    assert float(exposure[1]) <= EXPOSED_MOST


def test_both_loops_meet_where_only_the_engines_user_and_group_enter(installed: Path) -> None:
    for side in ("plant", "controller"):
        unit = (installed / f"etc/systemd/system/fpeg-{side}.service").read_text()
        assert "install -d -m 0750 -o fpeg -g fpeg /run/fpeg" in unit
        assert "HIL_RUNTIME_DIRECTORY=/run/fpeg" in unit
        assert "User=fpeg" in unit
        assert "DynamicUser" not in unit
    assert str(SERVICES) == "/run/fpeg"
