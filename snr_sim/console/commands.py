"""The commands of the console: their table and functions. A console can do nothing that is not in this module.

A command that changes something sends a task to the node's inbox, like any other input: it is recorded and
replayed. Commands that only read use copies and change nothing. The effect of a task or a page depends on the robot's
own code: a handler that fails on a value fails as with any other input.
"""

from __future__ import annotations

from snr_sim.console import introspection
from snr_sim.console.formatting import format_short, truncate, truncate_value
from snr_sim.console.parsing import Argument, CommandResult, CommandSpec, ConsoleCommandError, Given, help_text, quote
from snr_sim.console.session import ConsoleSession
from snr_sim.core.component import CORE_NAME
from snr_sim.core.node import Node
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import suggest
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.prelude.text import visible

ALL = "all"
LISTS = ("components", "pages", "links", "loops")
ALSO_LISTED = ("commands", "endpoints")  # the names in the thesis for `help` and for the components
DUMPS = ("profiler", "datastore", "links", "loops")


def _exit(session: ConsoleSession, given: Given) -> CommandResult:
    reason = given["REASON"] or session.source
    session.enqueue(tasks.terminate(reason))
    return CommandResult(f"{session.node.name} is asked to end: {reason}", {"exit": reason})


def _task(session: ConsoleSession, given: Given) -> CommandResult:
    kind, name, values = TaskType(given.get("TYPE", TaskType.event)), given["NAME"], given["JSON"]
    if kind is TaskType.event:
        return _event(session, name, values)
    if kind is TaskType.store_page:
        if len(values) != 1:
            raise ConsoleCommandError(f"store_page takes one value, not {len(values)}.", fix="store KEY JSON.")
        return _store(session, {"KEY": name, "JSON": values[0]})
    if values:
        raise ConsoleCommandError(f"A {kind.value} task carries no values.", fix=f"task {kind.value} {name}")
    if kind is TaskType.terminate:
        return _exit(session, {"REASON": name})
    if kind is TaskType.reload:
        return _reload(session, {"NAME": name})
    _page_of(session.node, name)
    session.enqueue(Task(kind, name))
    return CommandResult(f"process_data '{name}' is queued.", {"task": [kind.value, name]})


def _event(session: ConsoleSession, name: str, values: list[object]) -> CommandResult:
    known = events_of(session.node)
    if (TaskType.event, name) in session.node.components[CORE_NAME].task_handlers:
        raise ConsoleCommandError(f"The event '{name}' is the node's own.", fix=suggest(name, known))
    handles_all = any(TaskType.event in one.task_handlers for one in session.node.components.copy().values())
    if name not in known and not handles_all:
        fix = suggest(name, known) if known else "list, which shows the components."
        raise ConsoleCommandError(f"No component of this node handles an event '{name}'.", fix=fix)
    session.admit_name(f"event {name}", name in known)
    session.enqueue(tasks.event(name, values))
    return CommandResult(f"event '{name}' is queued.", {"task": ["event", name, values]})


def _store(session: ConsoleSession, given: Given) -> CommandResult:
    key, value, pages = given["KEY"], given["JSON"], session.node.datastore.pages
    session.admit_name(f"page {key}", key in pages)
    before, shown = pages.get(key), f"{key} = {format_short(value)}"

    def poll_stored() -> CommandResult | None:
        is_stored = pages.get(key) is not before
        return CommandResult(f"{shown} is stored.", {"store": key}) if is_stored else None

    session.expect(session.node.store_data_task(key, value), shown, poll_stored)
    return CommandResult(f"{shown} is queued.", {"store": key})


def _reload(session: ConsoleSession, given: Given) -> CommandResult:
    name, known = given["NAME"], components_of(session.node)
    if name not in (ALL, *known):
        raise ConsoleCommandError(f"There is no component '{name}' to reload.", fix=suggest(name, [ALL, *known]))
    pages, key = session.node.datastore.pages, TaskType.reload.value
    before = pages.get(key)

    def poll_reloaded() -> CommandResult | None:
        page = pages.get(key)
        report = page.data if page is not None and page is not before else None
        if not isinstance(report, dict) or report.get("component") != name:
            return None
        text = truncate(visible(str(report.get("message"))))
        return CommandResult(text, truncate_value(report), is_error=not report.get("ok"))

    session.expect(tasks.reload_component(name), f"reload of '{name}'", poll_reloaded)
    return CommandResult(f"reload of '{name}' is queued.", {"reload": name})


