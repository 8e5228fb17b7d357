"""Session: one console at a node. A line of text in, an answer out; owns no port, so a test needs none."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

from snr_sim.console import introspection
from snr_sim.console.readable import cut_text
from snr_sim.console.table import Answer, Table, completions, parse
from snr_sim.console.words import LINE_MAX_CHARS, CommandRefused
from snr_sim.core.node import Node
from snr_sim.prelude.errors import SnrError, nearest
from snr_sim.prelude.page import Page
from snr_sim.prelude.task import Task

# The node keeps every name that it receives (a page, a looked-up handler), so the number from consoles is limited.
NEW_NAMES_MAX = 1000
WAITING_MAX = 1000  # with more tasks in the inbox, those of a console are rejected: the node does not keep up
WATCHES_MAX = 16
WATCH_PERIOD_S = 0.1
OUTCOME_WAIT_S = 5.0  # time limit for a command's result, after which the console is sent a message without one

log = logging.getLogger("snr.console")


@dataclass
class _Watch:
    """A watched page: the version shown last, and when it may be shown next."""

    shown: Page | None
    next_s: float = 0.0


@dataclass
class _Awaited:
    """A command whose result is pending: how to detect the result, and until when."""

    what: str
    look: Callable[[], Answer | None]
    until_s: float | None = None


class Session:
    """Executes one console's lines on a node, from any thread, and shows the pages it watches.

    Args:
        node: the running node.
        table: the available commands.
        source: source of its tasks in the trace: the name of the console.
        new_names: names that consoles have introduced in the node; shared by the sessions of one receiver.
    """

    def __init__(self, node: Node, table: Table, source: str = "console", new_names: set[str] | None = None) -> None:
        self.node = node
        self.source = source
        self.new_names = set() if new_names is None else new_names
        self._table = table
        self._watches: dict[str, _Watch] = {}
        self._awaited: _Awaited | None = None

    @property
    def is_watching(self) -> bool:
        """Whether `changes` or `outcome` may return something."""
        return bool(self._watches) or self.is_waiting

    @property
    def is_waiting(self) -> bool:
        """Whether the last command has only a first answer: `outcome` returns the rest."""
        return self._awaited is not None

    def answer(self, line: str) -> Answer:
        """Execute a line. Never raises: a console must not end the node it inspects."""
        try:
            command, given = parse(self._table, line)
            answer = command.run(self, given)
            return Answer(cut_text(answer.text), answer.data)
        except SnrError as error:
            return Answer(cut_text(str(error)), is_error=True)
        except Exception as error:
            log.exception("a console's command failed")
            return Answer(f"The command failed, which is a mistake in snr_sim: {type(error).__name__}.", is_error=True)

    def complete(self, line: str) -> list[str]:
        """Return the words that can follow at the end of the line."""
        try:
            return completions(self._table, line[-LINE_MAX_CHARS:], self.node)
        except Exception:
            log.exception("a console's completion failed")
            return []

    def admit_name(self, name: str, is_known: bool) -> None:
        """Count a name that is new to the node.

        Raises:
            CommandRefused: consoles have introduced too many.
        """
        if is_known or name in self.new_names:
            return
        if len(self.new_names) >= NEW_NAMES_MAX:
            raise CommandRefused(f"Consoles have brought {NEW_NAMES_MAX} new names, which is enough.")
        self.new_names.add(name)

    def bring(self, task: Task) -> None:
        """Put a task into the node's inbox.

        Raises:
            CommandRefused: the node has ended, or too many tasks wait.
        """
        if self.node.is_over:
            raise CommandRefused(f"Node '{self.node.name}' has ended.")
        waiting = len(self.node.door.waiting)
        if waiting >= WAITING_MAX:
            raise CommandRefused(f"{waiting} tasks wait at the node's door: it does not keep up.", fix="again, later.")
        self.node.enter(task, self.source)

    def expect(self, task: Task, what: str, look: Callable[[], Answer | None]) -> None:
        """Put a task into the inbox whose result can be detected.

        Args:
            task: the task.
            what: description of the request.
            look: returns the result, or None as long as there is none.
        """
        self.bring(task)
        self._awaited = _Awaited(what, look)

    def outcome(self, now_s: float) -> Answer | None:
        """Return the result of the last command, once known, or a message that there is none within the time limit.

        Args:
            now_s: as of `changes`.
        """
        awaited = self._awaited
        if awaited is None:
            return None
        if awaited.until_s is None:
            awaited.until_s = now_s + OUTCOME_WAIT_S
        answer = awaited.look()
        if answer is None and now_s >= awaited.until_s:
            text = f"{awaited.what} is queued, and nothing has come of it in {OUTCOME_WAIT_S:g} s."
            answer = Answer(text, is_error=True)
        if answer is not None:
            self._awaited = None
        return answer

    def changes(self, now_s: float) -> list[Answer]:
        """Return an answer for each watched page that has changed since it was last shown.

        Args:
            now_s: of any clock that advances while the node runs; each page is shown at most every 0.1 s of it.
        """
        answers = []
        for key, watch in self._watches.items():
            page = self.node.datastore.pages.get(key)
            if page is not None and page is not watch.shown and now_s >= watch.next_s:
                watch.shown, watch.next_s = page, now_s + WATCH_PERIOD_S
                answers.append(self._shown(page))
        return answers

    def _shown(self, page: Page) -> Answer:
        text, data = introspection.page(self.node, page)
        return Answer(cut_text(text), data, about=page.key)

    def watch(self, key: str) -> Answer:
        """Start to show a page, beginning with its current data.

        Raises:
            CommandRefused: too many are watched.
        """
        if key not in self._watches and len(self._watches) >= WATCHES_MAX:
            raise CommandRefused(f"This console watches {WATCHES_MAX} pages, which is the most.", fix="unwatch KEY.")
        pages = self.node.datastore.pages.copy()
        page = pages.get(key)
        self._watches[key] = _Watch(page)
        if page is None:
            return Answer(f"Nothing has stored a page '{key}' (yet): {nearest(key, pages)}", {"watch": key})
        return self._shown(page)

    def unwatch(self, key: str | None) -> Answer:
        """Stop showing one page, or all.

        Raises:
            CommandRefused: that page is not watched.
        """
        if key is None:
            self._watches.clear()
        elif self._watches.pop(key, None) is None:
            raise CommandRefused(f"Page '{key}' is not watched.", fix=nearest(key, self._watches))
        return Answer(f"watched: {', '.join(self._watches) or 'nothing'}", {"watched": list(self._watches)})
