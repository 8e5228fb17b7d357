"""Add, remove and reload components of a running node, each between two tasks, on the node's thread.

A reload reads the files of a component again, and its factory, which keeps its state, creates the component again. If
a step fails, it is undone: the old code continues, and the outcome has the reason. No queued task is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, TypeAlias, TypeVar

from snr_sim.core.blame import describe_error
from snr_sim.core.component import CORE_NAME
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node_life import NodeLife
from snr_sim.core.reload.sources import Reading, modules_of, show_source_in_use
from snr_sim.core.reload.state_snapshot import Snapshot
from snr_sim.prelude.errors import ComponentFailed, ConfigError, SnrError, UnknownName, nearest

AnyComponent: TypeAlias = Endpoint | Loop
T = TypeVar("T")
PutOnProbation: TypeAlias = Callable[[dict[str, AnyComponent], dict[str, AnyComponent], Callable[[], None]], None]
ALL = "all"


@dataclass
class Outcome:
    """Outcome of a change, as in the page that reports it.

    Args:
        component: as requested: a name, or "all".
        ok: whether the whole request was executed.
        message: as text; of a failure the student's line first.
        made: names of the components that were created.
        sources: sha256 of each file that was read again, by folder and file name; also of one that is not Python.
    """

    component: str
    ok: bool
    message: str
    made: list[str] = field(default_factory=list)
    sources: dict[str, str] = field(default_factory=dict)


class Changes:
    """Manager of the components of one node: adds, removes and reloads them.

    In a replay the node has no loops, since their tasks come from the trace. If one of them is requested, it is created
    here, so that the outcome is the recorded one, but it never begins.

    Args:
        life: of their node.
    """

    def __init__(self, life: NodeLife) -> None:
        self.life = life
        self.node = life.node
        # Puts new code on probation: `rollback.Probations.begin`, if there are any.
        self.put_on_probation: PutOnProbation = lambda old, new, undo: None
        self._absent: dict[str, AnyComponent] | None = None  # the loops of a replay, created at the first request

    def reload(self, asked: str, more: Sequence[str] = ()) -> Outcome:
        """Recreate components from the present code in their files; each file is read once.

        Args:
            asked: a component's name, or "all", which leaves out consoles; those can be named.
            more: further names.
        """
        try:
            chosen = self._chosen([asked, *more])
        except SnrError as error:
            return Outcome(asked, False, str(error))
        return _Reload(self, asked, chosen).run()

    def add(self, factory: Any, is_started: bool) -> Outcome:
        """Add a factory's component as the last of the components."""
        node = self.node
        asked = type(factory).__name__
        try:
            component = self.life.registry.make(factory)
            asked = component.name
            other = node.components.get(asked) or self._absent_ones().get(asked)
            if other is not None:
                raise ConfigError(
                    f"A component '{asked}' is to be added, but there is one: a {type(other).__name__}. It stays.",
                    fix="remove the other one first, or give the new one a name of its own in its factory.",
                )
            self.exchange(None, component)
            if is_started:
                self._begin_added(component)
        except (Exception, SystemExit) as error:
            return Outcome(asked, False, _words(error, "while it was added; the node goes on without it"))
        return Outcome(asked, True, f"'{asked}' was added.", [asked])

    def _begin_added(self, component: AnyComponent) -> None:
        try:
            self.begin(component)
        except BaseException:
            self.life.end_removed(component)
            self.exchange(component, None)
            raise

    def remove(self, name: str) -> Outcome:
        """Halt a component, and remove it from the node."""
        try:
            component = self.find(name)
        except SnrError as error:
            return Outcome(name, False, str(error))
        self.exchange(component, None)  # first: a component that is being halted must not handle tasks
        failures = self.life.end_removed(component)
        return Outcome(name, not failures, "\n".join([f"'{name}' was removed.", *(one.message for one in failures)]))

    # The steps of all three

    def all(self) -> dict[str, AnyComponent]:
        """Return every component of the robot, in their order; in a replay the loops as well."""
        node = self.node
        known: dict[str, AnyComponent] = {
            name: one for name, one in node.components.items() if isinstance(one, (Endpoint, Loop)) and one.is_of_robot
        }
        known |= self._absent_ones()
        return {name: known[name] for name in sorted(known, key=self.life.registry.order_of)}

    def find(self, name: Any) -> AnyComponent:
        """Return a component.

        Raises:
            UnknownName: no component has that name, or it is the node's own.
        """
        if name == CORE_NAME:
            raise UnknownName(
                f"'{CORE_NAME}' is the node itself: it can be neither reloaded nor removed.",
                fix="tasks.terminate('why') ends the node.",
            )
        known = self.all()
        if not isinstance(name, str) or name not in known:
            raise UnknownName(
                f"Node '{self.node.name}' has no component '{str(name)[:80]}'.", fix=nearest(str(name), known)
            )
        return known[name]

    def _chosen(self, names: Sequence[str]) -> list[AnyComponent]:
        known = self.all()
        if list(names) == [ALL] and ALL not in known:
            return [one for one in known.values() if one.is_reloaded_with_all]
        found = [self.find(name) for name in names]
        return [one for i, one in enumerate(found) if one not in found[:i]]

    def is_absent(self, component: AnyComponent) -> bool:
        """Return whether a component is only a placeholder: a loop in a replay."""
        return self.node.is_replay and isinstance(component, Loop)

    def _absent_ones(self) -> dict[str, AnyComponent]:
        if not self.node.is_replay:
            return {}
        if self._absent is None:
            self._absent = {}
            for place, factory in enumerate(self.node.config.get(self.node.role), 1):
                if isinstance(factory, LoopFactory):
                    loop = self.life.registry.make(factory)
                    self._absent[loop.name] = loop
                    self.life.registry.give_place(loop.name, place)
        return self._absent

    def exchange(self, old: AnyComponent | None, new: AnyComponent | None) -> None:
        """Replace a component; `old` None: append, `new` None: remove."""
        one = new or old
        assert one is not None
        if not self.is_absent(one):
            self.life.registry.exchange(old, new)
            return
        absent = self._absent_ones()
        if new is None:
            del absent[one.name]
            return
        absent[one.name] = new
        if old is None:
            self.life.registry.give_place(one.name)

    def begin(self, component: AnyComponent) -> None:
        """Begin a component, unless it is a loop in a replay.

        Raises:
            ComponentFailed: it raised.
        """
        if not self.is_absent(component):
            self.life.begin_added(component)

    def begin_again(self, old: AnyComponent) -> list[str]:
        """Begin a component that was put back; if it fails, remove it and return the messages."""
        try:
            self.begin(old)
        except ComponentFailed as failure:
            self.life.end_removed(old)
            self.exchange(old, None)
            return [f"{failure.message}\n  so '{old.name}' could not go on either, and is gone."]
        return []


