"""The console over TCP: several clients, unauthenticated ones, silence, invalid data, tokens, the end; on loopback."""

import asyncio
import logging
import os
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from snr_sim import (
    CommandReceiverFactory,
    Config,
    ConsoleClient,
    Node,
    RemoteConsole,
    SimClock,
    SimRunner,
    TimeoutLoopFactory,
)
from snr_sim.console import command_receiver, wire
from snr_sim.core.lockstep import LockStep
from snr_sim.links.frames import encode_frame
from snr_sim.prelude.errors import ConfigError, LinkError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory
from tests.on_thread import TIMEOUT_S, wait_for

from .conftest import running

TOKEN = "a token of at least sixteen bytes"
HELLO = (
    b'{"$":"hello","protocol":"snr","version":2,"node":"x","nonce":"00000000000000000000000000000000",'
    b'"purpose":"console","auth":false,"max_frame_bytes":1048576}'
)


def open_socket(address: tuple[str, int]) -> socket.socket:
    sock = socket.create_connection(address)
    sock.settimeout(TIMEOUT_S)
    return sock


def all_of(sock: socket.socket) -> bytes:
    """Return all data until the other end closes the connection."""
    received = b""
    while data := sock.recv(1 << 16):
        received += data
    return received


@pytest.mark.slow
def test_remote_console_returns_answers_to_commands() -> None:
    with running() as (node, address):
        answers = RemoteConsole(address, ["store depth_m 2.5", "dump depth_m", "stroe", "list components"]).run()
        assert [answer.is_error for answer in answers] == [False, False, True, False]
        assert answers[1].data["data"] == 2.5
        assert "did you mean 'store'" in answers[2].text
        assert node.get_data("depth_m") == 2.5


@pytest.mark.slow
def test_exit_returns_answer_before_the_node_ends() -> None:
    with running() as (node, address):
        (answer,) = RemoteConsole(address, ["exit asked"]).run()
        assert "asked to end" in answer.text
        wait_for(lambda: node.is_finished)
        assert node.exit_reason == "asked"


@pytest.mark.slow
def test_reload_returns_its_outcome() -> None:
    with running() as (_, address):
        (answer,) = RemoteConsole(address, ["reload part"]).run()
        assert answer.data["component"] == "part"
        assert answer.is_error is not answer.data["ok"]


@pytest.mark.slow
def test_reload_of_all_returns_answer_over_the_same_connection() -> None:
    with running() as (_, address), ConsoleClient(address) as client:
        client.wait_until_up(TIMEOUT_S)
        answer = client.ask("reload all")
        assert answer.data["component"] == "all"
        assert answer.data["created"] == ["part"]
        assert client.ask("list components").is_error is False


@pytest.mark.slow
def test_console_reloads_itself_and_clients_reconnect() -> None:
    with running() as (node, address), ConsoleClient(address, retry_wait_s=0.01) as client:
        client.wait_until_up(TIMEOUT_S)
        cut_off = client.ask("reload console")
        assert "reloads or removes its console" in cut_off.text
        client.wait_until_lost()
        client.wait_until_up(TIMEOUT_S)
        wait_for(lambda: node.get_data("reload"))
        assert client.ask("dump reload").data["data"]["created"] == ["console"]


@pytest.mark.slow
def test_closed_console_keeps_other_consoles_connected() -> None:
    with running() as (node, address), ConsoleClient(address) as one, ConsoleClient(address) as other:
        for client in (one, other):
            client.wait_until_up(TIMEOUT_S)
        one.ask("store who 1")
        one.__exit__()
        wait_for(lambda: node.get_data("who") == 1)
        assert other.ask("dump who").data["data"] == 1
        assert other.node == "urov_node"


@pytest.mark.slow
def test_watched_page_is_sent_without_a_request() -> None:
    came: list[Any] = []
    enough = threading.Event()

    def take(answer: Any) -> None:
        came.append(answer.data["data"])
        if len(came) == 3:
            enough.set()

    counter = FunctionLoopFactory(lambda loop: loop.store_data("count", loop.get_time_s()), rate_hz=50.0)
    with running(counter) as (_, address), ConsoleClient(address, on_change=take) as client:
        client.wait_until_up(TIMEOUT_S)
        client.ask("watch count")
        assert enough.wait(TIMEOUT_S)
        client.ask("unwatch")
    assert came == sorted(came)


@pytest.mark.slow
def test_valid_token_connects_and_is_never_sent() -> None:
    with running(token=TOKEN) as (_, address):
        (answer,) = RemoteConsole(address, ["list"], token=TOKEN).run()
        assert not answer.is_error
    with socket.create_server(("127.0.0.1", 0)) as listener, ConsoleClient(listener.getsockname(), TOKEN):
        sock, _ = listener.accept()
        with sock:
            received = sock.recv(1 << 16)
    assert b"hello" in received
    assert TOKEN.encode() not in received


