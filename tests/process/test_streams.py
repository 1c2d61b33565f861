"""Standard streams that are closed, full or unread, and a machine that refuses: the right code."""

import json
import resource
import subprocess
import time

import pytest
from run_rig import HIL, ended, start

RUN = [*HIL, "run", "steady", "--no-report", "--clock", "lockstep", "--link", "memory"]
SHORT = ["--set", "run.duration_s=0.2"]


def shell(out, redirection, *, before="true", more=(), command=RUN):
    """Run a command with its streams redirected by a shell; returns exit code and errors."""
    words = [*command, *SHORT, *more, "--out", str(out)] if command is RUN else command
    line = f'{before}; "$@" {redirection}'
    done = subprocess.run(
        ["bash", "-c", line, "-", *words], capture_output=True, text=True, timeout=60, check=False
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-", "</dev/null"])
@pytest.mark.parametrize("link", ["memory", "zenoh"])
def test_a_closed_stream_takes_nothing_from_a_run(tmp_path, closed, link):
    assert shell(tmp_path, closed, more=["--link", link]) == (0, "")
    assert json.loads((tmp_path / "summary.json").read_text())["verdict"] == "met"


def test_a_run_outlives_its_reader_and_says_by_its_code_that_it_had_none(tmp_path):
    code, err = shell(tmp_path, "| true; exit ${PIPESTATUS[0]}")
    assert (code, err) == (141, "")
    assert json.loads((tmp_path / "summary.json").read_text())["verdict"] == "met"


def test_a_table_without_a_reader_is_141(tmp_path):
    command = [*HIL, "scenarios"]
    assert shell(tmp_path, "| true; exit ${PIPESTATUS[0]}", command=command) == (141, "")


@pytest.mark.parametrize("command", [RUN, [*HIL, "scenarios"]], ids=["run", "scenarios"])
def test_a_full_device_is_named_and_no_verdict(tmp_path, command):
    line = "standard output: No space left on device\n"
    assert shell(tmp_path, ">/dev/full", command=command) == (3, line)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_signs_that_a_terminal_has_not_are_spelled(tmp_path, encoding):
    done = subprocess.run(
        ["env", f"PYTHONIOENCODING={encoding}", *RUN, *SHORT, "--out", str(tmp_path)],
        capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"  + " in done.stdout


def test_too_few_file_handles_are_told_before_anything_begins(tmp_path):
    code, err = shell(tmp_path, "", before="ulimit -n 20")
    assert (code, err) == (3, "20 file handles are allowed, a run needs 40: ulimit -n\n")


def test_too_little_memory_is_one_line(tmp_path):
    def few_bytes():
        resource.setrlimit(resource.RLIMIT_AS, (190 << 20, 190 << 20))

    done = subprocess.run(
        [*RUN, *SHORT, "--out", str(tmp_path)], capture_output=True, text=True, timeout=60,
        check=False, preexec_fn=few_bytes,
    )  # fmt: skip
    assert done.returncode in {0, 3}
    assert "Traceback" not in done.stderr


def test_a_directory_that_is_taken_away_is_named_at_the_end(tmp_path):
    with ended(start(tmp_path / "out", "--clock", "lockstep", "--link", "memory")) as process:
        (tmp_path / "out").rename(tmp_path / "elsewhere")
        process.terminate()
        begin_s = time.monotonic()
        _, err = process.communicate(timeout=40)
        assert time.monotonic() - begin_s < 20.0
    assert process.returncode == 3
    (line,) = err.splitlines()
    assert line.startswith(f"{tmp_path / 'out' / 'summary.json'}: No such file or directory")
