"""One recorded run for all tests of a process."""

import pytest
from runs import make_run


@pytest.fixture(scope="session")
def run_directory(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("recorded") / "run")
