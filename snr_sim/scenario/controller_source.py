"""Keys of pages, fields and plain mistakes in the source of a controller, without executing it.

Only literals are read. A computed key is ignored. `source_checks.py` compares the result with the robot.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from snr_sim.core.endpoint import Endpoint
from snr_sim.core.handlers import COPY_FIX
from snr_sim.core.hints import about_name
from snr_sim.core.reload.sources import source_files
from snr_sim.core.run_diagnostics import NEXT_LINE
from snr_sim.core.source_location import SourceLocation, short_path

_STORES = ("store_data_task", "store_data", "page", "Page")
_GETS = ("get_data", "get_page", "get_age_s")
_TASKS = ("event", "terminate", "finish", "store_page", "process_data", "reload_component", "remove_component")
_WAITED_FOR = ("process_data", "store_page")


class SourceLiteral(NamedTuple):
    """A literal key or field, and its location."""

    name: str
    place: SourceLocation
    node: ast.expr | None = None  # the stored data, or the field that is read


@dataclass
class Source:
    """Findings in the files of a controller."""

    waits: list[SourceLiteral] = field(default_factory=list)
    gets: list[SourceLiteral] = field(default_factory=list)
    stores: list[SourceLiteral] = field(default_factory=list)
    sent: list[SourceLiteral] = field(default_factory=list)  # events
    handled: set[str] = field(default_factory=set)  # events, also by components that are added later
    fields: list[tuple[SourceLiteral, str]] = field(default_factory=list)  # fields of pages that are read
    plain: list[str] = field(default_factory=list)  # mistakes that need no robot
    own: dict[str, list[SourceLiteral]] = field(default_factory=dict)  # by class: attributes of self that are read
    set_names: set[str] = field(default_factory=set)  # attributes that are set on anything
    is_open: bool = False  # it stores pages whose keys are not literals


def read_source(files: Sequence[Path]) -> Source:
    """Return the findings in some files; none if one was deleted or cannot be parsed."""
    source = Source()
    try:
        for path in files:
            _Reader(path, source).read()
    except (OSError, RecursionError):  # it was deleted after it was loaded, or is nested too deeply
        return Source()
    return source


def finding(place: object, what: str, fix: str) -> str:
    """Return the text of a finding: the student's line first, then what is wrong, then what to try."""
    return f"{place}{NEXT_LINE}{what}{NEXT_LINE}Try: {fix}"


def parsed(path: Path) -> ast.Module:
    """Return the present syntax tree of a file; an empty one if it cannot be read or parsed."""
    try:
        return ast.parse(source_files().read(path))
    except (OSError, SyntaxError, ValueError, RecursionError):
        return ast.Module([], [])


def texts_of(path: Path) -> Iterator[str]:
    """Yield the texts that are literals in a Python file."""
    if path.suffix == ".py":
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


