"""Static checks before a run: of the source of a controller, and of its components as created.

No student code is executed. The robot's pages are known from its components and its simulated devices; the keys and
fields that a controller uses are read from literals in its source. A computed key is ignored.
"""

from __future__ import annotations

import ast
import builtins
import difflib
import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from snr_sim.core.blame import Place, short_path
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.hints import about_name, near
from snr_sim.core.loose_ends import NEXT_LINE, without_handlers
from snr_sim.core.node import Node
from snr_sim.core.reload.source_files import source_files
from snr_sim.devices.commands import command_of
from snr_sim.devices.loops import CommandLoop, SensorLoop
from snr_sim.prelude.errors import CommandError, ConfigError, nearest
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Simulation

_STORES = ("store_data_task", "store_data", "page", "Page")
_GETS = ("get_data", "get_page", "get_age_s")
_TASKS = ("event", "terminate", "finish", "store_page", "process_data", "reload_component", "remove_component")
_WAITED_FOR = ("process_data", "store_page")
_OF_THE_KIT = ("recording", "reload", "add_component", "remove_component")
_PREVIOUS = "_prev"


class Said(NamedTuple):
    """A literal key or field, and its location."""

    name: str
    place: Place
    node: ast.expr | None = None  # the stored data, or the field that is read


@dataclass
class Source:
    """Findings in the files of a controller."""

    waits: list[Said] = field(default_factory=list)
    gets: list[Said] = field(default_factory=list)
    stores: list[Said] = field(default_factory=list)
    fields: list[tuple[Said, str]] = field(default_factory=list)  # fields of pages that are read
    plain: list[str] = field(default_factory=list)  # mistakes that need no robot
    own: dict[str, list[Said]] = field(default_factory=dict)  # by class: attributes of self that are read
    set_names: set[str] = field(default_factory=set)  # attributes that are set on anything
    is_open: bool = False  # it stores pages whose keys are not literals


def notes_before(simulation: Simulation, nodes: Sequence[Node]) -> list[str]:
    """Return the errors that can be found now in a controller of the user's own, each with its line first.

    Raises:
        ConfigError: it is for another robot.
    """
    files = simulation.files()
    mine = [path for name, path in files.items() if _is_controllers(name, path)]
    if not mine:
        return []
    known = {text for name, path in files.items() if path not in mine for text in _texts(path)}
    source = _read(mine)
    robot = _Robot(nodes, known, source)
    return list(dict.fromkeys([*source.plain, *_of_components(nodes, source), *robot.notes(simulation)]))


def notes_on_files(files: Sequence[Path]) -> list[str]:
    """Return the errors in Python files that do not depend on the robot, each with its line first."""
    return list(dict.fromkeys(_read(files).plain))


def _read(files: Sequence[Path]) -> Source:
    source = Source()
    try:
        for path in files:
            _Reader(path, source).read()
    except (OSError, RecursionError):  # it was deleted after it was loaded, or is nested too deeply
        return Source()
    return source


def _is_controllers(name: str, path: Path) -> bool:
    return name.startswith("controller/") and path.suffix == ".py" and library.is_own(path)


def _parsed(path: Path) -> ast.Module:
    try:
        return ast.parse(source_files().read(path))
    except (OSError, SyntaxError, ValueError, RecursionError):
        return ast.Module([], [])


