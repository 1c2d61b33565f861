"""A browser without a screen; what needs one is skipped by name where there is none."""

import os
import shutil

import pytest


@pytest.fixture(scope="session")
def chromium():
    """A running Chromium, Debian's: the downloads of playwright's own are not used."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    pytest.importorskip("uplot", reason="needs the extra desk")
    path = os.environ.get("HIL_CHROMIUM") or shutil.which("chromium")
    if path is None:
        pytest.skip("needs chromium: apt-get install chromium")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def visit(chromium):
    """Open a page; whatever its scripts complain of is an error of the test."""
    errors, contexts = [], []

    def opened(url, width=1200, height=900, scheme="light", **options):
        context = chromium.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, **options
        )
        context.set_default_timeout(90_000)  # engine and browser share the machine with others
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda line: line.type == "error" and errors.append(line.text))
        page.goto(url)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert errors == []
