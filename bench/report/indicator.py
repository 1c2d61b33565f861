"""The last cycles of a detailed engine, run again from its log at a tenth of the tick.

A stroke has some 15 ticks at 1 kHz, too few for a pressure-volume diagram. The plant's own step,
from the last snapshot on and with the logged orders, gives what lay between them; the logged
positions tell whether it is the same motion.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.strokes import Floats
from bench.run.directory import RunFiles
from hil import log as logs
from hil import snapshot
from hil.config.engine.models import DETAILED_MODELS
from hil.config.resolved import Resolved
from hil.log import Log, Span
from hil.values import replace
from hil.wire.codec import Decoder
from hil.wire.messages import ControllerTick
from hil.wire.pulses import PulseOrder, may_fire, wrap_us
from plant.build import make_params
from plant.engines.detailed import layout as at
from plant.engines.machine import MachineOrder
from plant.memory import LoopMemory
from plant.rig.params import PlantParams
from plant.rig.state import Command, PlantState
from plant.rig.step import step

_FINE_NS: Final = 100_000
_LEAST_NS: Final = 350_000_000
_LOOK_BACK_NS: Final = 20_000_000_000
_CYCLES_NEEDED: Final = 3.5
_SAME_M: Final = 1.0e-4
_CYCLES: Final = 10


class Fine(NamedTuple):
    """The motion at the fine tick: times, and the engine's arrays as rows."""

    t_s: Floats
    y: NDArray[np.float64]
    d: NDArray[np.float64]


class Cycle(NamedTuple):
    """The last whole cycle, and the figures of the last ones.

    volume_m3, p_pa : shape (2, samples), left and right cylinder
    figures : plant.engines.detailed.figures.Figures
    """

    t_s: Floats
    volume_m3: NDArray[np.float64]
    p_pa: NDArray[np.float64]
    figures: Any
    mean_pressure_pa: float


def is_detailed(scenario: Resolved) -> bool:
    """Tell whether there is a gas to look into."""
    return scenario.plant.model in DETAILED_MODELS


def last_cycle(scenario: Resolved, files: RunFiles) -> tuple[Cycle | None, str]:
    """Run the end of a log again; returns the cycle, or why there is none.

    Raises: LogError, MissingExtraError when the compiler of the detailed engine is missing
    """
    params = make_params(scenario)
    with logs.open(files.plant_log) as log:
        begun = _snapshot(log, _strokes_of_a_cycle(params))
        if begun is None:
            return None, "the run is too short"
        state = begun.state
        if any(index >= len(params.events) for index in state.disturbances.active):
            return None, "faults were ordered while it ran"
        span = Span(state.tick * params.period_ns, log.end_ns + 1)
        fine, apart_m = _run_again(params, state, log, span)
    if apart_m > _SAME_M:
        return None, f"the motion cannot be run again from its log ({apart_m * 1e3:.3f} mm apart)"
    cycle = _cycle(params, fine)
    return cycle, "" if cycle is not None else "the engine has no whole cycle at the end"


def _engine(p: PlantParams) -> Any:  # noqa: ANN401
    """The engine's arrays; its module needs a compiler and is loaded with the engine."""
    engine: Any = p.engine
    return engine.engine


def _strokes_of_a_cycle(p: PlantParams) -> int:
    return int(_engine(p).programme.shape[0])


def _snapshot(log: Log, strokes: int) -> LoopMemory | None:
    """Return the last snapshot that leaves some cycles to the end, by the last stroke's time."""
    if "/snapshot" not in log.topics:
        return None
    near = Span(max(log.end_ns - _LOOK_BACK_NS, 0), log.end_ns + 1)
    records = list(log.records("/snapshot", near))
    if not records:
        return None
    stroke_s = snapshot.loads(LoopMemory, records[-1].state).state.motion.inner.lasted_s[-1]
    span_ns = max(_LEAST_NS, round(_CYCLES_NEEDED * strokes * stroke_s * 1e9))
    early = [record for record in records if record.t_ns <= log.end_ns - span_ns]
    return snapshot.loads(LoopMemory, early[-1].state) if early else None


