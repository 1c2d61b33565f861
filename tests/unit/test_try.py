"""`./try` says what it does, step by step, and leaves standard output to the run."""

import os
import pty
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PIP = """#!/bin/sh
echo "Obtaining file:///somewhere"
echo "Collecting numpy>=1.26 (from fpeg-hil==0.1.0)"
echo "  Downloading numpy-2.0.whl (1 MB)"
echo "Installing collected packages: numpy, fpeg-hil"
exit ${PIP_EXIT:-0}
"""


@pytest.fixture
def checkout(tmp_path):
    """A checkout whose interpreter and `hil` only tell how they were called."""
    shutil.copy(ROOT / "try", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name, text in {"python": PIP, "hil": '#!/bin/sh\necho "hil $*"\n'}.items():
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    return tmp_path


def _try(checkout, *arguments, **environment):
    return subprocess.run(
        [checkout / "try", *arguments], capture_output=True, text=True, timeout=30,
        env=os.environ | environment, check=False,
    )  # fmt: skip


def test_each_step_is_a_line_and_the_output_is_the_run_s_alone(checkout):
    done = _try(checkout, "--fast", "steady", "--json")
    assert done.returncode == 0
    assert done.stdout.splitlines() == ["hil compile", "hil run steady --json"]
    assert done.stderr.splitlines() == [
        "try: installing into .venv, once; a minute or two",
        "  Collecting numpy>=1.26",
        "  Installing what was collected",
        "try: compiling the loops, once; a minute or two",
        "try: hil run steady --json",
    ]


def test_what_is_installed_is_not_installed_again(checkout):
    _try(checkout)
    assert _try(checkout).stderr == "try: hil run load-decrease\n"


def test_an_installation_that_fails_is_no_run(checkout):
    done = _try(checkout, PIP_EXIT="1")
    assert done.returncode == 1
    assert done.stdout == ""
    assert _try(checkout).stdout == "hil run load-decrease\n"


def test_in_a_terminal_the_packages_are_one_line_that_changes(checkout):
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal:
        subprocess.run([checkout / "try"], stdout=terminal, stderr=terminal, timeout=30, check=True)
        told = os.read(ours, 4096).decode()
    os.close(ours)
    assert "\r\033[K  Collecting numpy>=1.26\r\033[K  Installing what was collected\r\033[K" in told
