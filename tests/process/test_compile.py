"""`hil compile` compiles all that it says; what comes of it is in test_compiled_product.py."""

import importlib
import os
import subprocess
import sys

import pytest

from hil import compiled


@pytest.mark.skipif(not os.environ.get("HIL_TEST_COMPILED"), reason="needs ./check compiled")
def test_every_module_that_is_to_be_compiled_is():
    names = [".".join(path.with_suffix("").parts) for path in compiled.sources(compiled.root())]
    for name in names:
        importlib.import_module(name)
    assert [name for name in names if not compiled.is_compiled(name)] == []


def test_a_place_is_needed():
    refused = subprocess.run(
        [sys.executable, "-m", "bench.cli", "compile"], capture_output=True, text=True, check=False,
        env={**os.environ, "HIL_COMPILED": "off"},
    )  # fmt: skip
    assert refused.returncode == 2
    assert refused.stderr == "HIL_COMPILED=off: accepted a directory, or --into DIR\n"