def _texts(path: Path) -> Iterator[str]:
    if path.suffix == ".py":
        for node in ast.walk(_parsed(path)):
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
        self._names: list[Said] = []  # names whose value is used

    def read(self) -> None:
        tree = _parsed(self._path)
        for node in ast.walk(tree):
            if isinstance(node, ast.Dict):
                for key, value in zip(node.keys, node.values, strict=True):
                    if key is not None and "TaskType." in ast.unparse(key) and isinstance(value, ast.Attribute):
                        self._handlers.add(value.attr)
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
        for name, place, _ in self._names:
            if name not in bound:
                fix = about_name(name, bound, Endpoint)
                self._source.plain.append(f"{place}{NEXT_LINE}Nothing gives {name} a value.{NEXT_LINE}Try: {fix}")

    def _place(self, node: ast.expr | ast.stmt) -> Place:
        source = self._lines[node.lineno - 1].strip() if node.lineno <= len(self._lines) else ""
        return Place(short_path(str(self._path)), node.lineno, self._function, source)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        before, self._class = self._class, node.name
        self.generic_visit(node)
        self._class = before

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        before = self._function, self._pages
        self._function, self._pages = node.name, {}
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
                    self._source.waits.append(Said(key, self._place(node)))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = _called(node)
        key = node.args[0].value if node.args and isinstance(node.args[0], ast.Constant) else None
        if name in _STORES:
            if isinstance(key, str):
                self._source.stores.append(Said(key, self._place(node), node.args[1] if len(node.args) > 1 else None))
            else:
                self._source.is_open = True
        elif name in _GETS and isinstance(key, str):
            self._source.gets.append(Said(key, self._place(node)))
        elif name == "setattr":
            self._source.set_names.add(str(getattr(node.args[1], "value", "")) if len(node.args) > 1 else "")
        elif self._class and ast.unparse(node.func) in ("sys.exit", "exit", "quit"):
            self._source.plain.append(
                f"{self._place(node)}{NEXT_LINE}{self._function}() of {self._class} leaves the program, which ends the "
                f"run as an error.{NEXT_LINE}Try: return tasks.terminate('why'), so that everything is halted."
            )
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if self._class and isinstance(node.value, ast.Call) and _makes_task(node.value):
            self._source.plain.append(
                f"{self._place(node)}{NEXT_LINE}{self._function}() of {self._class} makes a task there and drops it: "
                f"only what a handler returns is done.{NEXT_LINE}Try: return {ast.unparse(node.value)}"
            )
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        value = node.value
        is_plain = isinstance(value, (ast.Dict, ast.JoinedStr, ast.Set)) or (
            isinstance(value, ast.Constant) and value.value is not None
        )
        if is_plain and self._class and self._function in self._handlers:
            assert value is not None
            self._source.plain.append(
                f"{self._place(node)}{NEXT_LINE}The handler {self._function}() of {self._class} returns "
                f"{ast.unparse(value)}, which is not a task.{NEXT_LINE}"
                f"Try: return self.store_data_task('page', {ast.unparse(value)}), or None, or a list of tasks."
            )
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        key = self._pages.get(node.value.id, "") if isinstance(node.value, ast.Name) else _key_of_get(node.value)
        name = node.slice.value if isinstance(node.slice, ast.Constant) else None
        if key and isinstance(name, str) and isinstance(node.ctx, ast.Load):
            self._source.fields.append((Said(key, self._place(node)), name))
        self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> None:
        if isinstance(node.ctx, ast.Load):
            self._names.append(Said(node.id, self._place(node)))

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if not isinstance(node.ctx, ast.Load):
            self._source.set_names.add(node.attr)
        elif isinstance(node.value, ast.Name) and node.value.id == "self" and self._class:
            self._source.own.setdefault(self._class, []).append(Said(node.attr, self._place(node)))
        self.generic_visit(node)


class _Robot:
    """Pages that a robot's components store and handle, for comparison with a controller's source."""

    def __init__(self, nodes: Sequence[Node], known: set[str], source: Source) -> None:
        components = [component for node in nodes for component in node.components.values()]
        self._sensors = {one.factory.key: one for one in components if isinstance(one, SensorLoop)}
        self._actuators = {one.factory.key: one for one in components if isinstance(one, CommandLoop)}
        self._source = source
        self._stored = {one.name for one in source.stores}
        self._others = known | {*self._sensors, *self._actuators, *_OF_THE_KIT}
        self._known = self._others | self._stored

    def notes(self, simulation: Simulation) -> Iterator[str]:
        unknown = [one for one in (*self._source.waits, *self._source.gets) if not self._has(one.name)]
        if unknown and not self._source.is_open:
            _check_robot(simulation, self._source, {one.name for one in unknown})
            yield from map(self._nobody_stores, unknown)
        yield from self._nobody_takes()
        if simulation.request.io == "sim":  # only the run opens real devices
            yield from self._commands()
            yield from self._fields()

    def _has(self, key: str) -> bool:
        return key in self._known or key.removesuffix(_PREVIOUS) in self._known or key.startswith("link_")

    def _nobody_stores(self, asked: Said) -> str:
        return (
            f"{asked.place}{NEXT_LINE}Nothing in this robot stores the page '{asked.name}'.{NEXT_LINE}"
            f"Try: {nearest(asked.name, {*self._sensors, *self._stored}, 'stored are')}"
        )

    def _nobody_takes(self) -> Iterator[str]:
        taken = {one.name for one in (*self._source.waits, *self._source.gets)}
        for one in self._source.stores:
            close = difflib.get_close_matches(one.name, self._actuators, n=1, cutoff=0.7)
            if close and one.name not in taken | self._others:
                yield (
                    f"{one.place}{NEXT_LINE}Nothing in this robot takes the page '{one.name}'; its actuators take: "
                    f"{', '.join(self._actuators)}.{NEXT_LINE}Try: did you mean '{close[0]}'?"
                )

    def _commands(self) -> Iterator[str]:
        for one in self._source.stores:
            loop = self._actuators.get(one.name)
            if loop is None or not isinstance(one.node, (ast.Dict, ast.Constant)):
                continue
            wanted, limits = _told(partial(_command_of, loop)) or (None, {})
            if wanted is not None:
                yield from (f"{one.place}{NEXT_LINE}{words}" for words in _wrong(one, wanted, limits))

    def _fields(self) -> Iterator[str]:
        for key in dict.fromkeys(said.name for said, _ in self._source.fields):
            loop = self._sensors.get(key)
            if loop is None or key in self._stored:
                continue
            has = _told(partial(_page_of, loop))
            for said, name in self._source.fields:
                if said.name == key and isinstance(has, Mapping) and name not in has:
                    yield (
                        f"{said.place}{NEXT_LINE}The page '{key}' has no field '{name}'.{NEXT_LINE}"
                        f"Try: {nearest(name, has, 'its fields are')}"
                    )


