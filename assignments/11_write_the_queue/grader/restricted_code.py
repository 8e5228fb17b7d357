"""Check that a program is plain: it creates and changes values of its own, and cannot reach the code that runs it.

Where a lab counts what a program does, the counter runs in the program's own process, since it must see its lists.
A program that reaches the counter could count for itself. So such a lab has the program parsed first
(`Student.parse`), in a process that runs nothing of it. Nothing is guessed: a construct that is not known to be plain
is refused, with its line. Labs that evaluate answers only do not need this.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator

# What a data structure may need, and nothing that gives a module, a frame, a file or a class of other code.
MODULES = {
    "__future__": {"annotations"},
    "bisect": {"bisect", "bisect_left", "bisect_right", "insort", "insort_left", "insort_right"},
    "collections": {"Counter", "OrderedDict", "defaultdict", "deque", "namedtuple"},
    "dataclasses": {"dataclass", "field", "replace"},
    "enum": {"Enum", "IntEnum", "auto"},
    "functools": {"cmp_to_key", "partial", "reduce", "total_ordering"},
    "heapq": {"heapify", "heappop", "heappush", "heappushpop", "heapreplace", "merge", "nlargest", "nsmallest"},
    "itertools": {"accumulate", "chain", "count", "groupby", "islice", "repeat", "takewhile", "dropwhile"},
    "math": {"ceil", "floor", "inf", "isqrt", "log", "log2", "sqrt"},
    "snr_sim": {"Task", "TaskType"},
    "typing": {"Any", "Callable", "Deque", "Dict", "Final", "Generic", "List", "NamedTuple", "Optional", "Tuple"},
}
BUILTINS = {
    *("abs", "all", "any", "bool", "classmethod", "dict", "divmod", "enumerate", "filter", "float", "frozenset"),
    *("hash", "id", "int", "isinstance", "issubclass", "iter", "len", "list", "map", "max", "min", "next", "object"),
    *("pow", "print", "property", "range", "repr", "reversed", "round", "set", "slice", "sorted", "staticmethod"),
    *("str", "sum", "super", "tuple", "zip", "NotImplemented"),
    *(name for name, kind in vars(builtins).items() if isinstance(kind, type) and issubclass(kind, Exception)),
}
_METHODS = "init len bool repr str hash iter next contains reversed lt le gt ge eq ne getitem setitem delitem post_init"
METHODS = {f"__{name}__" for name in _METHODS.split()}  # that a class may define, and call of another
_FRAMES = {"gi_frame", "gi_code", "cr_frame", "cr_code", "ag_frame", "ag_code", "tb_frame", "f_back", "f_globals"}


def find_forbidden_construct(source: str | bytes) -> str:
    """Return the first place where a program is not plain, as "line 3: `sys`"; "" if all of it is."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return "it is not Python"
    modules = dict(_modules(tree))
    inside = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    found = list[tuple[int, str]]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in modules and id(node) not in inside:
            found.append((node.lineno, node.id))  # under another name it would be out of sight
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules:
            is_read = isinstance(node.ctx, ast.Load)
            if not is_read or node.attr not in MODULES.get(modules[node.value.id], ()):
                found.append((node.lineno, f"{node.value.id}.{node.attr}"))
        found += [(getattr(node, "lineno", 0), name) for name in _not_plain(node)]
    return "line {}: `{}`".format(*min(found)) if found else ""


def _modules(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Return the modules that a program imports as a whole, by its own names for them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.asname or alias.name.partition(".")[0], alias.name) for alias in node.names)


def _not_plain(node: ast.AST) -> Iterator[str]:
    """Yield the names in one part of a program that are not plain."""
    match node:
        case ast.Import(names=names):
            yield from (alias.name for alias in names if alias.name not in MODULES)
        case ast.ImportFrom(module=module, names=names):
            known = MODULES.get(module or "", set())
            yield from (f"{module}.{alias.name}" for alias in names if node.level or alias.name not in known)
        case ast.Name(id=name, ctx=ast.Load()):
            if (hasattr(builtins, name) or _is_special(name)) and name not in BUILTINS | {"__name__"}:
                yield name
        case ast.Name(id=name) if _is_special(name) and name not in METHODS | {"__slots__", "__match_args__"}:
            yield name
        case ast.Attribute(attr=name, ctx=context):
            if name in _FRAMES or (_is_special(name) and not (name in METHODS and isinstance(context, ast.Load))):
                yield name
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            if _is_special(name) and name not in METHODS:
                yield name
        case ast.MatchClass(kwd_attrs=names):
            yield from (name for name in names if _is_special(name) or name in _FRAMES)


def _is_special(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")
