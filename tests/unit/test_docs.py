"""What the pages name exists: functions, modules, files, headings."""

import re

import pytest
from source_tree import PACKAGES, ROOT, defined

PAGES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
FOLDERS = (*PACKAGES, "docs", "tests", "systemd", ".ci")
NAMED = defined()
ENDINGS = {name.split(".", skip)[-1] for name in NAMED for skip in range(name.count(".") + 1)}


def quoted(page):
    """Words in backticks, outside blocks of code."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    return [match[1] for match in re.finditer(r"`([^`\n]+)`", text)]


def test_every_function_on_the_path_of_a_sample_exists():
    words = [re.split(r"[\[(]", word)[0] for word in quoted(ROOT / "docs/path-of-a-sample.md")]
    names = [word for word in words if re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", word)]
    names = [name for name in names if not name.endswith((".json", ".html"))]
    assert len(names) > 50
    assert [name for name in names if name not in ENDINGS] == []


def anchors(page):
    """What a page's headings can be linked by."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_a_page_names_exists(page):
    paths = [word for word in quoted(page) if word.split("/")[0] in FOLDERS and "/" in word]
    files = [path for path in paths if re.fullmatch(r"[a-z0-9_.*/-]+", path)]
    assert [path for path in files if not list(ROOT.glob(path.rstrip("/")))] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page):
    for target, anchor in re.findall(r"\]\(([^)#:]*)(?:#([^):]*))?\)", page.read_text()):
        file = page.parent / target if target else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), f"{target}#{anchor}"
