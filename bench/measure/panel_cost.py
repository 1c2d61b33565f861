"""What the panel costs: lateness and answers with viewers and without, in one run; its own share.

`python -m bench.measure.panel_cost [SECONDS]`. The phases take turns, so that the machine's moods
meet all of them: nobody looks on, three clients that read and drop, and one Chromium where there
is one. One viewer of twenty signals then gives the server's processor use, and set points the time
from a click to the tick in which it acts and to the answer; beside it, by turns, what the same
order takes that goes over the command key alone, without a panel.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from bench.live.engines import engine_of
from drivers.zenoh.channels import ZenohOperator
from hil import log as logs

PHASES: Final = ("nobody", "three viewers", "Chromium")
_TURNS: Final = 4
_CLICKS: Final = 60
_PAUSE_S: Final = 0.037
_SIGNALS: Final = (
    *(f"plant.truth.{name}" for name in ("x_m", "v_m_s", "load_coefficient_n_s_m", "dc_x_m")),
    *(f"plant.sensor.{name}" for name in ("x_m", "v_m_s", "p_left_pa", "p_right_pa",
                                          "electric_power_w")),
    *(f"controller.sensor.{name}" for name in ("x_m", "v_m_s", "p_left_pa", "p_right_pa")),
    *(f"controller.actuator.{name}" for name in ("mode", "force_n", "load_coefficient_n_s_m",
                                                 "throttle", "pulse_count")),
    "plant.timing.late_us", "controller.timing.late_us",
)  # fmt: skip


class Phase(NamedTuple):
    """A stretch of the run, and who looked on [s of the run]."""

    name: str
    start_s: float
    end_s: float


class Click(NamedTuple):
    """An order: when it was given and answered [s of the monotonic clock], and where it acts."""

    begun_s: float
    answered_s: float
    tick: int


class Found(NamedTuple):
    """What the phases and the one viewer gave.

    share: of a core, of the server with one viewer of twenty signals
    clicks, direct: orders through the panel, and over the command key alone
    """

    phases: list[Phase]
    share: float
    samples_hz: float
    clicks: list[Click]
    direct: list[Click]


def main(phase_s: float) -> int:
    """Run, measure, print; returns the exit code."""
    with tempfile.TemporaryDirectory(prefix="hil-panel-") as folder:
        out = Path(folder) / "run"
        long_s = phase_s * (len(PHASES) * _TURNS + 2) + 60.0
        child = _begin(out, long_s)
        assert child.stdout is not None
        try:
            found = asyncio.run(_measure(child.stdout.readline().strip(), out, phase_s))
        finally:
            child.terminate()
            child.communicate()
        _tell(found, out)
    return 0


def _begin(out: Path, long_s: float) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "bench.cli", "run", "steady", "--panel", "0", "--no-report"]
    command += ["--out", str(out), "--set", f"run.duration_s={long_s:g}"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


async def _measure(address: str, out: Path, phase_s: float) -> Found:
    """Let the phases take turns, then one viewer look on and click."""
    offset_s = await _offset(address)
    phases: list[Phase] = []
    for _ in range(_TURNS):
        for name in PHASES:
            async with _looking_on(name, address) as there:
                if there:
                    await asyncio.sleep(1.0)  # who has just come is not what it costs to stay
                    start_s = time.monotonic() - offset_s
                    await asyncio.sleep(phase_s)
                    phases.append(Phase(name, start_s, time.monotonic() - offset_s))
    server = _server_of(out)
    async with _joined(address) as socket:
        before_s, begun_s, samples = _cpu_s(server), time.monotonic(), 0
        while time.monotonic() < begun_s + phase_s:
            samples += _rows(await socket.recv())
        elapsed_s = time.monotonic() - begun_s
        share = (_cpu_s(server) - before_s) / elapsed_s
        clicks, direct = await _by_turns(socket, out)
    return Found(phases, share, samples / elapsed_s, clicks, direct)


async def _by_turns(socket: Any, out: Path) -> tuple[list[Click], list[Click]]:  # noqa: ANN401
    """Give orders through the panel and without it."""
    operator = engine_of(out).operator("panel_cost")
    clicks, direct = [], []
    try:
        for number in range(_CLICKS):
            clicks.append(await _click(socket, number))
            direct.append(await asyncio.to_thread(_ask, operator, number))
            await asyncio.sleep(_PAUSE_S)
    finally:
        operator.close()
    return clicks, direct


def _order(number: int) -> dict[str, object]:
    return {"kind": "set-point", "tdc_ref_m": 0.0155 - 1e-5 * (number % 2)}


def _ask(operator: ZenohOperator, number: int) -> Click:
    begun_s = time.monotonic()
    answer = operator.ask(_order(number), "controller", 5.0)
    return Click(begun_s, time.monotonic(), answer.tick)


@contextlib.asynccontextmanager
async def _looking_on(name: str, address: str) -> AsyncIterator[bool]:
    """Have somebody look on while the body runs; tells whether there is such a one."""
    async with contextlib.AsyncExitStack() as stack:
        if name == "three viewers":
            for _ in range(3):
                reading = asyncio.create_task(
                    _read_on(await stack.enter_async_context(_joined(address)))
                )
                stack.callback(reading.cancel)
        path = shutil.which("chromium")
        if name == "Chromium" and path is not None:
            profile = stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
            browser = await asyncio.create_subprocess_exec(
                path, "--headless", "--no-sandbox", "--remote-debugging-port=0",
                f"--user-data-dir={profile}", address,
                stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
            )  # fmt: skip
            stack.push_async_callback(browser.wait)
            stack.callback(browser.terminate)
            await asyncio.sleep(4.0)  # until it has drawn the page
        yield name != "Chromium" or path is not None


@contextlib.asynccontextmanager
async def _joined(address: str) -> AsyncIterator[Any]:
    from websockets.asyncio.client import connect

    async with connect(address.replace("http", "ws").replace("/?", "/socket?"),
                       max_size=None) as socket:  # fmt: skip
        await socket.send(json.dumps({"do": "show", "signals": _SIGNALS}))
        yield socket


async def _read_on(socket: Any) -> None:  # noqa: ANN401
    async for _ in socket:
        pass


async def _offset(address: str) -> float:
    """What the monotonic clock says when the run begins [s]."""
    async with _joined(address) as socket:
        while True:
            told = await socket.recv()
            if isinstance(told, str) and (m := json.loads(told))["k"] == "status" and "plant" in m:
                return time.monotonic() - float(m["plant"]["t_s"])


def _rows(told: str | bytes) -> int:
    """Samples of twenty signals in a frame, as whole rows."""
    if isinstance(told, str):
        return 0
    size = int.from_bytes(told[:4], "little")
    groups: list[tuple[list[str], int]] = json.loads(told[4 : 4 + size])["groups"]
    return sum(len(names) * count for names, count in groups) // len(_SIGNALS)


async def _click(socket: Any, number: int) -> Click:  # noqa: ANN401
    """Set a set point as the page does."""
    if number == 0:
        await socket.send(json.dumps({"do": "wheel", "wanted": True, "force": True}))
    begun_s = time.monotonic()
    await socket.send(json.dumps({"do": "order", "id": number, "command": _order(number)}))
    while True:
        told = await socket.recv()
        if isinstance(told, str) and (m := json.loads(told))["k"] == "answer" and m["id"] == number:
            return Click(begun_s, time.monotonic(), int(m["tick"]))


def _server_of(out: Path) -> int:
    """Number of the process that serves the panel of a run."""
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            words = (entry / "cmdline").read_bytes().split(b"\0") if entry.name.isdigit() else []
            if b"panel" in words and os.fsencode(out) in words:
                return int(entry.name)
    raise RuntimeError(f"no panel of {out}")


def _cpu_s(pid: int) -> float:
    """Processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _tell(found: Found, out: Path) -> None:
    """Print a line for each kind of phase, and what one viewer costs."""
    with logs.open(out / "controller.mcap") as log:
        timing = log.array("/timing")
    with logs.open(out / "plant.mcap") as log:
        rows = log.array("/timing")
    t_s = rows["t_ns"] * 1e-9
    print(f"{'':14} {'p50':>7} {'p99':>7} {'p99.9':>7} [us late]  answered next tick")
    for name in dict.fromkeys(phase.name for phase in found.phases):
        inside = np.zeros(len(rows), dtype=bool)
        for phase in found.phases:
            inside |= (phase.name == name) & (t_s >= phase.start_s) & (t_s < phase.end_s)
        ran = rows[inside & (rows["missed"] == 0)]
        late_us = (ran["woke_ns"] - ran["scheduled_ns"]) * 1e-3
        p50, p99, p999 = np.percentile(late_us, (50, 99, 99.9))
        answered = float(np.mean(ran["used_tick"] == ran["tick"].astype(np.int64) - 1))
        print(f"{name:14} {p50:7.0f} {p99:7.0f} {p999:7.0f}            {answered:.2%}")
    print(f"one viewer, {len(_SIGNALS)} signals at {found.samples_hz:.0f} Hz:"
          f" {found.share:.1%} of a core")  # fmt: skip
    woke_s = dict(zip(timing["tick"].tolist(), (timing["woke_ns"] * 1e-9).tolist(), strict=True))
    for name, clicks in (("a click", found.clicks), ("the key alone", found.direct)):
        took_ms = [1e3 * (click.answered_s - click.begun_s) for click in clicks]
        print(f"{name:14} to the acting tick: {_quantiles(acting_ms(clicks, woke_s))};"
              f" to the answer: {_quantiles(took_ms)}")  # fmt: skip


def acting_ms(clicks: Sequence[Click], woke_s: Mapping[int, float]) -> list[float]:
    """Return how long each order took to the start of the tick in which it acts [ms].

    Ticks have the clock of the run. No answer comes before its tick, so the beginning of the run
    is at the latest where the quickest answer comes at once; times are at most too long by that.
    """
    begun_s = min(click.answered_s - woke_s[click.tick] for click in clicks)
    return [1e3 * (woke_s[click.tick] + begun_s - click.begun_s) for click in clicks]


def _quantiles(times_ms: Sequence[float]) -> str:
    p50, p95 = np.percentile(times_ms, (50, 95))
    return f"p50 {p50:.1f} ms, p95 {p95:.1f} ms, of {len(times_ms)}"


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 5.0))