class _Reader(ast.NodeVisitor):
    """Visitor that collects the findings in one file."""

    def __init__(self, path: Path, source: Source) -> None:
        self._path = path
        self._lines = source_files().read(path).decode(errors="replace").splitlines()
        self._source = source
        self._handlers: set[str] = set()
        self._class = self._function = ""
        self._pages: dict[str, str] = {}  # by variable name: the key of the page it holds
        self._declared: dict[str, str] = {}  # by class with `@page`: the key of the page it declares
        self._names: list[SourceLiteral] = []  # names whose value is used

    def read(self) -> None:
        tree = parsed(self._path)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                for declared in filter(None, (_argument(one, "page") for one in node.decorator_list)):
                    self._declared[node.name] = declared
            if isinstance(node, ast.FunctionDef) and any(_is_call(one, "handles") for one in node.decorator_list):
                self._handlers.add(node.name)
            if isinstance(node, ast.Dict):
                for key, value in zip(node.keys, node.values, strict=True):
                    if key is not None and "TaskType." in ast.unparse(key) and isinstance(value, ast.Attribute):
                        self._handlers.add(value.attr)
        self._check_twice(tree.body)
        self.visit(tree)
        self._check_names(tree)

    def _check_names(self, tree: ast.Module) -> None:
        """Note names that the file never assigns a value."""
        bound = {"__file__", "__name__", "__doc__", *vars(builtins)}
        for node in ast.walk(tree):
            if isinstance(found := getattr(node, "name", None), str):  # of a function, a class, an exception, a type
                bound.add(found)
            match node:
                case ast.Name(id="globals" | "exec") | ast.alias(name="*"):
                    return  # it may define any name
                case ast.Name(id=str(name), ctx=ast.Store() | ast.Del()) | ast.arg(arg=str(name)):
                    bound.add(name)
                case ast.MatchMapping(rest=str(name)):
                    bound.add(name)
                case ast.alias(name=str(name), asname=other):
                    bound.add(other or name.partition(".")[0])
        places: dict[str, list[SourceLocation]] = {}
        for name, place, _ in self._names:
            if name not in bound:
                places.setdefault(name, []).append(place)
        for name, (first, *others) in places.items():
            lines = ", ".join(dict.fromkeys(str(place.line) for place in others if place.line != first.line))
            also = f" It is used in line {lines}, too." if lines else ""
            what = f"Nothing gives {name} a value.{also}"
            self._source.plain.append(finding(first, what, about_name(name, bound, Endpoint)))

    def _place(self, node: ast.expr | ast.stmt) -> SourceLocation:
        source = self._lines[node.lineno - 1].strip() if node.lineno <= len(self._lines) else ""
        return SourceLocation(short_path(str(self._path)), node.lineno, self._function, source)

    def _report(self, node: ast.expr | ast.stmt, what: str, fix: str, who: str = "") -> None:
        """Note a mistake in a function of a component: what the function does, and the fix."""
        what = f"{who}{self._function}() of {self._class} {what}"
        self._source.plain.append(finding(self._place(node), what, fix))

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        before, self._class = self._class, node.name
        self._source.own.setdefault(node.name, [])
        self._check_twice(node.body)
        self.generic_visit(node)
        self._class = before

    def _check_twice(self, body: list[ast.stmt]) -> None:
        """Note methods and classes that one of the same name replaces: Python ignores the first without a word."""
        seen: dict[str, int] = {}
        for one in body:
            if isinstance(one, ast.FunctionDef | ast.ClassDef):
                is_plain = not any(isinstance(decorator, ast.Attribute) for decorator in one.decorator_list)
                if one.name in seen and is_plain:  # not a setter of a property
                    what = f"This {one.name} replaces the one of line {seen[one.name]}, which is never called."
                    self._source.plain.append(finding(self._place(one), what, "give it a name of its own."))
                seen[one.name] = one.lineno

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        before = self._function, self._pages
        self._function, self._pages = node.name, {}
        for decorator in node.decorator_list:
            key = _argument(decorator, "handles")
            waited = key or self._declared.get(_argument(decorator, "handles", ast.Name), "")
            if waited:
                self._source.waits.append(SourceLiteral(waited, self._place(decorator)))
            if key and not any(one.arg == "task" for one in getattr(decorator, "keywords", ())):
                self._pages |= {one.arg: key for one in node.args.args[1:2]}
        for each in ast.walk(node):  # ignore a name that holds a page once and another value elsewhere
            if isinstance(each, ast.Assign) and len(each.targets) == 1 and isinstance(each.targets[0], ast.Name):
                name, key = each.targets[0].id, _key_of_get(each.value)
                self._pages[name] = key if self._pages.get(name, key) == key else ""
        self.generic_visit(node)
        self._function, self._pages = before

    def visit_Tuple(self, node: ast.Tuple) -> None:
        match node.elts:
            case [ast.Attribute(value=ast.Name(id="TaskType"), attr=kind), ast.Constant(value=str(key))]:
                if kind in _WAITED_FOR:
                    self._source.waits.append(SourceLiteral(key, self._place(node)))
                self._source.handled |= {key} if kind == "event" else set()
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = _called(node)
        if _is_call(node, "handles"):
            self._source.handled |= {ast.unparse(one.value).strip("'") for one in node.keywords if one.arg == "event"}
        key = node.args[0].value if node.args and isinstance(node.args[0], ast.Constant) else None
        if name in _STORES:
            if isinstance(key, str):
                self._source.stores.append(
                    SourceLiteral(key, self._place(node), node.args[1] if len(node.args) > 1 else None)
                )
            else:
                self._source.is_open = True
        elif name in _GETS and isinstance(key, str):
            self._source.gets.append(SourceLiteral(key, self._place(node)))
        elif name in _GETS and (declared := _argument(node, name, ast.Name)) in self._declared:
            self._source.gets.append(SourceLiteral(self._declared[declared], self._place(node)))
        elif (page := self._page_of_get(node)) and isinstance(key, str):
            self._source.fields.append((SourceLiteral(page, self._place(node)), key))
        elif ast.unparse(node.func) == "tasks.event" and isinstance(key, str):
            self._source.sent.append(SourceLiteral(key, self._place(node)))
        elif name == "setattr":
            self._source.set_names.add(str(getattr(node.args[1], "value", "")) if len(node.args) > 1 else "")
        elif self._class and ast.unparse(node.func) in ("sys.exit", "exit", "quit"):
            fix = "return tasks.terminate('why'), so that everything is halted."
            self._report(node, "leaves the program, which ends the run as an error.", fix)
        self.generic_visit(node)

    def _page_of_get(self, node: ast.Call) -> str:
        """Return the key of the page of which a call asks a field by `.get(name)`; empty if it is another call."""
        match node.func:
            case ast.Attribute(value=ast.Name(id=variable), attr="get"):
                return self._pages.get(variable, "")
            case ast.Attribute(value=page, attr="get"):
                return _key_of_get(page)
        return ""

    def visit_Expr(self, node: ast.Expr) -> None:
        if self._class and isinstance(node.value, ast.Call) and _makes_task(node.value):
            what = "makes a task there and drops it: only what a handler returns is done."
            self._report(node, what, f"return {ast.unparse(node.value)}")
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        match node.value:
            case ast.Constant(value=None):
                pass
            case ast.Dict() | ast.JoinedStr() | ast.Set() | ast.Constant() as value:
                if self._class and self._function in self._handlers:
                    text = ast.unparse(value)
                    fix = f"return self.store_data_task('page', {text}), or None, or a list of tasks."
                    self._report(node, f"returns {text}, which is not a task.", fix, who="The handler ")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._check_change(node.target)
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            self._check_change(target)
        self.generic_visit(node)

    def visit_Delete(self, node: ast.Delete) -> None:
        for target in node.targets:
            self._check_change(target)
        self.generic_visit(node)

    def _check_change(self, target: ast.expr) -> None:
        """Report an assignment into a page that was read."""
        inner = target
        while isinstance(inner, ast.Subscript):
            inner = inner.value
        if inner is target or not (self._class and isinstance(inner, ast.Name) and self._pages.get(inner.id)):
            return
        what = f"changes the page '{self._pages[inner.id]}' that it reads: other components get what it makes of it."
        self._report(target, what, COPY_FIX.format(inner.id))

    def visit_Subscript(self, node: ast.Subscript) -> None:
        key = self._pages.get(node.value.id, "") if isinstance(node.value, ast.Name) else _key_of_get(node.value)
        name = node.slice.value if isinstance(node.slice, ast.Constant) else None
        if key and isinstance(name, str) and isinstance(node.ctx, ast.Load):
            self._source.fields.append((SourceLiteral(key, self._place(node)), name))
        self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> None:
        if isinstance(node.ctx, ast.Load):
            self._names.append(SourceLiteral(node.id, self._place(node)))

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if not isinstance(node.ctx, ast.Load):
            self._source.set_names.add(node.attr)
        elif isinstance(node.value, ast.Name) and node.value.id == "self" and self._class:
            self._source.own.setdefault(self._class, []).append(SourceLiteral(node.attr, self._place(node)))
        self.generic_visit(node)


