"""The prompt: history, completion from the node, and leaving. prompt_toolkit's own pipe replaces the keyboard."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.document import Document
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.output import DummyOutput

from snr_sim import RemoteConsole
from snr_sim.console import prompt
from snr_sim.console.parsing import CommandResult
from snr_sim.console.prompt import BoundedFileHistory, NodeCompleter, typed_lines
from snr_sim.prelude.errors import LinkError

CTRL_C, CTRL_D, UP = "\x03", "\x04", "\x1b[A"


class Client:
    """Replaces a connection to a node."""

    node, host, port, reason, was_refused = "urov_node", "127.0.0.1", 1, "", False

    def complete(self, line: str) -> list[str]:
        return [word for word in ("start", "stop") if word.startswith(line.split()[-1])] if line[-1:] != " " else []

    def ask(self, line: str) -> CommandResult:
        if line == "gone":
            raise LinkError("There is no line.")
        return CommandResult(f"answer to {line}")

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *about: object) -> None: ...


@pytest.fixture
def keys() -> Iterator[PipeInput]:
    with create_pipe_input() as keys, create_app_session(input=keys, output=DummyOutput()):
        yield keys


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))


def typed(keys: PipeInput, text: str, history: Path | None = None) -> list[str]:
    keys.send_text(text)
    client: Any = Client()
    with typed_lines(client, history) as lines:
        return list(lines)


def test_ctrl_d_ends_the_prompt_and_ctrl_c_drops_one_line(keys: PipeInput, tmp_path: Path) -> None:
    assert typed(keys, f" list \r\rbegun{CTRL_C}dump x\r{CTRL_D}") == ["list", "dump x"]
    assert (tmp_path / "snr_sim" / "console_history").exists()


def test_history_returns_lines_of_earlier_consoles(keys: PipeInput, tmp_path: Path) -> None:
    file = tmp_path / "deep" / "history"
    assert typed(keys, f"store x 1\r{CTRL_D}", file) == ["store x 1"]
    assert file.read_text() == "store x 1\n"
    assert file.stat().st_mode & 0o077 == 0
    assert typed(keys, f"{UP}\r{CTRL_D}", file) == ["store x 1"]


@pytest.mark.slow
def test_tab_returns_completions_of_the_node(keys: PipeInput) -> None:
    assert typed(keys, f"task sta\t\r{CTRL_D}") in (["task start"], ["task sta"])  # the second if the tab is late
    client: Any = Client()
    event: Any = None
    found = list(NodeCompleter(client).get_completions(Document("task st"), event))
    assert [(one.text, one.start_position) for one in found] == [("start", -2), ("stop", -2)]


def test_history_is_bounded_and_ignores_an_unwritable_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prompt, "MAX_HISTORY_LINES", 3)
    history = BoundedFileHistory(tmp_path / "history")
    for i in range(5):
        history.store_string(f"line {i}\nsecond")
    assert list(history.load_history_strings()) == ["line 4 second", "line 3 second", "line 2 second"]
    assert (tmp_path / "history").read_text().count("\n") == 3
    (tmp_path / "file").write_text("")
    nowhere = BoundedFileHistory(tmp_path / "file" / "history")
    nowhere.store_string("x")
    assert list(nowhere.load_history_strings()) == []


def test_prompt_prints_answers_and_lost_connection(keys: PipeInput, monkeypatch: pytest.MonkeyPatch) -> None:
    remote, seen = RemoteConsole(("127.0.0.1", 1)), []
    client: Any = Client()
    remote.client = client
    monkeypatch.setattr(remote, "show", lambda answer: seen.append(answer.text))
    monkeypatch.setattr(remote, "print_line", seen.append)
    keys.send_text(f"list\rgone\rlist\r{CTRL_D}")
    assert remote.run() == []
    assert seen == ["answer to list", "There is no line.", "answer to list"]