def _list(session: ConsoleSession, given: Given) -> CommandResult:
    if given.get("WHAT") == "commands":
        return _help(session, {})
    return CommandResult(*introspection.views(session.node, (given["WHAT"],) if "WHAT" in given else LISTS))


def _dump(session: ConsoleSession, given: Given) -> CommandResult:
    what = given.get("WHAT")
    if what is None or what in DUMPS:
        return CommandResult(*introspection.views(session.node, DUMPS if what is None else (what,)))
    return CommandResult(*introspection.page(session.node, _page_of(session.node, what)))


def _watch(session: ConsoleSession, given: Given) -> CommandResult:
    return session.watch(given["KEY"])


def _unwatch(session: ConsoleSession, given: Given) -> CommandResult:
    return session.unwatch(given.get("KEY"))


def _help(_session: ConsoleSession, given: Given) -> CommandResult:
    name = given.get("COMMAND")
    if name is None:
        return CommandResult(help_text(TABLE), sorted(TABLE))
    if name not in TABLE:
        raise ConsoleCommandError(f"There is no command {quote(name)}.", fix=suggest(name, TABLE))
    return CommandResult(help_text({name: TABLE[name]}), [name])


def _page_of(node: Node, key: str) -> Page:
    pages = node.datastore.pages.copy()
    found = pages.get(key)
    if found is None:
        raise ConsoleCommandError(f"Nothing has stored a page '{key}' (yet).", fix=suggest(key, [*pages, *DUMPS]))
    return found


# Names for completion and look-up


def components_of(node: Node) -> list[str]:
    """Return the names of a node's components except its own, which cannot be removed."""
    return [name for name in node.components.copy() if name != CORE_NAME]


def pages_of(node: Node) -> list[str]:
    """Return the keys of all pages."""
    return list(node.datastore.pages.copy())


def events_of(node: Node) -> set[str]:
    """Return the names of events that some component handles."""
    return {
        task_id[1]
        for component in node.components.copy().values()
        if component.name != CORE_NAME
        for task_id in tuple(component.task_handlers)
        if isinstance(task_id, tuple) and task_id[0] is TaskType.event
    }


TYPE = Argument("TYPE", is_optional=True, choices=tuple(kind.value for kind in TaskType))
EVENT = Argument("NAME", known=events_of)
VALUE = Argument("JSON", "value")
VALUES = Argument("JSON", "value", is_optional=True, is_many=True)
KEY = Argument("KEY", known=pages_of)
WATCHED = Argument("KEY", is_optional=True)
COMPONENT = Argument("NAME", known=lambda node: [ALL, *components_of(node)])
LISTED = Argument("WHAT", is_optional=True, choices=(*LISTS, *ALSO_LISTED))
DUMPED = Argument("WHAT", is_optional=True, known=lambda node: [*DUMPS, *pages_of(node)])
COMMAND = Argument("COMMAND", is_optional=True, known=lambda node: TABLE)

TABLE: dict[str, CommandSpec] = {
    command.name: command
    for command in (
        CommandSpec("exit", (Argument("REASON", "text", is_optional=True),), "ends the node, in order", _exit),
        CommandSpec(
            "task", (TYPE, EVENT, VALUES), "queues a task, an event if no type is given; values are JSON", _task
        ),
        CommandSpec("store", (KEY, VALUE), "stores a page", _store),
        CommandSpec("reload", (COMPONENT,), "recreates a component from its file", _reload),
        CommandSpec("list", (LISTED,), "lists what the node has: " + ", ".join(LISTS), _list),
        CommandSpec("dump", (DUMPED,), f"how it does: {', '.join(DUMPS)}, or all of a page", _dump),
        CommandSpec("watch", (KEY,), "shows a page whenever it changes", _watch),
        CommandSpec("unwatch", (WATCHED,), "no longer shows a page, or any", _unwatch),
        CommandSpec("help", (COMMAND,), "lists the commands", _help),
    )
}
