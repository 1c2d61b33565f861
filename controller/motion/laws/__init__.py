"""The laws, one module each; a new one is its module and its row in `LAWS`."""

from controller.motion.law import Law
from controller.motion.laws import (
    cascade,
    machine,
    observer,
    open_loop,
    pdf,
    predictive,
    single_loop,
)

LAWS: dict[str, Law] = {
    module.LAW.name: module.LAW
    for module in (cascade, single_loop, open_loop, pdf, predictive, observer, machine)
}
