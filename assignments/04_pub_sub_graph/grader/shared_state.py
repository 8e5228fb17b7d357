"""What a module shares with others besides pages: found in its text, in the student's process (`Student.parse`)."""

from __future__ import annotations

import ast
from collections import deque
from typing import Any

CHANGES = {"append", "extend", "insert", "pop", "remove", "clear", "update", "setdefault", "add", "discard", "popitem"}


def find_shared_state(source: bytes) -> dict[str, Any]:
    """Return what a program shares, as values that can be sent.

    Returns:
        either `error`, a text, and its `line` or None, if it is not Python; or `shares`, a list of [line, kind, name]
        with the kinds "import", "component" and "global"; and `keeps`, the [line, name] of a value of the module's, or
        of a class, that functions change, or None.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        return {"error": str(error), "line": getattr(error, "lineno", None)}
    shares = [
        [getattr(node, "lineno", 0), kind, name] for node in ast.walk(tree) for kind, name in _shared_through(node)
    ]
    return {"shares": shares, "keeps": _kept_outside(tree)}


def _shared_through(node: ast.AST) -> list[tuple[str, str]]:
    match node:
        case ast.Import(names=names):
            return [("import", alias.name) for alias in names]
        case ast.ImportFrom(module=module):
            return [("import", module or "")]
        case ast.Attribute(attr="components" | "get_component"):
            return [("component", node.attr)]
        case ast.Global(names=names):
            return [("global", names[0])]
    return []


def _kept_outside(tree: ast.Module) -> list[Any] | None:
    outside: set[str] = set()
    for body in [tree.body, *(node.body for node in tree.body if isinstance(node, ast.ClassDef))]:
        for node in body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            if isinstance(node, (ast.Assign, ast.AnnAssign)):
                outside |= {target.id for target in targets if isinstance(target, ast.Name)}
    classes = {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    left = deque[ast.AST]([tree])
    while left:
        node = left.popleft()
        if not isinstance(node, (ast.FunctionDef, ast.Lambda)):
            left += ast.iter_child_nodes(node)
            continue
        for inner in ast.walk(node):  # with the functions inside it, each of which is looked at once
            name = _changed(inner, classes)
            if name in outside:
                return [inner.lineno, name]  # type: ignore[attr-defined]
    return None


def _changed(node: ast.AST, classes: set[str]) -> str:
    """Return the name of what a piece of code changes in place: NAME[...] = x, NAME.append(x), Class.NAME = x."""
    if isinstance(node, (ast.Subscript, ast.Attribute)) and isinstance(node.ctx, (ast.Store, ast.Del)):
        if isinstance(node.value, ast.Name) and isinstance(node, ast.Attribute) and node.value.id in classes:
            return node.attr
        return _name(node.value) if isinstance(node, ast.Subscript) else ""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGES:
        return _name(node.func.value)
    return ""


def _name(node: ast.AST) -> str:
    """Return NAME of NAME, and of Class.NAME; not of self.NAME, which may hide a class's own."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id != "self":
        return node.attr
    return ""
