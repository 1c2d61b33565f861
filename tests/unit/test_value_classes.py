"""Value classes state their fields the same each time, and nothing changes one that is made."""

from __future__ import annotations

import ast

from source_tree import MODULES


def values_of(tree):
    """Classes of a module that derive from `Value`."""
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and "Value" in {ast.unparse(base) for base in node.bases}
    ]


def slots_of(kind):
    for node in kind.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__slots__":
            return list(ast.literal_eval(node.value))
    return None


def init_of(kind):
    (init,) = (n for n in kind.body if isinstance(n, ast.FunctionDef) and n.name == "__init__")
    return init


def arguments_of(kind):
    arguments = init_of(kind).args
    return [a.arg for a in (*arguments.args[1:], *arguments.kwonlyargs)]


def assigned(function):
    """Attributes that a function sets, as (object, attribute, line)."""
    for node in ast.walk(function):
        targets = node.targets if isinstance(node, ast.Assign | ast.Delete) else []
        if isinstance(node, ast.AugAssign | ast.AnnAssign):
            targets = [node.target]
        for target in targets:
            for part in ast.walk(target):
                if isinstance(part, ast.Attribute) and not isinstance(part.ctx, ast.Load):
                    yield ast.unparse(part.value), part.attr, part.lineno


VALUES = [(module, kind) for module in MODULES.values() for kind in values_of(module.tree)]
STATED = {name for _, kind in VALUES for name in arguments_of(kind)}


def others_of(tree):
    """Attributes that other classes of a module have: what they set, or state in their body."""
    values = values_of(tree)
    for kind in ast.walk(tree):
        if isinstance(kind, ast.ClassDef) and kind not in values:
            yield from (name for owner, name, _ in assigned(kind) if owner == "self")
            yield from (
                line.target.id
                for line in kind.body
                if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name)
            )


FIELDS = STATED - {name for module in MODULES.values() for name in others_of(module.tree)}
"""Those by whose name alone a value is told from the objects that do change."""


def test_there_are_values():
    assert len(VALUES) > 80


def test_slots_arguments_and_assignments_name_the_same_fields():
    """In the same order: it is that of copies, of snapshots and of `fields_of`."""
    wrong = []
    for module, kind in VALUES:
        plain = [f"self.{name} = {name}" for name in arguments_of(kind)]
        body = [ast.unparse(line) for line in init_of(kind).body]
        if slots_of(kind) != arguments_of(kind) or body != plain:
            wrong.append(f"{module.file}:{kind.lineno} {kind.name}")
    assert wrong == []


def test_every_value_class_is_final():
    wrong = [
        f"{module.file}:{kind.lineno} {kind.name}"
        for module, kind in VALUES
        if "final" not in {ast.unparse(each) for each in kind.decorator_list}
    ]
    assert wrong == []


def changes(module):
    """Places that set a field of a value, other than its `__init__`."""
    begun = {
        line for kind in values_of(module.tree) for _, _, line in assigned(init_of(kind))
    }  # fmt: skip
    for owner, name, line in assigned(module.tree):
        if name in FIELDS and line not in begun:
            yield f"{module.file}:{line} {owner}.{name}"


def test_no_field_of_a_value_is_set_once_it_is_made():
    """What changes is another value: `but`, `replace`, or the class itself."""
    looped = [m for name, m in MODULES.items() if not name.startswith("bench.")]
    assert [place for module in looped for place in changes(module)] == []