def _command_of(loop: CommandLoop) -> tuple[Any, Mapping[str, tuple[float, float]]]:
    device: Any = loop.factory.open_device()
    return device.command_type, device.limits


def _page_of(loop: SensorLoop) -> Any:
    return loop.factory.data_of(loop.factory.open_device().read())


def _told(ask: Callable[[], Any]) -> Any:
    """Return a value from a simulated device that has not begun; None if it raises."""
    try:
        return ask()
    except Exception:  # an error in a device is reported when the run opens it
        return None


def _wrong(stored: Said, wanted: Any, limits: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    """Yield the errors in a command whose dict is a literal."""
    if not isinstance(stored.node, ast.Dict):
        yield (
            f"A command '{stored.name}' is {ast.unparse(stored.node)}, but must be a dict.{NEXT_LINE}"  # type: ignore[arg-type]
            f"Try: its fields are {', '.join(wanted.__struct_fields__)}."
        )
        return
    data = {}
    for key, value in zip(stored.node.keys, stored.node.values, strict=True):
        if not (isinstance(key, ast.Constant) and isinstance(key.value, str)):
            return
        known = _constant(value)
        if known is not None or key.value not in wanted.__struct_fields__:
            data[key.value] = known
        elif any(one.name == key.value and one.required for one in msgspec.structs.fields(wanted)):
            return
    try:
        command_of(data, wanted, dict(limits))
    except CommandError as error:
        yield f"A command '{stored.name}' is wrong: {error.message}{NEXT_LINE}Try: {error.fix}"
        return
    for name, value in data.items():
        low, high = limits.get(name, (-math.inf, math.inf))
        if isinstance(value, (int, float)) and not low <= value <= high:
            found = f"{value:g}" if math.isfinite(value) else f"{value}, which is no finite number"
            yield (
                f"A command '{stored.name}' has {name} = {found}; it goes from {low:g} to {high:g}.{NEXT_LINE}"
                f"Try: store what is from {low:g} to {high:g}."
            )


def _constant(node: ast.expr) -> Any:
    """Return the value of a literal, or None for another expression."""
    try:
        match node:
            case ast.Call(func=ast.Name(id="float"), args=[ast.Constant(value=str(text))]):
                return float(text)
        return ast.literal_eval(node)
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return None


def _of_components(nodes: Sequence[Node], source: Source) -> Iterator[str]:
    """Yield the errors in components as created: no handlers, or attributes that are read and never set."""
    for node in nodes:
        yield from without_handlers({name: one for name, one in node.components.items() if isinstance(one, Endpoint)})
        for component in node.components.values():
            kind = type(component)
            if kind.__name__ not in source.own or hasattr(kind, "__getattr__"):
                continue
            for name, place, _ in source.own[kind.__name__]:
                if name not in source.set_names and inspect.getattr_static(component, name, source) is source:
                    fix = near(name, vars(component)) or f"set it in __init__, before it is used: self.{name} = ..."
                    yield (
                        f"{place}{NEXT_LINE}The component '{component.name}', a {kind.__name__}, has no attribute "
                        f"'{name}', and nothing sets it.{NEXT_LINE}Try: {fix}"
                    )


def _check_robot(simulation: Simulation, source: Source, unknown: set[str]) -> None:
    """Raise a ConfigError if the robot has none of the pages that a controller handles and another robot has all."""
    waits = {one.name for one in source.waits}
    if not waits or not waits <= unknown:
        return
    for robot in library.known("robots"):
        if robot.name == simulation.robot.name or not waits <= set(_texts(robot.path / "robot.py")):
            continue
        first, place = source.waits[0], short_path(str(simulation.request.controller))
        scenarios = [one.name for one in library.known("scenarios") if library.robot_of_scenario(one) == robot.name]
        raise ConfigError(
            f"{first.place}{NEXT_LINE}This file is for another robot: '{first.name}' is a page of '{robot.name}', and "
            f"'{simulation.robot.name}', which is the robot of '{simulation.scenario_name}', has none.",
            fix=f"a scenario of '{robot.name}': snr run {(scenarios or ['SCENARIO'])[0]} --controller {place}.",
        )


def _called(node: ast.Call) -> str:
    function = node.func
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
