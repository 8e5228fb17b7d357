"""Registry of a node's components: created by factories, checked, ordered, and exchanged at run time."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Collection, Iterable
from types import FunctionType
from typing import Any
from weakref import WeakSet

from snr_sim.core.endpoint import Endpoint, EndpointFactory, is_decorated
from snr_sim.core.handlers import check_returns
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.run_diagnostics import attribute_location
from snr_sim.core.source_location import (
    after_line,
    class_location,
    describe_error,
    location_of,
    prepend_location,
    without_addresses,
)
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ConfigError, SnrError

_STEPS = ("begin", "setup", "loop", "halt", "terminate")  # methods that an author may write, besides handlers
_checked_steps: WeakSet[FunctionType] = WeakSet()  # once a function, not once a component: 40 us each


class ComponentRegistry:
    """Components of one node by name, and the order in which they handle a task.

    Attributes:
        components: by name; a new dict after each change at run time, because other threads read it.
    """

    def __init__(self, node: NodeParts) -> None:
        self.components: dict[str, Component] = {}
        self._node = node
        self._indices: dict[str, int] = {}
        self._last_index = 0

    def add_all(self, factories: Iterable[Any], is_replay: bool) -> None:
        """Create and append a component of each factory, as `make` and `add` do; in a replay leave out loops."""
        for self._last_index, factory in enumerate(factories, 1):
            if not (is_replay and isinstance(factory, LoopFactory)):
                self.add(self.make(factory), self._last_index)

    def make(self, factory: Any) -> Endpoint | Loop:
        """Return a factory's component, checked; it is not yet added to the node.

        Raises:
            ConfigError: the factory does not return a component.
        """
        node, name = self._node, type(factory).__name__
        if not isinstance(factory, (EndpointFactory, LoopFactory)):
            what, fix = _describe_non_factory(factory)
            raise ConfigError(f"Role '{node.role}' lists {what} where a factory belongs.", fix=fix)
        made = getattr(factory._short_form, "component_class", None)
        try:
            component = factory.get(node)
        except SnrError as error:
            prepend_location(error, made)
            raise
        except (Exception, SystemExit) as error:
            what = f"while {name}.get() made a component of role '{node.role}'"
            begins = (made and location_of(made.__init__)) or class_location(made or type(factory))
            raise ConfigError(describe_error(error, what, begins)) from error
        expected: type[Endpoint | Loop] = Endpoint if isinstance(factory, EndpointFactory) else Loop
        if not isinstance(component, expected):
            location = location_of(factory.get)
            where = f"{location}\n  " if location is not None else ""
            raise ConfigError(
                f"{where}{name}.get() of role '{node.role}' returned {without_addresses(repr(component))}, "
                f"but should return {'an' if expected is Endpoint else 'a'} {expected.__name__}.",
                fix=f"end get(self, parent) with: return My{expected.__name__}(self, parent, 'its_name').",
            )
        if not hasattr(component, "name"):
            what = f"{type(component).__name__} of role '{node.role}' has not called its parent's __init__."
            message = after_line(location_of(type(component).__init__), what)
            raise ConfigError(message, fix="begin its __init__ with: super().__init__(factory, parent, name).")
        if component.parent is not node or not isinstance(component.name, str):
            raise _misused_attribute(component, node)
        for step in _STEPS:
            _check_step(component, step)
        _check_names(component, "optional_events" if isinstance(component, Endpoint) else "wakes_on")
        if isinstance(component, Endpoint) and hasattr(component, "task_source"):
            node.add_note(
                f"'{component.name}' has a task_source(), which nothing calls: a Loop brings in what is outside."
            )
        if isinstance(component, Loop) and (component.task_handlers or is_decorated(type(component))):
            raise ConfigError(
                f"Loop '{component.name}' of role '{node.role}' registers handlers, but a loop only brings tasks in.",
                fix="put the handlers into an endpoint: a replay runs endpoints, but no loops.",
            )
        return component

    def add(self, component: Component, index: int) -> None:
        """Add what `make` has returned, at `index` in the order; raise a ConfigError if its name is taken."""
        other = self.components.get(component.name)
        if other is not None:
            what = (
                f"Role '{self._node.role}' has two components named '{component.name}': "
                f"a {type(other).__name__} and a {type(component).__name__}."
            )
            message = after_line(class_location(type(component)) or class_location(type(other)), what)
            raise ConfigError(message, fix="give each component a name of its own in its factory.")
        self.components[component.name] = component
        self._indices[component.name] = index
        self._node.machine.lookup.invalidate()

    def replace_component(self, old: Component | None, new: Component | None) -> None:
        """Replace a component by one of the same name; `old` None: append, `new` None: remove."""
        lookup = self._node.machine.lookup
        if old is None and new is not None:
            components = self.components.copy()  # faster than to insert 1000 items into a new dict
            components[new.name] = new
            self.components = components
            self._last_index += 1
            self._indices[new.name] = self._last_index
            lookup.components = self.components
            lookup.add(new)
            return
        items = [(name, new if one is old else one) for name, one in self.components.items()]
        self.components = {name: one for name, one in items if one is not None}
        lookup.components = self.components
        lookup.invalidate()

    def order_of(self, component_name: str) -> int:
        """Return a component's index in the order of the node's components; a reload keeps it."""
        return self._indices[component_name]


def _describe_non_factory(factory: Any) -> tuple[str, str]:
    """Return what a role lists where a factory belongs, and what to do about it."""
    owner = getattr(factory, "__self__", None)
    if inspect.ismethod(factory) and owner is not None and not isinstance(owner, type):
        call = f'call it: .{factory.__name__}(...), as in tether.server("depth").'
        return f"{type(owner).__name__}.{factory.__name__}", call
    if isinstance(factory, type) and issubclass(factory, (Endpoint, Loop)):
        return f"the class {factory.__name__}", f"{factory.__name__}.factory()."
    if hasattr(factory, "attach"):  # runners.NodeLink
        instead = "SimRunner(config, links=[link]); between processes a SocketsPair or a PipesPair."
        return f"a {type(factory).__name__}, which links roles of one simulation,", instead
    return repr(factory), "list instances: [MyFactory()], not the class and not the endpoint itself."


def _misused_attribute(component: Endpoint | Loop, node: NodeParts) -> ConfigError:
    """Return the error for a component that has put something else into an attribute that its node needs."""
    name, what = ("name", "name, a text") if component.parent is node else ("parent", "node")
    message = (
        f"{type(component).__name__} of role '{node.role}' sets self.{name} to "
        f"{without_addresses(repr(getattr(component, name)))[:80]}, where the component's {what}, belongs."
    )
    where = attribute_location(component, name) or class_location(type(component))
    return ConfigError(after_line(where, message), fix="give your own attribute another name.")


def _check_names(component: Endpoint | Loop, attribute: str) -> None:
    """Raise a ConfigError if an attribute is not a collection of names: a text would be one of its letters."""
    names, kind = getattr(component, attribute), type(component)
    if isinstance(names, str) or not (isinstance(names, Collection) and all(isinstance(one, str) for one in names)):
        what = f"{kind.__name__} has {attribute} = {names!r}, which is not a tuple of names."
        fix = f"{attribute} = ({names if isinstance(names, str) else 'name'!r},)."
        raise ConfigError(after_line(class_location(kind), what), fix=fix)


def _check_step(component: Endpoint | Loop, step: str) -> None:
    """Check a method of a component's life where it is made; a Loop has a `loop` of its own.

    Raises:
        ConfigError: calling it would not run it, or it cannot be called without arguments, or it is missing.
    """
    method = getattr(component, step, None)
    function = getattr(method, "__func__", None)
    if method is None or function in _checked_steps:
        return
    check_returns(f"{step}() of component '{component.name}'", method)
    kind = type(component)
    if isinstance(component, Loop) and getattr(kind, step) is Loop.loop:
        close = difflib.get_close_matches("loop", [name for name, one in vars(kind).items() if callable(one)], n=1)
        message = after_line(class_location(kind), f"{kind.__name__} is a Loop and has no method loop(self).")
        raise ConfigError(message, fix=f"def loop(self){f', not {close[0]}' if close else ', called at each tick'}.")
    try:
        inspect.signature(method).bind()
        if isinstance(function, FunctionType):
            _checked_steps.add(function)
    except TypeError:
        what = f"{step}() of {kind.__name__} takes {inspect.signature(method)}, but is called without arguments."
        raise ConfigError(after_line(location_of(method), what), fix=f"def {step}(self):") from None
    except ValueError:
        return  # some callables written in C have no signature
