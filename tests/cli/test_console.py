"""`snr console`: exit statuses, what it prints, where the token comes from; and `snr run --console`."""

import io
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim import CommandReceiverFactory, Config, Node, TaskType, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

Snr = Callable[..., Any]
TOKEN = "a token of at least sixteen bytes"
TIMEOUT_S = 60.0


@pytest.fixture
def token() -> str | None:
    return None


@pytest.fixture
def port(token: str | None) -> Iterator[int]:
    """The console's port of a node that runs meanwhile."""
    console = CommandReceiverFactory(0, token=token)
    part = FunctionEndpointFactory({(TaskType.event, "start"): lambda task, task_id: None})
    beat = FunctionLoopFactory(lambda loop: loop.store_data("beat", loop.get_time_s()), rate_hz=20.0)
    node = Node("urov", Config(factories={"urov": [console, part, beat]}))
    thread = threading.Thread(target=node.loop)
    thread.start()
    until_s = time.monotonic() + TIMEOUT_S
    while not console.port and time.monotonic() < until_s:
        time.sleep(0.005)
    yield console.port
    node.enqueue_input(tasks.terminate("test"), "test")
    thread.join(TIMEOUT_S)
    assert not thread.is_alive()


@pytest.mark.slow
def test_command_is_executed_and_reply_printed(snr: Snr, port: int) -> None:
    stored = snr("console", f"127.0.0.1:{port}", "store", "depth_m", "-1.5")
    assert (stored.status, stored.out, stored.err) == (0, "depth_m = -1.5 is stored.\n", "")
    assert "depth_m = -1.5" in snr("console", port, "dump", "depth_m").out
    assert "part" in snr("console", port, "list").out


@pytest.mark.slow
def test_refused_command_returns_status_1_and_prints_to_stderr(snr: Snr, port: int) -> None:
    answer = snr("console", port, "stroe", "x", "1")
    assert (answer.status, answer.out) == (1, "")
    assert "did you mean 'store'" in answer.err


@pytest.mark.slow
def test_json_contains_all_replies(snr: Snr, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    (one,) = snr("console", port, "--json", "store", "y", "[1, null]").json["answers"]
    assert one == {"text": "y = [1, null] is stored.", "data": {"store": "y"}, "is_error": False}
    monkeypatch.setattr("sys.stdin", io.StringIO("dump y\n\nstroe\nwatch beat\n"))
    answer = snr("console", port, "--json")
    assert answer.status == 1
    assert [one["is_error"] for one in answer.json["answers"]] == [False, True, False]
    assert answer.json["answers"][0]["data"]["data"] == [1, None]


@pytest.mark.slow
def test_commands_are_read_from_pipe(snr: Snr, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("store z 1\ndump z\n"))
    answer = snr("console", port)
    assert (answer.status, answer.out.count("\n")) == (0, 2)


@pytest.mark.slow
def test_watch_continues_until_node_ends(snr: Snr, port: int, capfd: pytest.CaptureFixture[str]) -> None:
    printed: list[str] = []

    def end() -> None:
        from snr_sim import RemoteConsole

        until_s = time.monotonic() + TIMEOUT_S
        while "".join(printed).count("beat = ") < 2 and time.monotonic() < until_s:
            time.sleep(0.02)
            printed.append(capfd.readouterr().out)
        RemoteConsole(("127.0.0.1", port), ["exit seen"]).run()

    thread = threading.Thread(target=end)
    thread.start()
    answer = snr("console", port, "watch", "beat")
    thread.join()
    assert answer.status == 0
    assert "".join([*printed, answer.out]).count("beat = ") >= 2


@pytest.mark.slow
def test_unreachable_node_returns_status_2_with_fix(snr: Snr) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        free = other.getsockname()[1]
    answer = snr("console", free, "--wait", "0.1", "list")
    assert answer.status == 2
    assert "CommandReceiverFactory" in answer.err


@pytest.mark.parametrize("address", ["nowhere", "127.0.0.1:", "host:port", "127.0.0.1:70000", "0"])
def test_invalid_address_returns_status_2(snr: Snr, address: str) -> None:
    answer = snr("console", address, "list")
    assert answer.status == 2
    assert "HOST:PORT" in answer.err


@pytest.mark.slow
@pytest.mark.parametrize("token", [TOKEN])
def test_token_is_read_from_file_or_variable(snr: Snr, port: int, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refused = snr("console", port, "list")
    assert refused.status == 2
    assert "SNR_TOKEN" in refused.err
    (here / "token.txt").write_text(f"{TOKEN}\n")
    assert snr("console", port, "--token-file", "token.txt", "list").status == 0
    monkeypatch.setenv("SNR_TOKEN", TOKEN)
    assert snr("console", port, "list").status == 0
    monkeypatch.setenv("SNR_TOKEN", "another token of sixteen bytes")
    assert snr("console", port, "list").status == 2
    assert snr("console", port, "--token-file", "none.txt", "list").status == 2


@pytest.mark.slow
def test_run_with_console_replays_without_console(snr: Snr, here: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        free = other.getsockname()[1]
    replies: list[Any] = []

    def steer() -> None:
        from snr_sim import RemoteConsole

        lines = ["store remark 1", "list loops", "exit enough"]
        replies.extend(RemoteConsole(("127.0.0.1", free), lines, wait_s=TIMEOUT_S).run())

    thread = threading.Thread(target=steer)
    thread.start()
    ran = snr("run", "lander_vertical", "--speed", "real", "--console", free, "--no-rrd", "--json")
    thread.join(TIMEOUT_S)
    assert [answer.is_error for answer in replies] == [False, False, False]
    assert ran.json["outcome"] == "ended"
    inputs = snr("trace", ran.json["run_dir"], "--kind", "input").out
    assert "console -> store_page remark" in inputs
    assert "console -> terminate enough" in inputs
    assert snr("replay", ran.json["run_dir"], "--check").status == 0
