"""No class that can be created inherits a method that only raises NotImplementedError: those are interfaces."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import snr_sim

PACKAGE = Path(snr_sim.__file__).parent
# Raised with a message, at the first use of a student's class that lacks the method.
WITH_MESSAGE = {"get", "loop", "run", "run_state"}  # the last two: when the factory is made


def is_interface(function: ast.stmt) -> bool:
    """Return whether a function has a docstring and raises NotImplementedError, and nothing else."""
    if not isinstance(function, ast.FunctionDef):
        return False
    *before, last = function.body
    raised = getattr(last, "exc", None)
    name = getattr(raised, "id", getattr(getattr(raised, "func", None), "id", ""))
    return isinstance(last, ast.Raise) and name == "NotImplementedError" and len(before) <= 1


def interfaces() -> Iterator[tuple[type, str]]:
    """Yield each class of the library with the name of a method that it only declares."""
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "NotImplementedError" not in text:
            continue
        module = importlib.import_module(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts))
        for node in ast.parse(text).body:
            for member in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(node, ast.ClassDef) and isinstance(member, ast.FunctionDef) and is_interface(member):
                    yield getattr(module, node.name), member.name


def leaves(kind: type) -> set[type]:
    """Return the subclasses of a class in the library that have no subclass there, or the class if there is none."""
    below = [one for one in kind.__subclasses__() if one.__module__.startswith("snr_sim.")]
    return {leaf for one in below for leaf in leaves(one)} or {kind}


def test_every_leaf_class_implements_its_interfaces() -> None:
    for path in sorted(PACKAGE.rglob("*.py")):  # a subclass is known once its module is imported
        text = path.read_text(encoding="utf-8")
        if "class " in text and "shipped" not in path.parts and path.name != "__main__.py":
            importlib.import_module(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts))
    found = [(kind, name) for kind, name in interfaces() if name not in WITH_MESSAGE]
    assert len(found) >= 9
    missing = [
        f"{leaf.__module__}.{leaf.__name__}.{name}"
        for kind, name in found
        for leaf in leaves(kind)
        if getattr(leaf, name) is getattr(kind, name)
    ]
    assert missing == []