def _is_call(node: ast.expr, function: str) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] == function


def _argument(node: ast.expr, function: str, kind: type[ast.Constant | ast.Name] = ast.Constant) -> str:
    """Return the first argument of a call of a function, a text or a name; empty if it is another call, or neither."""
    if not (isinstance(node, ast.Call) and _is_call(node, function) and node.args and isinstance(node.args[0], kind)):
        return ""
    value = getattr(node.args[0], "value" if kind is ast.Constant else "id")
    return value if isinstance(value, str) else ""


def _called(node: ast.Call) -> str:
    function = node.func
    if isinstance(function, ast.Name) and function.id == "page":  # the decorator: it declares a page and stores none
        return ""
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return function.attr if function.value.id in ("self", "node") else ""
    return function.id if isinstance(function, ast.Name) else ""


def _makes_task(node: ast.Call) -> bool:
    match node.func:
        case ast.Attribute(value=ast.Name(id="self"), attr="store_data_task") | ast.Name(id="Task"):
            return True
        case ast.Attribute(value=ast.Name(id="tasks"), attr=name):
            return name in _TASKS
    return False


def _key_of_get(node: ast.expr) -> str:
    match node:
        case ast.Call(func=ast.Attribute(attr="get_data"), args=[ast.Constant(value=str(key))]):
            return key
    return ""
