"""Every figure of a summary, declared once: docs/reference.md is made of it."""

from __future__ import annotations

from typing import Final, NamedTuple

from bench.judge.punctuality import QUANTILES


class Figure(NamedTuple):
    """A figure's key in summary.json, its unit, and what it means."""

    name: str
    unit: str
    meaning: str


_ENGINE: Final = (
    Figure("strokes", "", "dead centres reached"),
    Figure(
        "frequency_mean_hz", "Hz", "of the motion, two strokes a period, over whole cycles of all"
        " strokes, those without a charge too",
    ),
    Figure(
        "frequency_final_hz", "Hz",
        "likewise, of the last ten strokes, or twelve where a cycle has four",
    ),
    Figure(
        "tdc_mean_mm", "mm", "mean over all strokes; where only some fire over those, as all other"
        " figures of dead centres and fuel",
    ),
    Figure("tdc_sigma_mm", "mm", "standard deviation"),
    Figure("tdc_min_mm", "mm", "shortest"),
    Figure("tdc_max_mm", "mm", "furthest"),
    Figure("tdc_final_mm", "mm", "last"),
    Figure("tdc_error_final_mm", "mm", "last dead centre less its set point"),
    Figure("fuel_mean_mg", "mg", "burnt at a dead centre, mean"),
    Figure("fuel_final_mg", "mg", "burnt at the last dead centre"),
    Figure("fuel_total_mg", "mg", "burnt in the whole run"),
    Figure(
        "tdc_error_peak_mm", "mm", "largest error after the first event that an expectation names;"
        " without one after the first disturbance, or over the whole run",
    ),
    Figure("settling_s", "s", "time from that event until settled"),
    Figure("settling_band_mm", "mm", "error within which a stroke counts as settled"),
    Figure(
        "electric_energy_j", "J",
        "delivered by the machine, less what motoring took: negative where it takes more",
    ),
    Figure(
        "electric_power_mean_w", "W", "mean over whole cycles where not all strokes fire, else over"
        " the run; of a four-stroke engine as in Table 4.3: P_e = P_i - P_f - P_c, the drive's"
        " power by its size (thesis 4.1, 4.2)",
    ),
    Figure(
        "terminal_power_mean_w", "W", "mean of the signed power, what the drive's braking yields"
        " included; the same as above but in four-stroke engines",
    ),
    Figure(
        "imep_bar", "bar",
        "indicated mean effective pressure: work of the gas in whole cycles by charges and swept"
        " volume, of the pressures as they are sensed",
    ),
    Figure("indicated_power_mean_w", "W", "that work by its time"),
    Figure("indicated_fuel_kg_kwh", "kg/kWh", "indicated specific consumption: fuel by that work"),
    Figure(
        "brake_fuel_kg_kwh", "kg/kWh",
        "brake specific consumption: fuel by the electric energy delivered, over whole cycles",
    ),
    Figure("misfires", "", "charges that did not burn"),
    Figure("contacts", "", "contacts with a head"),
    Figure("last_speed_m_s", "m/s", "of the piston at the end"),
    Figure("mode_final", "", "mode in which the controller ended"),
    Figure("simulated_s", "s", "length of the run by the plant's ticks"),
    Figure("wall_s", "s", "of the loop alone, without start-up and report"),
    Figure("speed_sim_s_per_wall_s", "s/s", "how many times faster than real time"),
)  # fmt: skip

_ANSWERS: Final = (
    Figure(
        "answered_next_tick_share", "",
        "ticks of the plant that acted on the answer to the sample one tick before",
    ),
    Figure(
        "sample_age_p50_ticks", "ticks",
        "from a sample to the tick that acts on its answer, median; 1 is the best there is",
    ),
    Figure("sample_age_p99_ticks", "ticks", "likewise, in 99 % of the ticks no more"),
    Figure("sample_age_max_ticks", "ticks", "likewise, at the most"),
)  # fmt: skip

_EFFORT: Final = (
    Figure(
        "processor_cores", "cores", "processor use of plant, controller and both recorders together"
    ),
)

_TIMES: Final = {
    "late": {
        "plant": "woken after due",
        "controller": "woken after due, counted from the earliest sample, as samples drive it",
    },
    "work": dict.fromkeys(("plant", "controller"), "from waking to frames sent"),
}


def _share(key: str) -> str:
    share = "the most" if key == "max" else f"no more in {100.0 * QUANTILES[key]:g} % of the ticks"
    return f"{share}; null in lockstep"


def _of_process(process: str) -> tuple[Figure, ...]:
    """The figures that each process has under its own name."""
    times = tuple(
        Figure(
            f"{process}_{what}_{key}_us",
            "us",
            f"{meanings[process]}: {_share(key)}",
        )
        for what, meanings in _TIMES.items()
        for key in (*QUANTILES, "max")
    )
    missed = "ticks skipped by an overrun; integrated and logged all the same"
    return (
        Figure(f"{process}_ticks", "ticks", "ticks that ran"),
        Figure(f"{process}_missed_ticks", "ticks", missed),
        *times,
    )


FIGURES: Final = (*_ENGINE, *_of_process("plant"), *_of_process("controller"), *_ANSWERS, *_EFFORT)
