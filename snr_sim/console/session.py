"""ConsoleSession: one console at a node. A line of text in, an answer out; owns no port, so a test needs none."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

from snr_sim.console import introspection
from snr_sim.console.formatting import truncate
from snr_sim.console.parsing import MAX_LINE_CHARS, CommandResult, ConsoleCommandError, Table, completions, parse
from snr_sim.core.node import Node
from snr_sim.prelude.errors import SnrError, suggest
from snr_sim.prelude.task import Page, Task

# The node keeps every name that it receives (a page, a looked-up handler), so the number from consoles is limited.
MAX_NEW_NAMES = 1000
MAX_WAITING_TASKS = 1000  # with more tasks in the inbox, those of a console are rejected: the node does not keep up
MAX_WATCHES = 16
WATCH_PERIOD_S = 0.1
OUTCOME_WAIT_S = 5.0  # time limit for a command's result, after which the console is sent a message without one

log: logging.Logger = logging.getLogger("snr.console")


@dataclass
class _PageWatch:
    """A watched page: the version shown last, and when it may be shown next."""

    shown: Page | None
    next_s: float = 0.0


@dataclass
class _PendingResult:
    """A command whose result is pending: how to detect the result, and until when."""

    what: str
    poll: Callable[[], CommandResult | None]
    until_s: float | None = None


class ConsoleSession:
    """Executes one console's lines on a running node, from any thread, and shows the pages it watches.

    Its tasks have `source` in the trace. The sessions of a receiver share `new_names` that they introduced in the node.
    """

    def __init__(self, node: Node, table: Table, source: str = "console", new_names: set[str] | None = None) -> None:
        self.node: Node = node
        self.source: str = source
        self.new_names: set[str] = set() if new_names is None else new_names
        self._table = table
        self._watches: dict[str, _PageWatch] = {}
        self._pending: _PendingResult | None = None

    @property
    def is_watching(self) -> bool:
        """Whether `changes` or `outcome` may return something."""
        return bool(self._watches) or self.is_waiting

    @property
    def is_waiting(self) -> bool:
        """Whether the last command has only a first answer: `outcome` returns the rest."""
        return self._pending is not None

    def execute(self, line: str) -> CommandResult:
        """Execute a line. Never raises: a console must not end the node it inspects."""
        try:
            command, given = parse(self._table, line)
            answer = command.run(self, given)
            return CommandResult(truncate(answer.text), answer.data)
        except SnrError as error:
            return CommandResult(truncate(str(error)), is_error=True)
        except Exception as error:
            log.exception("a console's command failed")
            return CommandResult(
                f"The command failed, which is a mistake in snr_sim: {type(error).__name__}.", is_error=True
            )

    def complete(self, line: str) -> list[str]:
        """Return the words that can follow at the end of the line."""
        try:
            return completions(self._table, line[-MAX_LINE_CHARS:], self.node)
        except Exception:
            log.exception("a console's completion failed")
            return []

    def admit_name(self, name: str, is_known: bool) -> None:
        """Count a name that is new to the node; raise ConsoleCommandError if consoles have introduced too many."""
        if is_known or name in self.new_names:
            return
        if len(self.new_names) >= MAX_NEW_NAMES:
            raise ConsoleCommandError(f"Consoles have added {MAX_NEW_NAMES} new names, the maximum.")
        self.new_names.add(name)

    def enqueue(self, task: Task) -> None:
        """Put a task into the node's inbox; raise ConsoleCommandError if it has ended, or too many tasks wait."""
        if self.node.is_finished:
            raise ConsoleCommandError(f"Node '{self.node.name}' has ended.")
        waiting = len(self.node.inbox.waiting)
        if waiting >= MAX_WAITING_TASKS:
            raise ConsoleCommandError(
                f"{waiting} tasks wait in the node's inbox: it does not keep up.", fix="send the command again later."
            )
        self.node.enqueue_input(task, self.source)

    def expect(self, task: Task, what: str, poll: Callable[[], CommandResult | None]) -> None:
        """Put a task into the inbox; `poll` returns the result of what was requested, or None if there is none yet."""
        self.enqueue(task)
        self._pending = _PendingResult(what, poll)

    def outcome(self, now_s: float) -> CommandResult | None:
        """Return the result of the last command, once known, or a message that there is none within the time limit."""
        pending = self._pending
        if pending is None:
            return None
        if pending.until_s is None:
            pending.until_s = now_s + OUTCOME_WAIT_S
        answer = pending.poll()
        if answer is None and now_s >= pending.until_s:
            text = f"{pending.what} is queued, but has no result after {OUTCOME_WAIT_S:g} s."
            answer = CommandResult(text, is_error=True)
        if answer is not None:
            self._pending = None
        return answer

    def changes(self, now_s: float) -> list[CommandResult]:
        """Return an answer for each watched page that has changed since it was last shown, at most every 0.1 s."""
        answers = []
        for key, watch in self._watches.items():
            page = self.node.datastore.pages.get(key)
            if page is not None and page is not watch.shown and now_s >= watch.next_s:
                watch.shown, watch.next_s = page, now_s + WATCH_PERIOD_S
                answers.append(self._page_result(page))
        return answers

    def _page_result(self, page: Page) -> CommandResult:
        text, data = introspection.page(self.node, page)
        return CommandResult(truncate(text), data, about=page.key)

    def watch(self, key: str) -> CommandResult:
        """Start to show a page, beginning with its current data; raise ConsoleCommandError if too many are watched."""
        if key not in self._watches and len(self._watches) >= MAX_WATCHES:
            raise ConsoleCommandError(f"This console watches {MAX_WATCHES} pages, the maximum.", fix="unwatch KEY.")
        pages = self.node.datastore.pages.copy()
        page = pages.get(key)
        self._watches[key] = _PageWatch(page)
        if page is None:
            return CommandResult(f"Nothing has stored a page '{key}' (yet): {suggest(key, pages)}", {"watch": key})
        return self._page_result(page)

    def unwatch(self, key: str | None) -> CommandResult:
        """Stop showing one page, or all; raise ConsoleCommandError if that page is not watched."""
        if key is None:
            self._watches.clear()
        elif self._watches.pop(key, None) is None:
            raise ConsoleCommandError(f"Page '{key}' is not watched.", fix=suggest(key, self._watches))
        return CommandResult(f"watched: {', '.join(self._watches) or 'nothing'}", {"watched": list(self._watches)})