def _run_again(p: PlantParams, s: PlantState, log: Log, span: Span) -> tuple[Fine, float]:
    """Step through the rest of the log; returns the motion, and how far off it is at most [m]."""
    parts = max(p.period_ns // _FINE_NS, 1)
    fine = replace(
        p, period_ns=p.period_ns // parts, dt_s=p.dt_s / parts, stale_ticks=p.stale_ticks * parts,
        delay_ticks=0,
    )  # fmt: skip
    modes = _modes(log, span)
    orders = {
        int(row["tick"]): _command(row, modes[int(row["tick"])])
        for row in log.array("/actuator", span)
    }
    truth = log.array("/truth", span)
    s = replace(s, tick=s.tick * parts, waiting=())
    times, ys, ds, apart_m = [], [], [], 0.0
    for row in truth:
        apart_m = max(apart_m, abs(float(row["x_m"]) - s.x_m))
        command = orders.get(int(row["tick"]) - p.delay_ticks, Command())
        for part in range(parts):
            inner = s.motion.inner
            times.append(float(s.tick) * fine.period_ns * 1e-9)
            ys.append(np.frombuffer(inner.y))
            ds.append(np.frombuffer(inner.d))
            s, _ = step(fine, s, command if part == 0 else Command())
    return Fine(np.array(times), np.array(ys), np.array(ds)), apart_m


def _modes(log: Log, span: Span) -> dict[int, int]:
    """The operating mode of the newest answer to each tick that was answered."""
    decoder = Decoder("controller")
    modes = {}
    for record in log.records("/frames/received", span):
        decoder.forget_counters()  # the plant has judged them
        for message in decoder.decode(record.data):
            if type(message) is ControllerTick:
                modes[int(record.tick)] = message.mode
    return modes


def _command(row: Any, mode: int) -> Command:  # noqa: ANN401
    """The orders of a tick as the plant took them."""
    count = int(row["pulse_count"])
    columns = (row["pulse_channel"], row["pulse_open_t_ns"], row["pulse_duration_ns"])
    pulses = tuple(
        PulseOrder(int(channel), wrap_us(int(open_ns)), int(long_ns) // 1000)
        for channel, open_ns, long_ns in zip(*(c[:count] for c in columns), strict=True)
    )
    force, load = float(row["force_n"]), float(row["load_coefficient_n_s_m"])
    order = MachineOrder(int(row["mode"]), force, load)
    return Command(order, pulses, may_fire(mode), float(row["throttle"]))


def _cycle(p: PlantParams, fine: Fine) -> Cycle | None:
    """Cut out the last whole cycle and take the figures of the last ones."""
    engine = _engine(p)
    rows = _rows(fine)
    ends = np.flatnonzero(rows[:, at.REC_PHASE] == _strokes_of_a_cycle(p) - 1)
    if len(ends) < 2:
        return None
    t_from, t_to = rows[ends[-2], at.REC_T], rows[ends[-1], at.REC_T]
    first, last = np.searchsorted(fine.t_s, (t_from, t_to))
    inside = slice(max(first - 1, 0), last + 1)  # from one side of each end, so that it closes
    y = fine.y[inside]
    volume, pressure = _gas(engine.p, y)
    module = import_module("plant.engines.detailed.figures")
    figures = module.figures(engine, _motion(engine, fine, rows), _CYCLES)
    fuel = at.SUM + at.Q_FUEL + at.SUM_STRIDE * np.array((0, 1))
    burning = int(np.count_nonzero(y[-1, fuel] > y[0, fuel])) or 2
    swept = burning * engine.p[at.CYL_P + at.AREA] * np.ptp(y[:, at.X])
    work = figures.indicated_w * (t_to - t_from)
    return Cycle(fine.t_s[inside], volume, pressure, figures, float(work / swept))


def _rows(fine: Fine) -> NDArray[np.float64]:
    """Rows of the record, one a dead centre, sums taken between two samples."""
    number = fine.d[:, at.DC_NUMBER]
    after = np.flatnonzero(np.diff(number) > 0.0) + 1
    rows = np.zeros((len(after), at.N_REC))
    for row, k in zip(rows, after, strict=True):
        t = fine.d[k, at.DC_T]
        share = (t - fine.t_s[k - 1]) / (fine.t_s[k] - fine.t_s[k - 1])
        row[at.REC_SUMS :] = fine.y[k - 1] + share * (fine.y[k] - fine.y[k - 1])
        row[at.REC_T], row[at.REC_X] = t, fine.d[k, at.DC_X]
        row[at.REC_PHASE] = fine.d[k - 1, at.PHASE]
        row[at.REC_V_MAX] = fine.d[k - 1, at.V_MAX]
        row[at.REC_P_LEFT] = fine.d[k - 1, at.CYL + at.P_MAX]
        row[at.REC_P_RIGHT] = fine.d[k - 1, at.CYL + at.CYL_STRIDE + at.P_MAX]
    return rows


def _gas(
    p: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Volumes and pressures of both cylinders, p = (gamma - 1) U / V."""
    volumes, pressures = [], []
    for side in (0, 1):
        b = at.CYL_P + side * at.CYL_P_STRIDE
        volume = p[b + at.AREA] * (p[b + at.LENGTH] + p[b + at.SIGN] * y[:, at.X])
        volumes.append(volume)
        pressures.append((p[at.GAMMA] - 1.0) * y[:, at.U + at.GAS_STRIDE * side] / volume)
    return np.array(volumes), np.array(pressures)


def _motion(engine: Any, fine: Fine, rows: NDArray[np.float64]) -> Any:  # noqa: ANN401
    """The rows as the record of an engine that was run by itself."""
    module = import_module("plant.engines.detailed.engine")
    record = np.zeros((module.RECORD_ROWS, at.N_REC))
    record[: len(rows)] = rows
    d = fine.d[-1].copy()
    d[at.ROWS] = float(len(rows))
    return module.Motion(fine.y[-1].copy(), d, record)
