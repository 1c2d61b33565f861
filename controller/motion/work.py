"""The braking of a stroke, by which it is known afterwards under what load it went."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.motion.charge import Charge, Learning, align, foresee, learn
from controller.motion.law import View
from controller.motion.load_estimate import LoadEstimate
from hil.values import Value


@final
class Work(Value):
    """The braking of a stroke, for learning.

    start_m, begun_ns: the dead centre at which it began, 0 when that was not seen
    braked, swept: sums of c v^2 and of v^2 since; scale_then: scale of the load there
    """

    __slots__ = ("start_m", "begun_ns", "scale_then", "braked", "swept")

    def __init__(
        self, start_m: float = 0.0, begun_ns: i64 = -1, scale_then: float = 0.0,
        braked: float = 0.0, swept: float = 0.0,
    ) -> None:  # fmt: skip
        self.start_m = start_m
        self.begun_ns = begun_ns
        self.scale_then = scale_then
        self.braked = braked
        self.swept = swept

    def after(self, c: float, v: float) -> Work:
        """The work one tick later, braked with c at the velocity v."""
        v_sq = v * v
        return Work(
            self.start_m, self.begun_ns, self.scale_then, self.braked + c * v_sq,
            self.swept + v_sq,
        )  # fmt: skip


NO_WORK: Final = Work()


def learnt_of(
    config: Learning, learnt: Charge, load: LoadEstimate, work: Work, view: View
) -> Charge:
    """At the dead centre: learn from the braking that the stroke behind has needed."""
    now = view.load_n_s_m * load.scale
    if not learnt.known:
        return align(config, learnt, view, now) if load.is_sure else learnt
    fired = 1 - view.motion.side
    if work.start_m <= 0.0 or view.burnt_at(fired) <= 0.0:
        return learnt
    if abs(load.scale - work.scale_then) > config.load_change * load.scale:
        return learnt
    c = work.braked / work.swept if work.swept > 0.0 else now
    q = learnt.effective_kg(view, fired)
    forecast = foresee(learnt.map_of(view), q, c, work.start_m, work.begun_ns)
    return learn(config, learnt, view, forecast, c)
