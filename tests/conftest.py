"""Tests run interpreted loops, or those compiled into the directory HIL_TEST_COMPILED."""

import os

import hypothesis
import pytest

# How fast examples come is a matter of the machine, and of what else it does.
hypothesis.settings.register_profile(
    "any-machine", suppress_health_check=[hypothesis.HealthCheck.too_slow], deadline=None
)
hypothesis.settings.load_profile("any-machine")

COMPILED = os.environ.get("HIL_TEST_COMPILED")
os.environ["HIL_COMPILED"] = COMPILED or "off"

pytest_plugins = ["bench.suite.plugin", "pytester"]  # ours imports hil, so it comes after the above


def pytest_configure():
    """See that the loops are those that were asked for: an edited source would be interpreted."""
    from hil import compiled

    if compiled.in_force() != bool(COMPILED):
        raise pytest.UsageError(f"HIL_TEST_COMPILED={COMPILED}: not compiled from these sources")


def pytest_collection_modifyitems(items):
    """Leave out what needs interpreted loops where they are compiled, and say why."""
    for item in items:
        mark = item.get_closest_marker("interpreted")
        if mark is not None and COMPILED:
            item.add_marker(pytest.mark.skip(reason=f"interpreted loops only: {mark.args[0]}"))
