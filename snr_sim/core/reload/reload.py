"""Add, remove and reload components of a running node, each between two tasks, on the node's thread.

A reload reads the files of a component again, and its factory, which keeps its state, creates the component again. If
a step fails, it is undone: the old code continues, and the outcome has the reason. No queued task is lost.

The result is a page `reload` (`add_component`, `remove_component`): {component, ok, message, created, sources}, which
are the requested name; whether the whole request was executed; a text, of a failure with the student's line first;
names of the components created; and the sha256 of each file read, by folder and file name.

A reload waits for the new loop's `setup` (`setup_timeout_s`), so that a loop that fails leaves the old one in place. A
loop that fails after its removal (its `halt` raises, its process dies) is noted and does not end the node. Processes
get the sources of their node's modules as of the first send or the last reload, so they run the same code whatever was
saved since. Changes between import and the first process cannot be detected.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any, TypeAlias, TypeVar

from snr_sim.core.component import CORE_NAME
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.factory import ComponentFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node_life import NodeLife
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.reload.new_code_calls import AbandonedCallError, NewCodeCalls
from snr_sim.core.reload.sources import ModuleReload, modules_of, show_source_in_use
from snr_sim.core.reload.state_snapshot import Snapshot
from snr_sim.core.run_diagnostics import MAX_OF_A_KIND
from snr_sim.core.source_location import describe_error
from snr_sim.prelude import tasks
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, SnrError, UnknownNameError, suggest
from snr_sim.prelude.task import DataKey, SomeTasks, Task, TaskId, TaskType

AnyComponent: TypeAlias = Endpoint | Loop
T = TypeVar("T")
PutOnProbation: TypeAlias = Callable[[dict[str, AnyComponent], dict[str, AnyComponent], Callable[[], None]], None]
ALL = "all"


class ComponentManager:
    """Handlers of the tasks that add, remove and reload components of one node; `core` is its core endpoint.

    A replay begins without loops, since their tasks come from the trace. They are created at the first request, so that
    the outcome is the recorded one, but never begin.
    """

    def __init__(self, life: NodeLife, core: Endpoint) -> None:
        self.life: NodeLife = life
        self.node: NodeParts = life.node
        self._core = core
        # Puts new code on probation: `rollback.Probations.begin`, if there are any.
        self.put_on_probation: PutOnProbation = lambda old, new, undo: None
        # Puts a component on probation that new code has added: `rollback.Probations.begin_added`.
        self.put_added_on_probation: Callable[[Task, AnyComponent], None] = lambda task, component: None
        self.calls: NewCodeCalls = NewCodeCalls(self.node)
        self.replace_component: Callable[[Component | None, Component | None], None] = life.registry.replace_component
        self._has_loops = not self.node.is_replay
        self._failure, self._failures = "", 0  # the newest message, and how often it has come in a row

    def reload(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Recreate components from the present code in their files; each file is read once.

        The task's name is a component's, or "all", which leaves out consoles; its values are further names.
        """
        try:
            chosen = self._chosen([task.name, *task.val_list])
        except SnrError as error:
            return self.report(TaskType.reload.value, task.name, False, str(error))
        return _Reload(self, task.name, chosen).run()

    def add_component(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Add a factory's component as the last of the components; a second value of False does not begin it."""
        factory = task.val_list[0] if task.val_list else None
        is_started = len(task.val_list) < 2 or bool(task.val_list[1])
        requested = type(factory).__name__
        try:
            self._create_loops()
            component = self.life.registry.make(factory)
            requested = component.name
            other = self.node.components.get(requested)
            if other is not None:
                raise ConfigError(
                    f"A component '{requested}' is to be added, but there is one: a {type(other).__name__}. It stays.",
                    fix="remove the other one first, or give the new one a name of its own in its factory.",
                )
            self.replace_component(None, component)
            if is_started:
                self._begin_added(component)
            self.put_added_on_probation(task, component)
        except (Exception, SystemExit) as error:
            message = _error_text(error, "while it was added; the node continues without it")
            return self.report(tasks.ADD_COMPONENT_TASK_NAME, requested, False, message)
        return self.report(tasks.ADD_COMPONENT_TASK_NAME, requested, True, f"'{requested}' was added.", [requested])

    def _begin_added(self, component: AnyComponent) -> None:
        try:
            self.begin(component)
        except BaseException:
            self.life.end_removed(component)
            self.replace_component(component, None)
            raise

    def remove_component(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Halt the component of that name, and remove it from the node."""
        name = task.val_list[0] if task.val_list else ""
        try:
            component = self.find(name)
        except SnrError as error:
            return self.report(tasks.REMOVE_COMPONENT_TASK_NAME, name, False, str(error))
        self.replace_component(component, None)  # first: a component that is being halted must not handle tasks
        failures = self.life.end_removed(component)
        message = "\n".join([f"'{name}' was removed.", *(one.message for one in failures)])
        return self.report(tasks.REMOVE_COMPONENT_TASK_NAME, name, not failures, message)

    def report(
        self,
        key: DataKey,
        component: str,
        ok: bool,
        message: str,
        created: Sequence[str] = (),
        sources: Mapping[str, str] | None = None,
    ) -> Task:
        """Report the outcome of a change in the log, at the end of the run if it failed, and in the page returned."""
        self._failures = self._failures + 1 if message == self._failure else 1
        self._failure = "" if ok else message
        if ok:
            self._core.log.info("%s", message)
        elif self._failures <= MAX_OF_A_KIND:
            more = "\n  More of it in a row are not printed." if self._failures == MAX_OF_A_KIND else ""
            self._core.log.warning("%s%s", message, more)
            self.node.add_note(message)
        outcome: dict[str, Any] = {"component": component, "ok": ok, "message": message}
        return self._core.store_data_task(key, outcome | {"created": list(created), "sources": sources or {}})

    # The steps of all three

    def all(self) -> dict[str, AnyComponent]:
        """Return every component of the robot, in their order; in a replay the loops as well."""
        self._create_loops()
        components = self.node.components
        return {
            name: one
            for name in sorted(components, key=self.life.registry.order_of)
            if isinstance(one := components[name], (Endpoint, Loop)) and one.is_robot_component
        }

    def find(self, name: Any) -> AnyComponent:
        """Return a component; raise an UnknownNameError if no component has that name, or it is the node's own."""
        if name == CORE_NAME:
            raise UnknownNameError(
                f"'{CORE_NAME}' is the node itself: it can be neither reloaded nor removed.",
                fix="tasks.terminate('why') ends the node.",
            )
        known = self.all()
        if not isinstance(name, str) or name not in known:
            raise UnknownNameError(
                f"Node '{self.node.name}' has no component '{str(name)[:80]}'.", fix=suggest(str(name), known)
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

    def _create_loops(self) -> None:
        if not self._has_loops:
            self._has_loops = True
            for index, factory in enumerate(self.node.config.get(self.node.role), 1):
                if isinstance(factory, LoopFactory):
                    self.life.registry.add(self.life.registry.make(factory), index)

    def begin(self, component: AnyComponent) -> None:
        """Begin a component, raise a ComponentFailedError if it raises; a loop in a replay only raises as recorded."""
        what = f"{component.name}.begin"
        if self.is_absent(component):
            self.calls.raise_recorded(what, component.name)
            return
        try:
            self.life.begin_added(component)
        except ComponentFailedError as failure:
            if isinstance(component, Loop):
                self.calls.record(what, failure.message)
            raise

    def begin_again(self, old: AnyComponent) -> list[str]:
        """Begin a component that was put back; if it fails, remove it and return the messages."""
        try:
            self.begin(old)
        except ComponentFailedError as failure:
            self.life.end_removed(old)
            self.replace_component(old, None)
            return [f"{failure.message}\n  so '{old.name}' could not be restored either and was removed."]
        return []


class _Reload:
    """One reload of some components: read, create, check, and only then exchange."""

    def __init__(self, manager: ComponentManager, requested: str, components: Sequence[AnyComponent]) -> None:
        self._manager = manager
        self._requested = requested
        self._components = components
        self._module_reloads: dict[ModuleType, ModuleReload | BaseException] = {}
        self._users: dict[ModuleType, set[str]] = {}  # components whose new code is in a module, unless they failed
        # By component: the classes of its factory, and its state until the old component has left it.
        self._before: dict[str, tuple[Sequence[type[Any] | None], Snapshot | None]] = {}
        self._failures: dict[str, list[str]] = {}  # by message: components that keep their old code
        self._sources: dict[str, str] = {}
        self._remarks: list[str] = []
        self._created: list[str] = []
        self._old: dict[str, AnyComponent] = {}  # those that have begun and were exchanged, by name
        self._new: dict[str, AnyComponent] = {}
        self._undo: list[Callable[[], None]] = []  # what puts their factories back

    def run(self) -> Task:
        planned = [(old, self._try(old, self._modules, old)) for old in self._components]
        for old, modules in planned:
            for module in modules or ():
                self._users.setdefault(module, set()).add(old.name)
        self._manager.put_on_probation(self._old, self._new, self._roll_back)
        created = [(old, self._try(old, self._make, old, modules)) for old, modules in planned if modules is not None]
        for old, new in created:
            if new is not None:
                self._try(old, self._swap, old, new)
        self._show_sources()
        return self._outcome()

    def _show_sources(self) -> None:
        for module in self._module_reloads:
            show_source_in_use(module)

    def _try(self, component: AnyComponent, step: Callable[..., T], *args: Any) -> T | None:
        """Run a step for a component; if it fails, keep the component's old code and note the failure."""
        try:
            return step(*args)
        except BaseException as error:
            self._keep(component)
            if not isinstance(error, (Exception, SystemExit)):
                raise
            names = self._failures.setdefault(_error_text(error, "while it was read again for a reload"), [])
            names.append(component.name)
        return None

    def _modules(self, component: AnyComponent) -> list[ModuleType]:
        modules = modules_of(component.factory, component)
        for kind in filter(None, _classes(component.factory)):
            if "<locals>" in kind.__qualname__ and any(one.__name__ == kind.__module__ for one in modules):
                raise ConfigError(
                    f"{kind.__qualname__} is defined inside a function, where a reload cannot find it.",
                    fix=f"define the class {kind.__name__} at the top level of its file.",
                )
        return modules

    def _make(self, old: AnyComponent, modules: Sequence[ModuleType]) -> AnyComponent:
        for module in modules:
            self._read(module, old.name)
        factory, manager = old.factory, self._manager
        self._before[old.name] = _classes(factory), self._snapshot(old)
        _set_classes(factory, [kind and _newest(kind, modules) for kind in _classes(factory)])
        new = manager.calls.call(f"{old.name}.__init__", old.name, lambda: manager.life.registry.make(factory))
        if new.name != old.name:
            raise ConfigError(
                f"{type(factory).__name__}.get() now makes a component '{new.name}' in the place of '{old.name}'.",
                fix="the name of a component stays; a new name needs a new start.",
            )
        return new

    def _snapshot(self, component: AnyComponent) -> Snapshot:
        return Snapshot(component.factory, [module.__name__ for module in self._module_reloads])

    def _read(self, module: ModuleType, reader: str) -> None:
        """Read a module again, once per reload. Raises the error of reading it, also in later calls."""
        if module not in self._module_reloads:
            try:
                module_reload = self._module_reloads[module] = ModuleReload(module)
                self._sources[module_reload.name] = module_reload.sha256
                self._manager.calls.call(module_reload.name, reader, module_reload.execute)
            except (Exception, SystemExit) as error:
                self._module_reloads[module] = error
        module_reload_or_error = self._module_reloads[module]
        if isinstance(module_reload_or_error, BaseException):
            raise module_reload_or_error

    def _swap(self, old: AnyComponent, new: AnyComponent) -> None:
        manager = self._manager
        self._created.append(new.name)
        if not (manager.life.has_begun(old) or manager.is_absent(old)):
            manager.replace_component(old, new)
            return
        self._remarks += [failure.message for failure in manager.life.end_removed(old)]
        state = self._snapshot(old)  # with what the old one leaves in its factory
        self._before[old.name] = self._before[old.name][0], None
        manager.replace_component(old, new)
        self._old[old.name], self._new[old.name] = old, new
        self._undo.append(lambda: self._put_back(old, state))
        try:
            manager.calls.call(f"{new.name}.begin", new.name, lambda: manager.begin(new))
        except (Exception, SystemExit) as error:
            del self._old[old.name], self._new[old.name], self._undo[-1]
            manager.life.end_removed(new)
            if isinstance(error, AbandonedCallError):
                state.restore()  # a replay has not called it
            manager.replace_component(new, old)
            self._created.remove(new.name)
            self._keep(old)
            self._remarks += manager.begin_again(old)
            raise

    def _put_back(self, old: AnyComponent, state: Snapshot) -> None:
        state.restore()
        _set_classes(old.factory, self._before[old.name][0])

    def _roll_back(self) -> None:
        """Restore the code of all modules that were read, and the state of the factories."""
        for module_reload in self._module_reloads.values():
            if isinstance(module_reload, ModuleReload):
                module_reload.undo()
        for undo in self._undo:
            undo()
        self._show_sources()

    def _keep(self, component: AnyComponent) -> None:
        """Undo the steps for a component, except those that others of this reload need."""
        if component.name in self._before:
            classes, state = self._before.pop(component.name)
            _set_classes(component.factory, classes)
            if state is not None:
                state.restore()
        for module, users in self._users.items():
            if component.name in users:
                users.remove(component.name)
                module_reload = self._module_reloads.get(module)
                if not users and isinstance(module_reload, ModuleReload):
                    module_reload.undo()

    def _outcome(self) -> Task:
        lines = [f"{message}\n  Kept as before: {', '.join(names)}." for message, names in self._failures.items()]
        if self._created or not lines:
            lines.append(f"Recreated: {', '.join(self._created) or 'nothing'}.")
        lines += self._remarks
        is_ok = not self._failures and not self._remarks
        key = TaskType.reload.value
        return self._manager.report(key, self._requested, is_ok, "\n".join(lines), self._created, self._sources)


def _classes(factory: ComponentFactory) -> tuple[type[Any], type[Any] | None]:
    """Return the class of a factory, and that of its components if the factory is of the short form."""
    short = factory._short_form
    return type(factory), None if short is None else short.component_class


def _set_classes(factory: ComponentFactory, classes: Sequence[type[Any] | None]) -> None:
    kind, component_class = classes
    assert kind is not None
    factory.__class__ = kind
    if component_class is not None and factory._short_form is not None:
        factory._short_form = replace(factory._short_form, component_class=component_class)


def _newest(kind: type[Any], modules: Sequence[ModuleType]) -> type[Any]:
    """Return the class of that name in its reloaded module, or the class itself if its module was not reloaded."""
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
            f"{ModuleReload(module).name} no longer has the class {kind.__qualname__}.",
            fix=suggest(kind.__name__, classes),
        )
    return kind


def _error_text(error: BaseException, while_doing: str) -> str:
    return error.message if isinstance(error, ComponentFailedError) else describe_error(error, while_doing)
