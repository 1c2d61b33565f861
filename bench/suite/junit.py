"""A suite as JUnit XML: a test case a run, figures and requirements as its properties."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from bench.suite.result import Result


def document(results: Sequence[Result], name: str = "hil") -> str:
    """Return the text of the file."""
    tally = {
        "tests": len(results),
        "failures": sum(r.verdict == "not met" for r in results),
        "errors": sum(r.verdict in ("fault", "blocked") for r in results),
        "skipped": 0,
        "time": f"{sum(r.wall_s for r in results):.3f}",
    }
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(root, "testsuite", {"name": name, **_texts(tally)})
    for result in results:
        suite.append(_case(result))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _case(result: Result) -> ElementTree.Element:
    file, _, case = result.label.partition("::")
    case_name = f"{case or file}[{result.link}]"
    element = ElementTree.Element(
        "testcase", {"classname": file, "name": case_name, "time": f"{result.wall_s:.3f}"}
    )
    properties = ElementTree.SubElement(element, "properties")
    given = {"verdict": result.verdict, "directory": result.directory, **result.figures}
    for key, value in _texts(given).items():
        ElementTree.SubElement(properties, "property", {"name": key, "value": value})
    for requirement, met in result.requirements.items():
        value = f"{requirement}: {'met' if met else 'not met'}"
        ElementTree.SubElement(properties, "property", {"name": "requirement", "value": value})
    if result.verdict in ("not met", "fault", "blocked"):
        kind = "failure" if result.verdict == "not met" else "error"
        told = ElementTree.SubElement(
            element, kind, {"type": result.verdict, "message": result.reason}
        )
        told.text = "\n".join(_line(check) for check in result.expectations)
    return element


def _line(check: object) -> str:
    assert isinstance(check, dict)
    requirement = f" [{check['requirement']}]" if check["requirement"] else ""
    return (
        f"{'met    ' if check['met'] else 'NOT MET'} {check['name']}: {check['text']}{requirement}"
    )


def _texts(values: dict[str, object]) -> dict[str, str]:
    """Values as attributes; control characters, which XML has no place for, are left out."""
    return {key: "".join(c for c in str(value) if c.isprintable()) for key, value in values.items()}
