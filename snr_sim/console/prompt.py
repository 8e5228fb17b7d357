"""Prompt: input of commands by a user, with history and completion. The only module that imports prompt_toolkit."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from prompt_toolkit import PromptSession
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import History
from prompt_toolkit.patch_stdout import patch_stdout

from snr_sim.console.client import ConsoleClient
from snr_sim.prelude.user_folder import user_folder

MAX_HISTORY_LINES = 1000
WELCOME = "help lists the commands, Tab completes, Ctrl-D leaves. (The command exit ends the node.)"


@contextmanager
def typed_lines(client: ConsoleClient, history: Path | None = None) -> Iterator[Iterator[str]]:
    """Prompt for command lines; other output is printed above the prompt meanwhile.

    Earlier lines are in the file `history`; if not given, in one in the user's data folder.
    """
    session: PromptSession[str] = PromptSession(
        history=BoundedFileHistory(history or user_folder() / "console_history"),
        completer=NodeCompleter(client),
        complete_while_typing=False,
        complete_in_thread=True,
    )
    with patch_stdout():
        print(WELCOME)
        yield _lines(client, session)


def _lines(client: ConsoleClient, session: PromptSession[str]) -> Iterator[str]:
    while True:
        try:
            line = session.prompt(lambda: f"{client.node or '...'}> ")
        except KeyboardInterrupt:
            continue  # discards the unfinished line, as in a shell
        except EOFError:
            return
        if line.strip():
            yield line.strip()


class NodeCompleter(Completer):
    """Completion from the node: its commands, components, pages and events."""

    def __init__(self, client: ConsoleClient) -> None:
        self._client = client

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        """Yield completions for the cursor position."""
        before = document.text_before_cursor
        begun = before.split()[-1] if before and not before[-1].isspace() else ""
        for word in self._client.complete(before):
            yield Completion(word, start_position=-len(begun))


class BoundedFileHistory(History):
    """History in a file, one line each, readable by its owner only, with a bounded number of lines.

    If the file cannot be written, history ends with the console.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def load_history_strings(self) -> Iterable[str]:
        """Return the lines of earlier consoles, newest first; remove the oldest beyond the limit from the file."""
        try:
            lines = self._path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return []
        if len(lines) > MAX_HISTORY_LINES:
            lines = lines[-MAX_HISTORY_LINES:]
            with suppress(OSError):
                self._path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return reversed(lines)

    def store_string(self, string: str) -> None:
        """Add a line to the file."""
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            with os.fdopen(descriptor, "a", encoding="utf-8", errors="replace") as file:
                file.write(" ".join(string.splitlines()) + "\n")