@pytest.mark.slow
@pytest.mark.parametrize(
    ("token", "message"),
    [(None, "asks for a token"), ("another token of sixteen bytes", "the tokens of the two ends differ")],
)
def test_wrong_or_missing_token_raises_link_error_with_fix(token: str | None, message: str) -> None:
    with running(token=TOKEN) as (node, address):
        with pytest.raises(LinkError, match=f"^The console at .*: .*{message}.*Try: .*--token-file FILE.*SNR_TOKEN"):
            RemoteConsole(address, ["exit gotcha"], token=token, wait_s=TIMEOUT_S).run()
        assert not node.is_terminated


@pytest.mark.slow
def test_unrequested_token_raises_link_error_with_reason() -> None:
    with running() as (_, address), pytest.raises(LinkError, match="asks for a token"):
        RemoteConsole(address, ["list"], token=TOKEN, wait_s=TIMEOUT_S).run()


@pytest.mark.slow
def test_command_before_greeting_is_not_executed() -> None:
    command = b'{"$":"command","number":1,"line":"exit now"}'
    with running(token=TOKEN) as (node, address):
        for first in ([], [HELLO.replace(b"false", b"true")]):
            with open_socket(address) as sock:
                for message in (*first, command):
                    sock.sendall(encode_frame(message))
                assert b"refused" in all_of(sock)
        assert not node.is_terminated


@pytest.mark.slow
@pytest.mark.parametrize(
    "message",
    [
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\xff\xff\xff\xff and four gigabytes",
        b"\x00\x00\x00\x02[]",
        b"\x00\x00\x00\x04null",
        encode_frame(b"[" * 4000),
        encode_frame(b'{"$":"page","key":"depth_m","data":1,"origin":"x","created_at_s":0}'),
        b"\x80\x04\x95\x0f\x00\x00\x00\x00\x00\x00\x00\x8c\x02os\x94.",  # pickled
        encode_frame(b'["task"]'),
    ],
)
def test_invalid_protocol_is_refused_and_the_connection_closed(message: bytes) -> None:
    with running() as (node, address):
        with open_socket(address) as sock:
            sock.sendall(message)
            assert b"refused" in all_of(sock)
        assert not RemoteConsole(address, ["list"]).run()[0].is_error
        assert node.get_data("depth_m") is None


@pytest.mark.slow
def test_weakness_10_unauthenticated_clients_do_not_end_the_node(caplog: pytest.LogCaptureFixture) -> None:
    with running(token=TOKEN) as (node, address):
        for _ in range(2):  # two clients that connect and close
            open_socket(address).close()
        for page in (b'["task"]', b'{"$":"page","key":"console","data":["task"],"origin":"x","created_at_s":0}'):
            with open_socket(address) as sock:
                sock.sendall(encode_frame(page))
                all_of(sock)
        answers = RemoteConsole(address, ["task", "task start"], token=TOKEN).run()
        assert [answer.is_error for answer in answers] == [True, False]
        assert not node.is_finished
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


@pytest.mark.slow
def test_failed_console_loop_listens_again_at_its_port(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    failures, start_for_real = [ZeroDivisionError("division by zero")], asyncio.start_server

    async def start_server(*arguments: Any, **options: Any) -> Any:
        if failures:
            raise failures.pop()
        return await start_for_real(*arguments, **options)

    with running() as (node, address):
        console: Any = node.components["console"]
        with ConsoleClient(address) as one:
            one.wait_until_up(TIMEOUT_S)
            monkeypatch.setattr(asyncio, "start_server", start_server)
            console._events.call_soon_threadsafe(console._ending.set)  # this round ends, and the next one fails
            wait_for(lambda: console.failures == 1 and not console.is_shut)
        assert not RemoteConsole(address, ["list"], wait_s=TIMEOUT_S).run()[0].is_error
        assert not node.is_finished
    assert "'console' failed and starts again: ZeroDivisionError: division by zero" in caplog.messages


@pytest.mark.parametrize("host", ["0.0.0.0", "", "::", "192.168.2.2", "robot.local"])
def test_weakness_11_remote_host_without_token_raises_config_error(host: str) -> None:
    with pytest.raises(ConfigError, match="needs a token"):
        CommandReceiverFactory(0, host=host)
    CommandReceiverFactory(0, host=host, token=TOKEN)
    with pytest.raises(ConfigError, match="at least 16"):
        CommandReceiverFactory(0, host=host, token="short")


@pytest.mark.slow
def test_weakness_11_console_listens_at_its_host_only() -> None:
    with running() as (node, _):
        listener = node.components["console"]._sock  # type: ignore[attr-defined]
        assert listener.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize("port", [-1, 65536, "54321", 1.5, None])
def test_invalid_port_raises_config_error_at_construction(port: Any) -> None:
    with pytest.raises(ConfigError, match="is not a valid port"):
        CommandReceiverFactory(port)


@pytest.mark.slow
def test_port_in_use_raises_link_error_and_halts_components() -> None:
    halted: list[str] = []
    part = FunctionEndpointFactory(halt=lambda part: halted.append(part.name))
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        node = Node("r", Config(factories={"r": [part, CommandReceiverFactory(port)]}))
        with pytest.raises(Exception, match=f"A console cannot listen on 127.0.0.1 port {port}"):
            node.loop()
    assert halted == ["part"]


@pytest.mark.slow
def test_silent_unauthenticated_clients_do_not_block_a_console(monkeypatch: pytest.MonkeyPatch) -> None:
    with running() as (node, address):
        silent = [open_socket(address) for _ in range(command_receiver.MAX_UNAUTHENTICATED + 10)]
        assert not RemoteConsole(address, ["list"]).run()[0].is_error
        assert len(node.components["console"]._connections) <= command_receiver.MAX_UNAUTHENTICATED + 1  # type: ignore[attr-defined]
        for sock in silent:
            sock.close()


@pytest.mark.slow
def test_console_beyond_the_maximum_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command_receiver, "MAX_CONSOLES", 1)
    with running() as (_, address), ConsoleClient(address) as one:
        one.wait_until_up(TIMEOUT_S)
        with pytest.raises(LinkError, match="consoles are connected"):
            RemoteConsole(address, ["list"], wait_s=TIMEOUT_S).run()
        assert not one.ask("list").is_error


