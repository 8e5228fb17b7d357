"""`snr run --live` and `snr machine view`: a page over a run, which changes nothing of it; edits are replayed."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli.machine_view import view
from snr_sim.prelude.errors import TraceError
from snr_sim.web.access import Access
from tests.on_thread import TIMEOUT_S, wait_for
from tests.web.served import browser, get

pytestmark = pytest.mark.slow
SNR = [sys.executable, "-m", "snr_sim"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def snr(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*SNR, *words], capture_output=True, text=True, check=False, timeout=10 * TIMEOUT_S)


@contextlib.contextmanager
def started(*words: str) -> Iterator[tuple[Access, subprocess.Popen[str]]]:
    """Start a command that serves a page; yield where it is; then end it as Ctrl-C does."""
    with open("shown", "w+") as shown:
        process = subprocess.Popen([*SNR, *words], stdout=shown, stderr=shown, text=True)
        try:
            text = wait_for(lambda: address_in(Path("shown").read_text()) or process.poll() is not None)
            assert text is not True, Path("shown").read_text()
            port, token = text
            yield Access("127.0.0.1", int(port), token), process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            process.wait(TIMEOUT_S)


def address_in(text: str) -> tuple[str, str] | None:
    found = re.search(r"Open http://127\.0\.0\.1:(\d+)/\?token=(\S+)\n", text)
    return None if found is None else (found[1], found[2])


def test_run_with_a_page_leaves_the_same_trace() -> None:
    without, with_page = (snr("run", "dora_wall", "--json", *words) for words in ((), ("--live",)))
    assert json.loads(without.stdout)["trace_digest"] == json.loads(with_page.stdout)["trace_digest"]
    assert "A fast run may be over before its page is open." in with_page.stderr
    assert address_in(with_page.stderr)


def test_run_without_a_machine_writes_nothing(here: Path) -> None:
    done = snr("run", "lander_pad", "--live")
    assert done.returncode == 2
    assert "--live shows state machines, and this run has none." in done.stderr
    assert not list(here.glob("runs/*"))


def test_help_names_the_options() -> None:
    assert "--live-host" in snr("run", "--help").stdout


def test_edit_in_flight_is_recorded_replayed_shown_and_explained(here: Path) -> None:
    with started("run", "dora_room", "--speed", "real", "--live") as (access, process):
        assert get(access, f"/?token={access.token}")[0] == 303
        with browser(access, name="dora") as page:
            hello = page.receive()
            page.wait("state", lambda one: one["active"] == {"dora": "forward"} and one["t_s"] > 0.3)
            text = hello["text"].replace("(var speed := [50])", "(var speed := [80])")
            assert text != hello["text"]
            page.send("edit", number=1, text=text, base_sha256=hello["sha256"])
            assert page.wait("edited")["ok"]
            edited_s = page.wait("program")["t_s"]
            page.wait("state", lambda one: one["t_s"] > edited_s + 0.3)
            page.send("show", t_s=0.1)
            past = page.wait("state", lambda one: not one["is_live"])
            assert (past["number"], past["variables"]["speed"]) == (1, 50)
            page.send("why", machine="dora", transition="forward->turning", from_s=0.0, until_s=edited_s)
            rows = page.wait("why")["rows"]
            assert [(one["transition"], one["line"]) for one in rows] == [("forward->turning", 27)]
            assert rows[0]["evaluated"] > 0
            page.wait("state")
            process.send_signal(signal.SIGINT)
            assert page.wait("gone")["reason"].startswith("The run has ended")
        process.wait(TIMEOUT_S)
    (folder,) = here.glob("runs/*")
    replayed = snr("replay", str(folder), "--check")
    assert replayed.stdout.startswith("identical"), replayed.stdout + replayed.stderr
    with started("machine", "view", str(folder)) as (access, _), browser(access, name="dora") as page:
        hello = page.receive()
        assert (hello["is_live"], hello["text"], hello["number"]) == (False, text, 2)
        page.send("show", t_s=0.1)
        past = page.wait("state", lambda one: not one["is_live"])
        assert (past["number"], past["active"], past["variables"]["speed"]) == (1, {"dora": "forward"}, 50)
        assert page.received[-2]["text"] == text.replace("[80]", "[50]")
        assert past["reads"]["ultra"]["value"] > 0.0
        assert past["drives"]["motor_a"]["value"] == 50.0
        page.send("do", what="pause")
        assert "cannot be changed" in page.wait("refused")["reason"]


# Sends itself a signal where Python may run its handler: before a callback of asyncio that continues a task.
SIGNAL_BEFORE_A_STEP = """\
import asyncio, signal, sys
from snr_sim.cli.entry import main

_, coroutine, *sys.argv[1:] = sys.argv
run = asyncio.Handle._run

def run_after_a_signal(handle):
    task = getattr(handle._callback, "__self__", None)
    if isinstance(task, asyncio.Task) and task.get_coro().__name__ == coroutine:
        asyncio.Handle._run = run
        signal.raise_signal(signal.SIGINT)
    run(handle)

asyncio.Handle._run = run_after_a_signal
main()
"""


@pytest.mark.parametrize("coroutine", ["serve", "_tick"])
def test_view_ends_at_a_signal_between_callbacks_of_asyncio(here: Path, coroutine: str) -> None:
    snr("run", "dora_wall")
    (folder,) = here.glob("runs/*")
    words = [sys.executable, "-c", SIGNAL_BEFORE_A_STEP, coroutine, "machine", "view", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    assert (done.returncode, done.stderr) == (0, "")


def test_run_that_is_being_recorded_can_be_viewed(here: Path) -> None:
    process = subprocess.Popen([*SNR, "run", "dora_room", "--speed", "real"], stderr=subprocess.DEVNULL)
    try:
        wait_for(lambda: any(one.stat().st_size > 20_000 for one in here.glob("runs/*/trace.jsonl")))
        (folder,) = here.glob("runs/*")
        with started("machine", "view", str(folder)) as (access, _), browser(access, name="dora") as page:
            until_s = page.receive()["until_s"]
            page.wait("state", lambda one: one["t_s"] > until_s + 0.5)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(TIMEOUT_S)


def test_missing_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TraceError):
        view(tmp_path / "nowhere", "", 0, is_trusted=False)


def test_page_is_explained_by_a_message_if_it_cannot_be(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of another user: its files are executed only with --trust."""
    (here / "mine.lrp").write_text(Path(explorer()).read_text())
    done = snr("run", "dora_wall", "--controller", "./mine.lrp", "--json")
    folder = json.loads(done.stdout)["run_dir"]
    for table in Path(folder).glob("sources/*.jsonl"):
        table.write_text(re.sub(r'"mark": "[0-9a-f]+"', '"mark": "' + "0" * 64 + '"', table.read_text()))
    with started("machine", "view", folder) as (access, _):
        name = re.search(r"machine/(\w+)/", get(access, "/", Cookie=f"{access.cookie}={access.token}")[1]["location"])
        assert name is not None
        with browser(access, name=name[1]) as page:
            answer = why(page)
            assert answer["rows"] == []
            assert "was not recorded by you" in answer["error"]


def why(page: Any) -> Any:
    page.send("why", machine="", transition="", from_s=0.0, until_s=1.0)
    return page.wait("why")


def explorer() -> str:
    from snr_sim.scenario.library import find

    return str(find("robots", "dora").path / "controllers" / "explorer.lrp")
