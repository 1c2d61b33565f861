"""What mypyc allows no class to do is not done, though interpreted loops would bear it."""

from __future__ import annotations

import ast

from hil import compiled

ROOT = compiled.root()
COMPILED = {ROOT / path for path in compiled.sources(ROOT)}
OPEN = {"NamedTuple", "Protocol", "IntEnum", "Enum"}
"""Classes with such a base are no C structures: Python makes them, compiled or not."""


def tree_of(path):
    return ast.parse(path.read_text())


def module_of(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def classes_of(tree):
    return [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]


def name_of(expression):
    """The last word of a decorator or a base: `x.y(z)` and `x.y[z]` are y."""
    while isinstance(expression, ast.Call | ast.Subscript):
        expression = expression.func if isinstance(expression, ast.Call) else expression.value
    return (
        expression.attr if isinstance(expression, ast.Attribute) else getattr(expression, "id", "")
    )


def is_open(node):
    """Whether an interpreted class may derive from it: Python's own, or opened to them by name."""
    opened = "allow_interpreted_subclasses=True"
    return bool(OPEN & {name_of(base) for base in node.bases}) or any(
        opened in ast.unparse(decorator) for decorator in node.decorator_list
    )


CLOSED = {
    (module_of(path), node.name)
    for path in COMPILED
    for node in classes_of(tree_of(path))
    if not is_open(node)
}


def imports_of(tree):
    """Names of a module that stand for others': {name: (module, class)}, {name: module}."""
    classes, modules = {}, {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                classes[alias.asname or alias.name] = node.module, alias.name
                modules[alias.asname or alias.name] = f"{node.module}.{alias.name}"
        elif isinstance(node, ast.Import):
            modules |= {alias.asname or alias.name: alias.name for alias in node.names}
    return classes, modules


def derived(path):
    """Classes of a file that derive from a closed one."""
    tree = tree_of(path)
    classes, modules = imports_of(tree)
    for node in classes_of(tree):
        for base in node.bases:
            found = classes.get(ast.unparse(base))
            if isinstance(base, ast.Attribute):
                module = ast.unparse(base.value)
                found = modules.get(module, module), base.attr
            if found in CLOSED:
                yield f"{path.relative_to(ROOT)}:{node.lineno} {node.name}({ast.unparse(base)})"


def sources():
    packages = ("hil", "plant", "controller", "drivers", "bench", "tests")
    return {path for package in packages for path in (ROOT / package).rglob("*.py")}


def test_no_interpreted_class_derives_from_a_compiled_one():
    """Hold an object instead, or let both fulfil a Protocol."""
    assert ("hil.pacing", "RealTimePacer") in CLOSED
    assert ("hil.values", "Value") not in CLOSED
    assert [line for path in sorted(sources() - COMPILED) for line in derived(path)] == []


def test_a_derived_class_is_found(tmp_path, monkeypatch):
    path = tmp_path / "test_it.py"
    path.write_text(
        "import hil.pacing\nfrom hil import pacing\nfrom hil.pacing import RealTimePacer as Pacer\n"
        "class A(Pacer): ...\nclass B(pacing.RealTimePacer): ...\n"
        "class C(hil.pacing.RealTimePacer): ...\nclass D(pacing.Pacer): ...\n"
    )
    monkeypatch.setattr("test_compiled_classes.ROOT", tmp_path)
    assert [line.split()[1][0] for line in derived(path)] == ["A", "B", "C"]


def test_no_compiled_module_asks_for_a_protocol_at_run_time():
    """`isinstance` of a runtime_checkable Protocol looks at every member, in every tick."""
    asked = [
        f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"
        for path in sorted(COMPILED)
        for node in classes_of(tree_of(path))
        if "runtime_checkable" in {name_of(decorator) for decorator in node.decorator_list}
    ]
    assert asked == []
