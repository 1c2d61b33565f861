"""`hil run` with real processes: verdicts, exit codes, kills, interrupts."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from run_rig import children_of, start

import hil.log

HIL = [sys.executable, "-m", "bench.cli"]
LOCKSTEP = ["--clock", "lockstep", "--no-report"]


def run(*arguments):
    return hil_command("run", *arguments)


def hil_command(*arguments):
    return subprocess.run(
        [*HIL, *arguments], capture_output=True, text=True, timeout=90, check=False
    )


def summary_of(directory):
    return json.loads((directory / "summary.json").read_text())


def test_a_load_step_in_memory_is_settled_in_time(tmp_path):
    done = run("load-decrease", "--link", "memory", *LOCKSTEP, "--out", str(tmp_path))
    assert (done.returncode, done.stderr) == (0, "")
    told = summary_of(tmp_path)
    assert told["verdict"] == "met"
    assert told["figures"]["settling_s"] <= 0.175
    assert told["figures"]["plant_ticks"] == told["figures"]["controller_ticks"] == 2500
    assert told["events"][0]["t_s"] == pytest.approx(1.1094, abs=1e-3)


def test_an_expectation_that_is_not_met_is_exit_1(tmp_path):
    done = run("load-decrease", "--controller", "open-loop", "--link", "memory", *LOCKSTEP,
               "--out", str(tmp_path))  # fmt: skip
    assert done.returncode == 1
    assert "✗ TDC within ±0.1 mm" in done.stdout
    assert summary_of(tmp_path)["exit_code"] == 1


def made_run(directory, text, *options):
    """Run a scenario of its own text in memory."""
    scenario = directory / "own.toml"
    scenario.write_text(f'name = "own"\nbegins = "settled"\nrun.duration_s = 0.6\n{text}')
    out = str(directory / "out")
    return run(str(scenario), "--link", "memory", *LOCKSTEP, "--out", out, *options)


def test_a_scenario_that_expects_nothing_says_so(tmp_path):
    done = made_run(tmp_path, "")
    assert (done.returncode, done.stderr) == (0, "")
    assert "own: nothing expected" in done.stdout
    assert summary_of(tmp_path / "out")["verdict"] == "none"


@pytest.mark.parametrize(
    ("event", "told"),
    [
        ('kind = "set-point"\ntdc_ref_m = 0.03', "tdc_ref_m=0.03 from scenario: accepted up to"),
        ('kind = "law"\nlaw = "cycle"', "here every stroke fires"),
    ],
    ids=["set point", "law"],
)
def test_a_refused_event_is_exit_4_and_told_with_its_bound(tmp_path, event, told):
    text = f'plant.model = "nonlinear"\n[events.change]\nat_s = 0.2\n{event}\n'
    done = made_run(tmp_path, text + '[expect.engine]\nmode = "generating"\n')
    assert done.returncode == 4
    (line,) = [line for line in done.stdout.splitlines() if " refused: " in line]
    assert "event 'change' refused: " in line
    assert told in line
    assert summary_of(tmp_path / "out")["verdict"] == "blocked"


def test_the_final_mode_is_known_of_a_log_that_has_lost_its_beginning(tmp_path):
    text = 'plant.prototype = "nu"\n[events.stop]\nkind = "stop"\nat_s = 0.1\n[expect.e]\n'
    options = ["--set", "run.duration_s=6.0", "--log-segment", "1s", "--log-retain", "256KiB"]
    done = made_run(tmp_path, text + 'mode = "off"\n', *options)
    assert not (tmp_path / "out" / "controller.0001.mcap").exists()
    assert (done.returncode, done.stderr) == (0, "")


def test_an_impossible_begin_is_exit_2_and_leaves_nothing(tmp_path):
    done = run("steady", "--controller", "open-loop", "--set", "controller.preset.fuel_kg=5e-6",
               "--out", str(tmp_path / "out"))  # fmt: skip
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_memory_and_zenoh_give_the_same_strokes(tmp_path):
    strokes = []
    for link in ("memory", "zenoh"):
        out = tmp_path / link
        done = run("load-increase", "--link", link, *LOCKSTEP, "--out", str(out),
                   "--set", "run.duration_s=1.5")  # fmt: skip
        assert done.returncode == 0, done.stderr
        with hil.log.open(out / "plant.mcap") as log:
            truth = log.array("/truth")
        strokes.append([truth[name].tobytes() for name in truth.dtype.names])
    assert strokes[0] == strokes[1]


def test_report_rebuilds_what_a_run_wrote(tmp_path):
    pytest.importorskip("matplotlib")
    run("load-decrease", "--link", "memory", *LOCKSTEP, "--out", str(tmp_path))
    first = summary_of(tmp_path)
    (tmp_path / "report.html").unlink(missing_ok=True)
    done = hil_command("report", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "report.html").stat().st_size > 100_000
    assert summary_of(tmp_path) == first


@pytest.mark.parametrize("clock", [pytest.param("lockstep", marks=pytest.mark.slow), "realtime"])
@pytest.mark.parametrize(("killed", "survivor"), [("plant", "controller"), ("controller", "plant")])
def test_a_killed_process_leaves_two_whole_logs_and_one_line(tmp_path, clock, killed, survivor):
    process = start(tmp_path, "--clock", clock)
    pid = children_of(process.pid)[f"{killed}.main"]
    os.kill(pid, signal.SIGKILL)
    _, err = process.communicate(timeout=40)
    assert process.returncode == 3
    assert len(err.strip().splitlines()) == 1
    assert err.startswith(f"{killed} (pid {pid}) was killed by SIGKILL at tick ")
    assert f"; {survivor} reached its safe state; logs: {tmp_path}" in err
    for name in ("plant", "controller"):
        with hil.log.open(tmp_path / f"{name}.mcap") as log:
            assert len(log.array("/timing")) > 30  # killed as soon as both logs have begun
    assert summary_of(tmp_path)["verdict"] == "fault"


@pytest.mark.parametrize("link", ["zenoh", "memory"])
def test_an_interrupt_ends_all_in_order(tmp_path, link):
    process = start(tmp_path, "--clock", "lockstep", "--link", link)
    children = children_of(process.pid)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=40)
    assert process.returncode == 130
    assert err.strip() == f"interrupted; logs: {tmp_path}"
    assert children
    assert not any(Path(f"/proc/{pid}").exists() for pid in children.values())
    with hil.log.open(tmp_path / "plant.mcap") as log:
        assert log.metadata["recorder"]["end"] == "closed"