def descriptor_count() -> int:
    return len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0


@pytest.mark.slow
def test_closed_console_leaves_no_descriptor() -> None:
    with running() as (node, address):
        RemoteConsole(address, ["list"]).run()
        wait_for(lambda: not node.components["console"]._connections)  # type: ignore[attr-defined]
        before = descriptor_count()
        for _ in range(10):
            RemoteConsole(address, ["list"]).run()
        # A connection is forgotten before its socket is closed.
        wait_for(lambda: descriptor_count() <= before)


@pytest.mark.slow
def test_node_ends_soon_with_silent_and_talking_consoles() -> None:
    with running() as (node, address):
        silent, talking = open_socket(address), ConsoleClient(address)
        with talking, silent:
            talking.wait_until_up(TIMEOUT_S)
            start_s = time.monotonic()
            talking.ask("exit asked")
            wait_for(lambda: not node.components["console"]._executor._thread.is_alive())  # type: ignore[attr-defined]
            assert time.monotonic() - start_s < 2.0
    assert not any("did not end" in note for note in node.notes)


@pytest.mark.slow
def test_flooding_and_non_reading_consoles_use_bounded_memory() -> None:
    flood = encode_frame(b'{"$":"command","number":1,"line":"dump"}') * 2000
    with running() as (node, address), open_socket(address) as sock:
        sock.sendall(encode_frame(HELLO))
        sock.settimeout(0.2)
        with suppress(TimeoutError):
            while True:  # until the node stops reading
                sock.sendall(flood)
        receiver: Any = node.components["console"]
        for one in receiver._connections:
            assert len(one.protocol.output) < 1 << 18
            assert len(one.protocol._requests) <= wire.READ_BYTES
        assert not RemoteConsole(address, ["list"]).run()[0].is_error


@pytest.mark.slow
def test_paced_lock_step_answers_while_virtual_time_advances() -> None:
    console = CommandReceiverFactory(0)
    runner = SimRunner(
        Config(factories={"urov": [console, FunctionLoopFactory(rate_hz=20.0)]}), pace=1.0, until_s=600.0
    )  # fmt: skip
    thread = threading.Thread(target=runner.run)
    thread.start()
    wait_for(lambda: console.port)
    answers = RemoteConsole(("127.0.0.1", console.port), ["store depth_m 1", "list loops", "exit seen"]).run()
    thread.join(TIMEOUT_S)
    assert not thread.is_alive()
    assert not any(answer.is_error for answer in answers)
    assert runner.nodes["urov"].exit_reason == "seen"
    assert runner.nodes["urov"].get_data("depth_m") == 1


@pytest.mark.slow
def test_unpaced_run_answers_between_its_moments() -> None:
    console = CommandReceiverFactory(0)
    clock = SimClock()
    node = Node("r", Config(factories={"r": [console, FunctionLoopFactory(rate_hz=1000.0)]}), clock=clock)
    thread = threading.Thread(target=LockStep([node], clock, until_s=1e9).run)
    thread.start()
    wait_for(lambda: console.port)
    (_, answer) = RemoteConsole(("127.0.0.1", console.port), ["list", "exit seen"], wait_s=TIMEOUT_S).run()
    thread.join(TIMEOUT_S)
    assert not answer.is_error
    assert node.exit_reason == "seen"


@pytest.mark.slow
def test_console_in_lock_step_adds_no_moments_to_the_run() -> None:
    clock = SimClock()
    node = Node("r", Config(factories={"r": [CommandReceiverFactory(0), TimeoutLoopFactory(seconds=3)]}), clock=clock)
    LockStep([node], clock).run()
    assert (node.exit_reason, clock.now_s()) == ("timeout", 3.0)
