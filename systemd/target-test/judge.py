"""What the guest brought back, against what is asked of the target."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import hil.log

BOTH_HZ, ALONE_HZ = 500, 1000
WARM_UP_S = 3.0
CONTROLLER_MOST = 150_000
ROUND_TRIP_P99_US = 150.0
RESUME_S = 1.0
GROWTH = 1.10


class Finding(NamedTuple):
    """One thing that was looked at."""

    held: bool
    text: str


def read_checks(path: Path) -> list[Finding]:
    """Read what the guest checked itself; a test that did not reach its end has failed."""
    if not path.exists():
        return [Finding(False, "the guest's test did not begin")]
    rows = [line.split("\t") for line in path.read_text().splitlines()]
    found = [Finding(row[0] == "PASS", f"{row[2]} ({row[1]} s)") for row in rows if row[0] != "END"]
    return [*found, Finding(bool(rows) and rows[-1][0] == "END", "the guest's test was complete")]


def judge_timing(out: Path, budget: Path, *, update: bool) -> list[Finding]:
    """Judge logs, counters and round trips of the timing boot."""
    costs = instructions(out / "counters.tsv")
    return [
        *judge_both(out / "both"),
        *judge_alone(out),
        Finding(costs["controller at 1 kHz"] <= CONTROLLER_MOST,
                f"controller: {costs['controller at 1 kHz']:,} instructions a tick at 1 kHz, "
                f"at most {CONTROLLER_MOST:,}"),
        *judge_budget(costs, budget, update=update),
    ]  # fmt: skip


def blocks(path: Path, topic: str) -> np.ndarray[Any, Any]:
    """All records of a topic as one array."""
    with hil.log.open(path) as log:
        return np.concatenate(list(log.blocks(topic)))


def spread_us(values_ns: np.ndarray[Any, Any]) -> str:
    """p50/p99/max in microseconds."""
    p50, p99 = np.percentile(values_ns, (50, 99)) / 1e3
    return f"{p50:.1f}/{p99:.1f}/{values_ns.max() / 1e3:.1f} us"


def judge_both(logs: Path) -> list[Finding]:
    """Both services at 500 Hz, to the kill of the controller, and its return."""
    period_ns = round(1e9 / BOTH_HZ)
    (plant_log,) = sorted((logs / "plant").glob("*.mcap"))
    first, second = sorted((logs / "controller").glob("*.mcap"))
    controller = blocks(first, "/timing")
    plant = blocks(plant_log, "/timing")
    last = int(controller["tick"][-1]) - 1
    begin = round(WARM_UP_S * BOTH_HZ)
    plant = plant[(plant["tick"] >= begin) & (plant["tick"] <= last)]
    controller = controller[controller["tick"] >= begin]
    late_ns = (plant["woke_ns"] - plant["scheduled_ns"]).astype(np.int64)
    overdue = (plant["done_ns"] - plant["scheduled_ns"]).astype(np.int64) > period_ns
    missed = int(plant["missed"].sum() + overdue.sum())
    unanswered = int((plant["used_tick"] != plant["tick"] - 1).sum())
    skipped = int(controller["missed"].sum())
    seconds = (last - begin) / BOTH_HZ
    return [
        Finding(seconds >= 20.0, f"both at {BOTH_HZ} Hz for {seconds:.1f} s of guest time"),
        Finding(missed == 0, f"plant: {missed} missed deadlines, woke {spread_us(late_ns)} late"),
        Finding(skipped == 0, f"controller: {skipped} missed ticks"),
        Finding(unanswered == 0, f"{unanswered} ticks not answered within the next tick"),
        resume(second),
    ]


def resume(log_file: Path) -> Finding:
    """The second controller's way from its first tick back to generating."""
    first = int(blocks(log_file, "/timing")["tick"][0])
    with hil.log.open(log_file) as log:
        modes = [r.tick for r in log.records("/event") if r.code == "mode generating"]
    if not modes:
        return Finding(False, "a controller that came back did not run the engine again")
    took_s = (modes[0] - first) / BOTH_HZ
    return Finding(took_s <= RESUME_S, f"a controller that came back ran the engine {took_s:.2f} s "
                   "after its first tick")  # fmt: skip


def judge_alone(out: Path) -> list[Finding]:
    """The controller alone at 1 kHz against the source of samples."""
    told = json.loads((out / "source.json").read_text())
    trips = np.array(told["trips_ns"], dtype=np.int64)
    answered = np.flatnonzero(trips > 0)
    trips = trips[answered[0] + round(WARM_UP_S * ALONE_HZ) : answered[-1]]
    lost = int((trips < 0).sum())
    trips = trips[trips > 0]
    late = int((trips > round(1e9 / ALONE_HZ)).sum())
    p99_us = float(np.percentile(trips, 99)) / 1e3
    seconds = len(trips) / ALONE_HZ
    return [
        Finding(seconds >= 20.0, f"controller alone at 1 kHz for {seconds:.1f} s of guest time"),
        Finding(lost + late == 0, f"{lost} samples without an answer in time, {late} late"),
        Finding(p99_us <= ROUND_TRIP_P99_US, f"sensor to actuator {spread_us(trips)}, p99 at most "
                f"{ROUND_TRIP_P99_US:g} us"),
    ]  # fmt: skip


def instructions(path: Path) -> dict[str, int]:
    """Processor time of each process a tick, of all its threads: 1 ns is one instruction."""
    spent: dict[tuple[str, str], float] = defaultdict(float)
    times: dict[str, list[float]] = defaultdict(list)
    for line in path.read_text().splitlines():
        phase, point, name, uptime_s, _, ran_ns = line.split("\t")
        sign = 1.0 if point == "end" else -1.0
        spent[phase, name] += sign * float(ran_ns)
        times[f"{phase} {point}"].append(float(uptime_s))
    costs = {}
    for (phase, name), ran_ns in spent.items():
        rate_hz = BOTH_HZ if phase == "both" else ALONE_HZ
        elapsed_s = np.mean(times[f"{phase} end"]) - np.mean(times[f"{phase} begin"])
        at = "500 Hz" if phase == "both" else "1 kHz"
        costs[f"{name} at {at}"] = round(ran_ns / (elapsed_s * rate_hz))
    return costs


def judge_budget(costs: dict[str, int], budget: Path, *, update: bool) -> list[Finding]:
    """Compare with what is stored; no process may have grown by more than a tenth."""
    if update:
        budget.write_text(json.dumps(costs, indent=2) + "\n")
    stored = json.loads(budget.read_text()) if budget.exists() else {}
    return [
        Finding(
            name in stored and cost <= GROWTH * stored[name],
            f"{name}: {cost:,} instructions a tick, stored {stored.get(name, 'nothing')}",
        )
        for name, cost in costs.items()
    ]
