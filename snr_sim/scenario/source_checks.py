"""Static checks before a run: of the source of a controller, and of its components as created.

No student code is executed. The robot's pages are known from its components and its simulated devices; what a
controller uses is read from its source by `controller_source.py`.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.core.endpoint import Endpoint
from snr_sim.core.hints import NEAR_ATTRIBUTE, near
from snr_sim.core.loop import Loop
from snr_sim.core.node import Node
from snr_sim.core.run_diagnostics import NEXT_LINE, without_handlers, writers_of
from snr_sim.core.source_location import class_location, location_of, short_path
from snr_sim.devices.commands import CommandLoop, command_of
from snr_sim.devices.readings import SensorLoop
from snr_sim.prelude.errors import CommandError, ConfigError, suggest
from snr_sim.prelude.task import TaskType
from snr_sim.scenario import library
from snr_sim.scenario.controller_source import Source, SourceLiteral, finding, read_source, texts_of
from snr_sim.scenario.simulation import Simulation

_LIBRARY_KEYS = ("recording", "reload", "add_component", "remove_component")
_PREVIOUS = "_prev"
MAX_USUAL_RATE_HZ = 10_000.0
# What a node uses of a component that its author writes.
_USED_OF_ENDPOINT = ("begin", "halt", "terminate", "join", "task_handlers", "optional_events")
_USED_OF_LOOP = (
    *("begin", "setup", "loop", "halt", "terminate", "join", "max_tick_rate_hz", "first_tick_after_s"),
    *("next_tick_at_s", "wakes_on", "executor"),
)


def notes_before(simulation: Simulation, nodes: Sequence[Node], is_running: bool = False) -> list[str]:
    """Return the errors that can be found now in a controller of the user's own, each with its line first.

    Args:
        simulation: what runs.
        nodes: with its components.
        is_running: whether they have begun; then no device is opened to compare fields and commands with.

    Raises:
        ConfigError: it is for another robot.
    """
    files = simulation.files()
    mine = [path for name, path in files.items() if _is_controllers(name, path)]
    if not mine:
        return []
    known = {text for name, path in files.items() if path not in mine for text in texts_of(path)}
    source = read_source(mine)
    robot = _Robot(nodes, known, source)
    return list(dict.fromkeys([*source.plain, *_of_components(nodes, source), *robot.notes(simulation, is_running)]))


def notes_on_files(files: Sequence[Path]) -> list[str]:
    """Return the errors in Python files that do not depend on the robot, each with its line first."""
    return list(dict.fromkeys(read_source(files).plain))


def _is_controllers(name: str, path: Path) -> bool:
    return name.startswith("controller/") and path.suffix == ".py" and library.is_own(path)


class _Robot:
    """Pages that a robot's components store and handle, for comparison with a controller's source."""

    def __init__(self, nodes: Sequence[Node], known: set[str], source: Source) -> None:
        components = [component for node in nodes for component in node.components.values()]
        self._sensors = {one.factory.key: one for one in components if isinstance(one, SensorLoop)}
        self._actuators = {one.factory.key: one for one in components if isinstance(one, CommandLoop)}
        self._components = components
        self._source = source
        self._stored = {one.name for one in source.stores}
        self._others = known | {*self._sensors, *self._actuators, *_LIBRARY_KEYS}
        self._known = self._others | self._stored

    def notes(self, simulation: Simulation, is_running: bool) -> Iterator[str]:
        loops = [one for one in self._components if isinstance(one, Loop) and type(one).__name__ in self._source.own]
        woken = [SourceLiteral(key, at) for one in loops if (at := class_location(type(one))) for key in one.wakes_on]
        unknown = [one for one in (*self._source.waits, *self._source.gets, *woken) if not self._has(one.name)]
        if unknown and not self._source.is_open:
            _check_robot(simulation, self._source, {one.name for one in unknown})
            yield from map(self._unstored_page, unknown)
        yield from self._unhandled_pages()
        yield from self._unhandled_events()
        yield from self._commands_of_several()
        if simulation.request.io == "sim" and not is_running:  # only the run opens real devices
            yield from self._commands()
            yield from self._fields()

    def _has(self, key: str) -> bool:
        return key in self._known or key.removesuffix(_PREVIOUS) in self._known or key.startswith("link_")

    def _unstored_page(self, asked: SourceLiteral) -> str:
        fix = suggest(asked.name, {*self._sensors, *self._stored}, "stored are")
        return finding(asked.place, f"Nothing in this robot stores the page '{asked.name}'.", fix)

    def _unhandled_pages(self) -> Iterator[str]:
        taken = {one.name for one in (*self._source.waits, *self._source.gets)}
        for one in self._source.stores:
            close = difflib.get_close_matches(one.name, self._actuators, n=1, cutoff=0.7)
            if close and one.name not in taken | self._others:
                what = f"Nothing in this robot takes the page '{one.name}'; its actuators take: "
                yield finding(one.place, f"{what}{', '.join(self._actuators)}.", f"did you mean '{close[0]}'?")

    def _unhandled_events(self) -> Iterator[str]:
        ids = [task_id for one in self._components for task_id in one.task_handlers]
        handled = {one[1] for one in ids if isinstance(one, tuple) and one[0] is TaskType.event} | self._source.handled
        known = handled.union(self._others, *(getattr(one, "optional_events", ()) for one in self._components))
        for one in self._source.sent if TaskType.event not in ids else ():
            if one.name not in known:
                fix = near(one.name, handled) or f"@handles(event={one.name!r}) above the method that is to handle it."
                yield finding(one.place, f"Nothing in this robot handles the event '{one.name}'.", fix)

    def _commands_of_several(self) -> Iterator[str]:
        for key in sorted(self._stored & self._actuators.keys()):
            writers = {one.component: one.location for one in writers_of(key, self._components)}
            if len(writers) > 1:
                what = f"Several components store the command '{key}': {', '.join(writers)}. The newest one counts."
                fix = "let one store it; the others store pages of their own, from which that one decides."
                yield finding([*writers.values()][-1], what, fix)

    def _commands(self) -> Iterator[str]:
        for one in self._source.stores:
            loop = self._actuators.get(one.name)
            if loop is None or not isinstance(one.node, (ast.Dict, ast.Constant)):
                continue
            struct, limits = _value_or_none(partial(_command_of, loop)) or (None, {})
            if struct is not None:
                yield from (finding(one.place, *error) for error in _command_errors(one, struct, limits))

    def _fields(self) -> Iterator[str]:
        for key in dict.fromkeys(literal.name for literal, _ in self._source.fields):
            loop = self._sensors.get(key)
            if loop is None or key in self._stored:
                continue
            has = _value_or_none(partial(_page_of, loop))
            for literal, name in self._source.fields:
                if literal.name == key and isinstance(has, Mapping) and name not in has:
                    what = f"The page '{key}' has no field '{name}'."
                    yield finding(literal.place, what, suggest(name, has, "its fields are"))


def _command_of(loop: CommandLoop) -> tuple[Any, Mapping[str, tuple[float, float]]]:
    device: Any = loop.factory.open_device()
    return device.command_type, device.limits


def _page_of(loop: SensorLoop) -> Any:
    return loop.factory.data_of(loop.factory.open_device().read())


def _value_or_none(ask: Callable[[], Any]) -> Any:
    """Return a value from a simulated device that has not begun; None if it raises."""
    try:
        return ask()
    except Exception:  # an error in a device is reported when the run opens it
        return None


def _command_errors(
    stored: SourceLiteral, struct: Any, limits: Mapping[str, tuple[float, float]]
) -> Iterator[tuple[str, str]]:
    """Yield what is wrong in a command whose dict is a literal, and the fix."""
    command = f"A command '{stored.name}'"
    if not isinstance(stored.node, ast.Dict):
        found = ast.unparse(stored.node)  # type: ignore[arg-type]
        yield f"{command} is {found}, but must be a dict.", f"its fields are {', '.join(struct.__struct_fields__)}."
        return
    data = {}
    for key, value in zip(stored.node.keys, stored.node.values, strict=True):
        if not (isinstance(key, ast.Constant) and isinstance(key.value, str)):
            return
        known = _constant(value)
        if known is not None or key.value not in struct.__struct_fields__:
            data[key.value] = known
        elif any(one.name == key.value and one.required for one in msgspec.structs.fields(struct)):
            return
    try:
        command_of(data, struct, dict(limits))
    except CommandError as error:
        yield f"{command} is wrong: {error.message}", error.fix
        return
    for name, value in data.items():
        low, high = limits.get(name, (-math.inf, math.inf))
        if isinstance(value, (int, float)) and not low <= value <= high:
            found = f"{value:g}" if math.isfinite(value) else f"{value}, which is not finite"
            what = f"{command} has {name} = {found}; it goes from {low:g} to {high:g}."
            yield what, f"store what is from {low:g} to {high:g}."


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
            if isinstance(component, (Endpoint, Loop)):
                yield from _misnamed(component, source)
            if isinstance(component, Loop) and component.max_tick_rate_hz > MAX_USUAL_RATE_HZ:
                what = f"The loop '{component.name}' ticks {component.max_tick_rate_hz:g} times a second."
                yield finding(class_location(kind), what, "50 Hz suffice for most; a simulation executes every tick.")
            for name, place, _ in source.own[kind.__name__]:
                if name not in source.set_names and inspect.getattr_static(component, name, source) is source:
                    fix = (
                        near(name, _public_names(component), NEAR_ATTRIBUTE)
                        or f"set it in __init__, before it is used: self.{name} = ..."
                    )
                    what = f"The component '{component.name}', a {kind.__name__}, has no attribute '{name}'"
                    yield finding(place, f"{what}, and nothing sets it.", fix)


def _misnamed(component: Endpoint | Loop, source: Source) -> Iterator[str]:
    """Yield the names in a component's own class that nothing uses and that are nearly those that its node uses."""
    used = _USED_OF_LOOP if isinstance(component, Loop) else _USED_OF_ENDPOINT
    read = {name for reads in source.own.values() for name, _, _ in reads}
    kind = type(component)
    for name, member in vars(kind).items():
        if name == "name" and isinstance(member, str) and member != component.name:
            what = f"The name of {kind.__name__} has no effect: its factory names the component '{component.name}'."
            yield finding(class_location(kind), what, f"{kind.__name__}.factory(name={member!r}).")
        if name.startswith("_") or name in used or name in read:
            continue
        place = location_of(member) or class_location(kind)
        if name in _USED_OF_LOOP and not isinstance(component, Loop):
            what = f"{kind.__name__} is an Endpoint, and nothing uses its {name}: a Loop has one."
            yield finding(place, what, f"class {kind.__name__}(Loop), or a handler that is called with a page.")
        elif close := difflib.get_close_matches(name, used, n=1, cutoff=0.8):
            yield finding(place, f"Nothing uses {name} of {kind.__name__}.", f"did you mean '{close[0]}'?")


def _public_names(component: object) -> list[str]:
    return [name for name in dir(component) if not name.startswith("_")]


def _check_robot(simulation: Simulation, source: Source, unknown: set[str]) -> None:
    """Raise a ConfigError if the robot has none of the pages that a controller handles and another robot has all."""
    waits = {one.name for one in source.waits}
    if not waits or not waits <= unknown:
        return
    for robot in library.list_available("robots"):
        if robot.name == simulation.robot.name or not waits <= set(texts_of(robot.path / "robot.py")):
            continue
        first, place = source.waits[0], short_path(str(simulation.request.controller))
        scenarios = [
            one.name for one in library.list_available("scenarios") if library.robot_of_scenario(one) == robot.name
        ]
        raise ConfigError(
            f"{first.place}{NEXT_LINE}This file is for another robot: '{first.name}' is a page of '{robot.name}', and "
            f"'{simulation.robot.name}', which is the robot of '{simulation.scenario_name}', has none.",
            fix=f"a scenario of '{robot.name}': snr run {(scenarios or ['SCENARIO'])[0]} --controller {place}.",
        )
