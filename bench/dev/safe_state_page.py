"""docs/safe-state.md: what leads to the safe state, from the rules that act."""

from __future__ import annotations

from bench.dev.markdown import table
from controller.mode.start_restart import RULES, SAFE
from hil.config.ranges import LEAST_STALE_TICKS, STALE_S

_TITLES = ("fault", "in", "detected by", "within", "reaction", "latched")
_PLANT = (
    (
        "no valid command", "plant, always", "no answer, or none that is young enough",
        "plant.stale_s, 10 ms", "lines low, machine brakes at full load", "yes",
    ),
    (
        "no valid command", "TTL outputs, always", "the same", "the same", "lines low", "yes",
    ),
)  # fmt: skip


def page() -> str:
    """Return docs/safe-state.md."""
    rows = [
        (rule.name, ", ".join(sorted(mode.name.lower() for mode in rule.sources)), rule.sign,
         rule.within, "no pulses, machine brakes at full load", "yes")
        for rule in RULES if rule.target is SAFE
    ]  # fmt: skip
    return "\n".join([*_PREFACE, table(_TITLES, (*rows, *_PLANT)), *_NOTES, ""])


_PREFACE = (
    "# Safe state", "",
    "Generated from the rules that act (`controller/mode/start_restart.py`) by",
    "`python -m bench.dev.generate`; do not edit.", "",
    "Ignition off, injectors closed, machine braking as a generator at full load. The first rule",
    "that matches names the fault in the log, as in `GENERATING -> SAFE: position sensor jumps`.",
    "",
)  # fmt: skip

_NOTES = (
    "Out of it leads a start, on both sides: the plant waits until it has heard its controller in",
    "a mode that fires nothing, and then in one that may (`hil/wire/latch.py`). With",
    "`safety.rearm`, for benches without an operator, the plant goes on when answers return, and a",
    "controller that was killed resumes; the log names the option.",
    "",
    f"Silence is a time: {STALE_S * 1e3:g} ms unless given, and at least {LEAST_STALE_TICKS} ticks."
    " It counts on both sides what has not",
    "come and what has waited so long that it is not acted on any more.",
    "",
    "A sample that is not believed is left out, which the log tells as `sample-doubted`, and the",
    "stroke's map bridges it. A dead centre that no sample has shown is not judged, and the next",
    "charge is ordered ahead: stalls of up to 9 ms cost no stroke.",
)
