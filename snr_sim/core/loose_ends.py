"""What hung loose in a run: tasks nobody handled, handlers nobody called, pages nobody stored. Never silent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from snr_sim.core.component import CORE_NAME
from snr_sim.core.datastore import PREVIOUS, Datastore
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.handlers import Entry, describe
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import nearest
from snr_sim.prelude.recorder import RECORDING_KEY
from snr_sim.prelude.task import TaskName, TaskType

_STEPS = ("begin", "join", "halt", "terminate")
Seen = Mapping[TaskType, Mapping[TaskName, tuple[Entry, ...]]]


def loose_ends(components: Mapping[str, Component], seen: Seen, datastore: Datastore) -> list[str]:
    """Returns a sentence for each, with the nearest known name.

    Args:
        components: of the node.
        seen: every task id that came by, with who handled it.
        datastore: knows which pages were asked for in vain.
    """
    # The node's own endpoint waits for whatever may be asked of a node, and nothing of it has to come.
    of_the_robot = {name: component for name, component in components.items() if name != CORE_NAME}
    return [
        *_unhandled(of_the_robot, seen),
        *_never_called(of_the_robot, seen, datastore),
        *_without_handlers(of_the_robot, seen),
        *_never_stored(datastore),
        *_named_as_previous(datastore),
    ]


def _unhandled(components: Mapping[str, Component], seen: Seen) -> Iterator[str]:
    for kind in (TaskType.event, TaskType.reload):
        for name, entries in seen[kind].items():
            if not entries:
                known = {
                    task_id[1] for task_id in _ids(components) if isinstance(task_id, tuple) and task_id[0] is kind
                }
                yield f"Nobody handled {describe((kind, name))}; {nearest(name, known, 'handlers wait for')}"


def _never_called(components: Mapping[str, Component], seen: Seen, datastore: Datastore) -> Iterator[str]:
    for component in components.values():
        for task_id in component.task_handlers:
            if (
                isinstance(task_id, tuple)
                and task_id[1] not in seen[task_id[0]]
                and task_id[0] is not TaskType.terminate
                and task_id[1] != RECORDING_KEY
            ):
                kind, name = task_id
                if kind is TaskType.process_data and name in datastore.pages:
                    yield (
                        f"'{component.name}' waits for {describe(task_id)}, which never came: that page was stored "
                        f"without a task (process=False). Look it up: self.get_data({str(name)!r})."
                    )
                    continue
                verb = "sent" if kind is TaskType.event else "stored" if kind is not TaskType.reload else "asked for"
                near = nearest(name, seen[kind], f"{verb} were")
                yield f"'{component.name}' waits for {describe(task_id)}, which nobody {verb}; {near}"


def _without_handlers(components: Mapping[str, Component], seen: Seen) -> Iterator[str]:
    """Endpoints that do nothing at all; one that works in `begin`, `halt` or `terminate` only is well."""
    called = {entry[0].name for by_name in seen.values() for entries in by_name.values() for entry in entries}
    for component in components.values():
        is_idle = isinstance(component, Endpoint) and not component.task_handlers and component.name not in called
        if is_idle and all(getattr(type(component), step) is getattr(Endpoint, step) for step in _STEPS):
            yield (
                f"Endpoint '{component.name}' has no handlers, so nothing calls it; "
                "set self.task_handlers = {...} in its __init__."
            )


def _never_stored(datastore: Datastore) -> Iterator[str]:
    for key in datastore.missed:
        if key not in datastore.pages and key != RECORDING_KEY:  # which is only there when something is wrong
            near = nearest(str(key), datastore.pages, "stored were")
            yield f"Page '{key}' was asked for, but nobody stored it; {near}"


def _named_as_previous(datastore: Datastore) -> Iterator[str]:
    for key in datastore.pages:
        if key.endswith(PREVIOUS) and (newest := key.removesuffix(PREVIOUS)) in datastore.pages:
            yield (
                f"Page '{key}' was stored, which is also the name of the page before the newest '{newest}': "
                f"self.get_data({key!r}) gave the stored one. Give it another name."
            )


def _ids(components: Mapping[str, Component]) -> Iterator[object]:
    for component in components.values():
        yield from component.task_handlers
