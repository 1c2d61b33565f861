"""Start and restart: which mode the engine is in, from a table that reads aloud.

OFF -> MOTORING (in resonance, until the amplitude allows ignition) -> GENERATING, and back to
MOTORING after a misfire (thesis section 6.1.3, level 1). SAFE is left only by a start request.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, final

from mypy_extensions import i64

from controller.observe.plausibility import NAMES, SIGNS
from hil.values import Value
from hil.wire.messages import OperatingMode

Mode = OperatingMode
OFF: Final = Mode.OFF
MOTORING: Final = Mode.MOTORING
GENERATING: Final = Mode.GENERATING
STOPPING: Final = Mode.STOPPING
SAFE: Final = Mode.SAFE
"""Names of their own, since every look into an enumeration costs as much as a value does."""


@final
class Facts(Value):
    """What the table looks at; each is true or false in this tick."""

    __slots__ = (
        "start_requested", "stop_requested", "sample_stale", "unheard", "fault", "beyond_limit",
        "fired", "misfired", "left_dead", "right_dead", "misfires_exhausted", "motoring_too_long",
        "at_rest", "emergency",
    )  # fmt: skip

    def __init__(
        self, start_requested: bool = False, stop_requested: bool = False,
        sample_stale: bool = False, unheard: bool = False, fault: i64 = 0,
        beyond_limit: bool = False, fired: bool = False, misfired: bool = False,
        left_dead: bool = False, right_dead: bool = False, misfires_exhausted: bool = False,
        motoring_too_long: bool = False, at_rest: bool = False,
        emergency: bool = False,
    ) -> None:  # fmt: skip
        self.start_requested = start_requested
        self.stop_requested = stop_requested
        self.sample_stale = sample_stale
        self.unheard = unheard
        self.fault = fault
        self.beyond_limit = beyond_limit
        self.fired = fired
        self.misfired = misfired
        self.left_dead = left_dead
        self.right_dead = right_dead
        self.misfires_exhausted = misfires_exhausted
        self.motoring_too_long = motoring_too_long
        self.at_rest = at_rest
        self.emergency = emergency


@final
class Rule(Value):
    """From these modes, when this holds, go there; the log names the rule.

    sign, within: what a fault is detected by, and how soon, for docs/safe-state.md
    """

    __slots__ = ("name", "sources", "when", "target", "sign", "within")

    def __init__(
        self, name: str, sources: frozenset[Mode], when: Callable[[Facts], bool], target: Mode,
        sign: str = "", within: str = "",
    ) -> None:  # fmt: skip
        self.name = name
        self.sources = sources
        self.when = when
        self.target = target
        self.sign = sign
        self.within = within


_ACTIVE = frozenset({MOTORING, GENERATING})
_MOVING = _ACTIVE | {STOPPING}


def _shows(fault: i64) -> Callable[[Facts], bool]:
    return lambda facts: facts.fault == fault


RULES: tuple[Rule, ...] = (
    Rule("emergency stop", _MOVING | {OFF}, lambda f: f.emergency, SAFE,
         "`emergency-stop` on the command key", "a tick"),
    *(Rule(NAMES[fault], _ACTIVE, _shows(fault), SAFE, *SIGNS[fault])
      for fault in range(1, len(NAMES))),
    Rule("sample lost", _MOVING, lambda f: f.sample_stale, SAFE,
         "no valid sample that is young enough", "controller.limits.stale_s, 10 ms"),
    Rule("plant does not hear", _MOVING, lambda f: f.unheard, SAFE,
         "`PistonSample.unheard` 15: the plant is in its safe state", "the plant's and two ticks"),
    Rule("piston beyond its limit", _ACTIVE, lambda f: f.beyond_limit, SAFE,
         "position, or a dead centre, beyond controller.limits.tdc_m", "a tick"),
    Rule("too many misfires", _ACTIVE, lambda f: f.misfires_exhausted, SAFE,
         "misfires in a row: controller.limits.misfires", "3 restarts"),
    Rule("left cylinder does not fire", _ACTIVE, lambda f: f.left_dead, SAFE,
         "misfires in a row of that side: injector, spark or valve", "3 restarts"),
    Rule("right cylinder does not fire", _ACTIVE, lambda f: f.right_dead, SAFE,
         "misfires in a row of that side: injector, spark or valve", "3 restarts"),
    Rule("motoring did not reach the amplitude", frozenset({MOTORING}),
         lambda f: f.motoring_too_long, SAFE,
         "time in motoring", "controller.start.timeout_s, 5 s"),
    Rule("stop requested", _ACTIVE, lambda f: f.stop_requested, STOPPING),
    Rule("piston at rest", frozenset({STOPPING}), lambda f: f.at_rest, OFF),
    Rule("start requested", frozenset({OFF, SAFE, STOPPING}),
         lambda f: f.start_requested and not f.sample_stale, MOTORING),
    Rule("first combustion", frozenset({MOTORING}), lambda f: f.fired, GENERATING),
    Rule("misfire", frozenset({GENERATING}), lambda f: f.misfired, MOTORING),
)  # fmt: skip


_RULES_FROM = {mode: tuple(rule for rule in RULES if mode in rule.sources) for mode in Mode}


def next_mode(mode: Mode, facts: Facts) -> tuple[Mode, str]:
    """Apply the first rule that matches.

    Returns: the mode and the name of the rule, "" when none matched
    """
    for rule in _RULES_FROM[mode]:
        if rule.when(facts):
            return rule.target, rule.name
    return mode, ""
