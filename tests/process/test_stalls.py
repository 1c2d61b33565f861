"""A run that the machine spoilt has no verdict; one that its controller spoilt was not met."""

import json
import os
import signal
import time

import pytest
from run_rig import ended, family, start

STALL_S = 0.12
SLOW = """
import sys

if "controller.main" in sys.orig_argv:
    import time
    import controller.loop

    fast = controller.loop.step

    def slow(params, state, inputs):
        begin_s = time.monotonic()
        while inputs.tick == 700 and time.monotonic() < begin_s + 0.06:
            pass
        return fast(params, state, inputs)

    controller.loop.step = slow
"""


def verdict_of(directory):
    told = json.loads((directory / "summary.json").read_text())
    return told["verdict"], told["exit_code"], told["exit_reason"]


@pytest.mark.parametrize("stopped", ["controller", "plant"])
def test_a_process_that_was_not_run_for_a_while_has_spoilt_the_run(tmp_path, stopped):
    with ended(start(tmp_path, duration_s=3.0)) as process:
        pid = family(process)[stopped]
        os.kill(pid, signal.SIGSTOP)
        time.sleep(STALL_S)
        os.kill(pid, signal.SIGCONT)
        out, err = process.communicate(timeout=60)
    verdict, code, reason = verdict_of(tmp_path)
    assert (verdict, process.returncode, code, err) == ("blocked", 4, 4, "")
    assert "the machine was 1" in reason
    assert reason.split("; ")[0] in " ".join(out.split())


@pytest.mark.interpreted("the controller's step is replaced by a slow one")
def test_a_controller_that_works_for_too_long_is_told_by_name(tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(SLOW)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with ended(start(tmp_path / "out", duration_s=2.0)) as process:
        process.communicate(timeout=60)
    verdict, code, reason = verdict_of(tmp_path / "out")
    if "the machine" in reason and "tick 700" not in reason:
        pytest.skip(f"this machine has stalled by itself: {reason}")
    assert (verdict, code, process.returncode) == ("not met", 1, 1), reason
    assert "the controller worked for 6" in reason
    assert "on tick 700" in reason