class _Reload:
    """One reload of some components: read, create, check, and only then exchange."""

    def __init__(self, changes: Changes, asked: str, components: Sequence[AnyComponent]) -> None:
        self._changes = changes
        self._asked = asked
        self._components = components
        self._readings: dict[ModuleType, Reading | BaseException] = {}
        self._users: dict[ModuleType, set[str]] = {}  # components whose new code is in a module, unless they failed
        self._before: dict[str, tuple[type[Any], dict[str, Any]]] = {}  # by component: class and state of its factory
        self._failures: dict[str, list[str]] = {}  # by message: components that keep their old code
        self._sources: dict[str, str] = {}
        self._remarks: list[str] = []
        self._made: list[str] = []
        self._old: dict[str, AnyComponent] = {}  # those that have begun and were exchanged, by name
        self._new: dict[str, AnyComponent] = {}
        self._undo: list[Callable[[], None]] = []  # what puts their factories back

    def run(self) -> Outcome:
        wanted = [(old, self._try(old, self._modules, old)) for old in self._components]
        for old, modules in wanted:
            for module in modules or ():
                self._users.setdefault(module, set()).add(old.name)
        self._changes.put_on_probation(self._old, self._new, self._roll_back)
        made = [(old, self._try(old, self._make, old, modules)) for old, modules in wanted if modules is not None]
        for old, new in made:
            if new is not None:
                self._try(old, self._swap, old, new)
        self._show_sources()
        return self._outcome()

    def _show_sources(self) -> None:
        for module in self._readings:
            show_source_in_use(module)

    def _try(self, component: AnyComponent, step: Callable[..., T], *args: Any) -> T | None:
        """Run a step for a component; if it fails, keep the component's old code and note the failure."""
        try:
            return step(*args)
        except (Exception, SystemExit) as error:
            self._keep(component)
            names = self._failures.setdefault(_words(error, "while it was read again for a reload"), [])
            names.append(component.name)
        except BaseException:
            self._keep(component)
            raise
        return None

    def _modules(self, component: AnyComponent) -> list[ModuleType]:
        modules = modules_of(component.factory, component)
        factory = type(component.factory)
        if "<locals>" in factory.__qualname__ and any(one.__name__ == factory.__module__ for one in modules):
            raise ConfigError(
                f"{factory.__qualname__} is defined inside a function, where a reload cannot find it.",
                fix=f"define the class {factory.__name__} at the top level of its file.",
            )
        return modules

    def _make(self, old: AnyComponent, modules: Sequence[ModuleType]) -> AnyComponent:
        for module in modules:
            self._read(module)
        factory = old.factory
        self._before[old.name] = type(factory), dict(vars(factory))
        factory.__class__ = _newest(type(factory), modules)
        new = self._changes.life.registry.make(factory)
        if new.name != old.name:
            raise ConfigError(
                f"{type(factory).__name__}.get() now makes a component '{new.name}' in the place of '{old.name}'.",
                fix="the name of a component stays; a new name needs a new start.",
            )
        return new

    def _read(self, module: ModuleType) -> None:
        """Read a module again, once per reload. Raises the error of reading it, also in later calls."""
        if module not in self._readings:
            try:
                reading = self._readings[module] = Reading(module)
                self._sources[reading.name] = reading.sha256
                try:
                    reading.execute()
                except BaseException:
                    reading.undo()
                    raise
            except (Exception, SystemExit) as error:
                self._readings[module] = error
        reading_or_error = self._readings[module]
        if isinstance(reading_or_error, BaseException):
            raise reading_or_error

    def _swap(self, old: AnyComponent, new: AnyComponent) -> None:
        changes = self._changes
        self._made.append(new.name)
        if not (changes.life.has_begun(old) or changes.is_absent(old)):
            changes.exchange(old, new)
            return
        self._before[old.name] = self._before[old.name][0], {}  # keep what the old one leaves in its factory
        self._remarks += [failure.message for failure in changes.life.end_removed(old)]
        state = Snapshot(old.factory, [module.__name__ for module in self._readings])
        changes.exchange(old, new)
        self._old[old.name], self._new[old.name] = old, new
        self._undo.append(lambda: self._put_back(old, state))
        try:
            changes.begin(new)
        except (Exception, SystemExit):
            del self._old[old.name], self._new[old.name], self._undo[-1]
            changes.life.end_removed(new)
            changes.exchange(new, old)
            self._made.remove(new.name)
            self._keep(old)
            self._remarks += changes.begin_again(old)
            raise

    def _put_back(self, old: AnyComponent, state: Snapshot) -> None:
        old.factory.__class__ = self._before[old.name][0]
        state.restore()

    def _roll_back(self) -> None:
        """Restore the code of all modules that were read, and the state of the factories."""
        for reading in self._readings.values():
            if isinstance(reading, Reading):
                reading.undo()
        for undo in self._undo:
            undo()
        self._show_sources()

    def _keep(self, component: AnyComponent) -> None:
        """Undo the steps for a component, except those that others of this reload need."""
        if component.name in self._before:
            component.factory.__class__, state = self._before.pop(component.name)
            vars(component.factory).update(state)
        for module, users in self._users.items():
            if component.name in users:
                users.remove(component.name)
                reading = self._readings.get(module)
                if not users and isinstance(reading, Reading):
                    reading.undo()

    def _outcome(self) -> Outcome:
        told = [f"{message}\n  Kept as before: {', '.join(names)}." for message, names in self._failures.items()]
        if self._made or not told:
            told.append(f"Made anew: {', '.join(self._made) or 'nothing'}.")
        told += self._remarks
        is_ok = not self._failures and not self._remarks
        return Outcome(self._asked, is_ok, "\n".join(told), self._made, self._sources)


def _newest(kind: type[Any], modules: Sequence[ModuleType]) -> type[Any]:
    """Return the class of that name in the reloaded module, or the class itself if its module was not reloaded.

    Raises:
        ConfigError: the new code has no such class.
    """
    for module in modules:
        if module.__name__ != kind.__module__:
            continue
        found: Any = module
        for name in kind.__qualname__.split("."):
            found = getattr(found, name, None)
        if isinstance(found, type):
            return found
        classes = [name for name, one in vars(module).items() if isinstance(one, type)]
        raise ConfigError(
            f"{Reading(module).name} no longer has the class {kind.__qualname__}.", fix=nearest(kind.__name__, classes)
        )
    return kind


def _words(error: BaseException, while_doing: str) -> str:
    return error.message if isinstance(error, ComponentFailed) else describe_error(error, while_doing)
