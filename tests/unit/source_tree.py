"""The sources of the packages, parsed: for tests of how they are built and of what names them."""

import ast
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("hil", "plant", "controller", "drivers", "bench")


class Module(NamedTuple):
    """A source file of ours, parsed."""

    name: str
    path: Path
    tree: ast.Module

    @property
    def file(self) -> str:
        """Its path in the repository."""
        return self.path.relative_to(ROOT).as_posix()


def _module(path: Path) -> Module:
    parts = path.relative_to(ROOT).with_suffix("").parts
    name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
    return Module(name, path, ast.parse(path.read_text(encoding="utf-8")))


MODULES = {
    module.name: module
    for package in PACKAGES
    for module in map(_module, sorted((ROOT / package).rglob("*.py")))
}


def _targets(node: ast.stmt) -> list[str]:
    """Names that a statement gives to something."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        return [node.target.id]
    if isinstance(node, ast.Assign):
        return [target.id for target in node.targets if isinstance(target, ast.Name)]
    return []


def _names(prefix: str, body: list[ast.stmt]) -> list[str]:
    found = []
    for node in body:
        found += [f"{prefix}.{name}" for name in _targets(node)]
        if isinstance(node, ast.ClassDef):
            found += _names(f"{prefix}.{node.name}", node.body)
    return found


def defined() -> set[str]:
    """Dotted names of all modules, and of all that is defined in them and in their classes."""
    return {
        name
        for module in MODULES.values()
        for name in (module.name, *_names(module.name, module.tree.body))
    }
