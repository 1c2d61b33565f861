"""The laws, one module each; a new one is its module and its place in `LAWS`."""

from typing import Any

from controller.motion.law import Law
from controller.motion.laws.cascade import Cascade
from controller.motion.laws.cycle import CycleLaw
from controller.motion.laws.machine import MachineLaw
from controller.motion.laws.observer import Observer
from controller.motion.laws.open_loop import OpenLoop
from controller.motion.laws.pdf import Pdf
from controller.motion.laws.predictive import Predictive
from controller.motion.laws.single_loop import SingleLoop

LAWS: dict[str, type[Law[Any]]] = {
    law.name: law
    for law in (
        Cascade, SingleLoop, OpenLoop, Pdf, Predictive, Observer, MachineLaw, CycleLaw
    )
}  # fmt: skip
