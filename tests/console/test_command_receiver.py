"""The console over TCP: several clients, unauthenticated ones, silence, invalid data, tokens, the end; on loopback."""

import asyncio
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
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
    TaskType,
    TimeoutLoopFactory,
    tasks,
)
from snr_sim.console import command_receiver, wire
from snr_sim.core.lockstep import LockStep
from snr_sim.links.frames import encode_frame
from snr_sim.prelude.errors import ConfigError, LinkError
from snr_sim.testing.parts import PartFactory, TickerFactory

TOKEN = "a token of at least sixteen bytes"
HELLO = (
    b'{"$":"hello","protocol":"snr","version":2,"node":"x","nonce":"00000000000000000000000000000000",'
    b'"purpose":"console","auth":false,"max_frame_bytes":1048576}'
)
PATIENCE_S = 60.0  # an upper limit for a very busy machine; usually no test waits this long


@contextmanager
def running(*factories: Any, token: str | None = None) -> Iterator[tuple[Node, tuple[str, int]]]:
    """Run a node with a console, on a thread of this process."""
    console = CommandReceiverFactory(0, token=token)
    part = PartFactory({(TaskType.event, "start"): lambda task, task_id: None})
    node = Node("urov", Config(factories={"urov": [console, part, *factories]}))
    failure: list[BaseException] = []

    def run() -> None:
        try:
            node.loop()
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        wait_for(lambda: console.port != 0 or failure)
        yield node, ("127.0.0.1", console.port)
        assert not node.is_over or node.exit_reason == "asked", "the node has ended by itself"
    finally:
        node.enter(tasks.terminate("test"), "test")
        thread.join(PATIENCE_S)
    assert not failure, failure
    assert not thread.is_alive()


def wait_for(what: Callable[[], Any]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < until_s, "waited in vain"
        time.sleep(0.005)


def stranger(address: tuple[str, int]) -> socket.socket:
    sock = socket.create_connection(address)
    sock.settimeout(PATIENCE_S)
    return sock


def all_of(sock: socket.socket) -> bytes:
    """Return all data until the other end closes the connection."""
    said = b""
    while data := sock.recv(1 << 16):
        said += data
    return said


@pytest.mark.slow
def test_a_script_gives_commands_and_gets_answers() -> None:
    with running() as (node, address):
        answers = RemoteConsole(address, ["store depth_m 2.5", "dump depth_m", "stroe", "list components"]).run()
        assert [answer.is_error for answer in answers] == [False, False, True, False]
        assert answers[1].data["data"] == 2.5
        assert "did you mean 'store'" in answers[2].text
        assert node.get_data("depth_m") == 2.5


@pytest.mark.slow
def test_exit_is_answered_before_the_node_ends() -> None:
    with running() as (node, address):
        (answer,) = RemoteConsole(address, ["exit asked"]).run()
        assert "asked to end" in answer.text
        wait_for(lambda: node.is_over)
        assert node.exit_reason == "asked"


@pytest.mark.slow
def test_a_reload_is_answered_with_what_came_of_it() -> None:
    with running() as (_, address):
        (answer,) = RemoteConsole(address, ["reload part"]).run()
        assert answer.data["component"] == "part"
        assert answer.is_error is not answer.data["ok"]


@pytest.mark.slow
def test_a_reload_of_all_is_answered_over_the_line_it_came_by() -> None:
    with running() as (_, address), ConsoleClient(address) as client:
        client.wait_until_up(PATIENCE_S)
        answer = client.ask("reload all")
        assert answer.data["component"] == "all"
        assert answer.data["made"] == ["part"]
        assert client.ask("list components").is_error is False


@pytest.mark.slow
def test_a_console_can_be_reloaded_from_itself_and_consoles_call_again() -> None:
    with running() as (node, address), ConsoleClient(address, retry_wait_s=0.01) as client:
        client.wait_until_up(PATIENCE_S)
        cut_off = client.ask("reload console")
        assert "console anew" in cut_off.text
        client.wait_until_lost()
        client.wait_until_up(PATIENCE_S)
        wait_for(lambda: node.get_data("reload"))
        assert client.ask("dump reload").data["data"]["made"] == ["console"]


@pytest.mark.slow
def test_several_consoles_are_served_and_one_that_leaves_takes_nobody_along() -> None:
    with running() as (node, address), ConsoleClient(address) as one, ConsoleClient(address) as other:
        for client in (one, other):
            client.wait_until_up(PATIENCE_S)
        one.ask("store who 1")
        one.__exit__()
        wait_for(lambda: node.get_data("who") == 1)
        assert other.ask("dump who").data["data"] == 1
        assert other.node == "urov_node"


@pytest.mark.slow
def test_a_watched_page_comes_by_itself() -> None:
    came: list[Any] = []
    enough = threading.Event()

    def take(answer: Any) -> None:
        came.append(answer.data["data"])
        if len(came) == 3:
            enough.set()

    counter = TickerFactory(lambda loop: loop.store_data("count", loop.get_time_s()), rate_hz=50.0)
    with running(counter) as (_, address), ConsoleClient(address, on_change=take) as client:
        client.wait_until_up(PATIENCE_S)
        client.ask("watch count")
        assert enough.wait(PATIENCE_S)
        client.ask("unwatch")
    assert came == sorted(came)


@pytest.mark.slow
def test_the_right_token_opens_and_never_crosses_the_wire() -> None:
    with running(token=TOKEN) as (_, address):
        (answer,) = RemoteConsole(address, ["list"], token=TOKEN).run()
        assert not answer.is_error
    with socket.create_server(("127.0.0.1", 0)) as listener, ConsoleClient(listener.getsockname(), TOKEN):
        sock, _ = listener.accept()
        with sock:
            heard = sock.recv(1 << 16)
    assert b"hello" in heard
    assert TOKEN.encode() not in heard


@pytest.mark.slow
@pytest.mark.parametrize(
    ("token", "said"),
    [(None, "asks for a token"), ("another token of sixteen bytes", "the tokens of the two ends differ")],
)
def test_a_wrong_token_or_none_is_refused_in_words(token: str | None, said: str) -> None:
    with running(token=TOKEN) as (node, address):
        with pytest.raises(LinkError, match=f"^The console at .*: .*{said}.*Try: .*--token-file FILE.*SNR_TOKEN"):
            RemoteConsole(address, ["exit gotcha"], token=token, wait_s=PATIENCE_S).run()
        assert not node.is_terminated


@pytest.mark.slow
def test_a_token_where_none_is_asked_for_is_said() -> None:
    with running() as (_, address), pytest.raises(LinkError, match="asks for a token"):
        RemoteConsole(address, ["list"], token=TOKEN, wait_s=PATIENCE_S).run()


@pytest.mark.slow
def test_a_command_before_the_greeting_is_not_carried_out() -> None:
    command = b'{"$":"command","number":1,"line":"exit now"}'
    with running(token=TOKEN) as (node, address):
        for first in ([], [HELLO.replace(b"false", b"true")]):
            with stranger(address) as sock:
                for message in (*first, command):
                    sock.sendall(encode_frame(message))
                assert b"refused" in all_of(sock)
        assert not node.is_terminated


@pytest.mark.slow
@pytest.mark.parametrize(
    "said",
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
def test_whoever_does_not_speak_the_protocol_is_told_and_the_line_closed(said: bytes) -> None:
    with running() as (node, address):
        with stranger(address) as sock:
            sock.sendall(said)
            assert b"refused" in all_of(sock)
        assert not RemoteConsole(address, ["list"]).run()[0].is_error
        assert node.get_data("depth_m") is None


@pytest.mark.slow
def test_weakness_10_a_stranger_cannot_crash_a_node_nor_by_coming_and_going(caplog: pytest.LogCaptureFixture) -> None:
    with running(token=TOKEN) as (node, address):
        for _ in range(2):  # two clients that connect and close
            stranger(address).close()
        for page in (b'["task"]', b'{"$":"page","key":"console","data":["task"],"origin":"x","created_at_s":0}'):
            with stranger(address) as sock:
                sock.sendall(encode_frame(page))
                all_of(sock)
        answers = RemoteConsole(address, ["task", "task start"], token=TOKEN).run()
        assert [answer.is_error for answer in answers] == [True, False]
        assert not node.is_over
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


@pytest.mark.slow
def test_console_whose_loop_fails_listens_again_at_its_port(
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
            one.wait_until_up(PATIENCE_S)
            monkeypatch.setattr(asyncio, "start_server", start_server)
            console._events.call_soon_threadsafe(console._ending.set)  # this round ends, and the next one fails
            wait_for(lambda: console.failures == 1 and not console.is_shut)
        assert not RemoteConsole(address, ["list"], wait_s=PATIENCE_S).run()[0].is_error
        assert not node.is_over
    assert "'console' failed and starts again: ZeroDivisionError: division by zero" in caplog.messages


@pytest.mark.parametrize("host", ["0.0.0.0", "", "::", "192.168.2.2", "robot.local"])
def test_weakness_11_beyond_this_machine_a_console_without_a_token_is_refused_when_it_is_made(host: str) -> None:
    with pytest.raises(ConfigError, match="without a token"):
        CommandReceiverFactory(0, host=host)
    CommandReceiverFactory(0, host=host, token=TOKEN)
    with pytest.raises(ConfigError, match="at least 16"):
        CommandReceiverFactory(0, host=host, token="short")


@pytest.mark.slow
def test_weakness_11_a_console_listens_where_it_was_told_and_nowhere_else() -> None:
    with running() as (node, _):
        listener = node.components["console"]._sock  # type: ignore[attr-defined]
        assert listener.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize("port", [-1, 65536, "54321", 1.5, None])
def test_a_port_that_is_none_is_refused_when_the_console_is_made(port: Any) -> None:
    with pytest.raises(ConfigError, match="port is"):
        CommandReceiverFactory(port)


@pytest.mark.slow
def test_a_port_in_use_is_said_at_the_start_and_everything_halted() -> None:
    halted: list[str] = []
    part = PartFactory(halt=lambda part: halted.append(part.name))
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        node = Node("r", Config(factories={"r": [part, CommandReceiverFactory(port)]}))
        with pytest.raises(Exception, match=f"A console cannot listen on 127.0.0.1 port {port}"):
            node.loop()
    assert halted == ["part"]


@pytest.mark.slow
def test_strangers_who_say_nothing_do_not_keep_a_console_out(monkeypatch: pytest.MonkeyPatch) -> None:
    with running() as (node, address):
        silent = [stranger(address) for _ in range(command_receiver.STRANGERS_MAX + 10)]
        assert not RemoteConsole(address, ["list"]).run()[0].is_error
        assert len(node.components["console"]._lines) <= command_receiver.STRANGERS_MAX + 1  # type: ignore[attr-defined]
        for sock in silent:
            sock.close()


@pytest.mark.slow
def test_there_are_only_so_many_consoles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command_receiver, "CONSOLES_MAX", 1)
    with running() as (_, address), ConsoleClient(address) as one:
        one.wait_until_up(PATIENCE_S)
        with pytest.raises(LinkError, match="consoles are connected"):
            RemoteConsole(address, ["list"], wait_s=PATIENCE_S).run()
        assert not one.ask("list").is_error


@pytest.mark.slow
def test_a_console_that_is_closed_again_leaves_no_descriptor() -> None:
    with running() as (node, address):
        RemoteConsole(address, ["list"]).run()
        wait_for(lambda: not node.components["console"]._lines)  # type: ignore[attr-defined]
        before = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0
        for _ in range(10):
            RemoteConsole(address, ["list"]).run()
        wait_for(lambda: not node.components["console"]._lines)  # type: ignore[attr-defined]
        after = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0
    assert after <= before


@pytest.mark.slow
def test_a_node_ends_soon_whatever_its_consoles_do() -> None:
    with running() as (node, address):
        silent, talking = stranger(address), ConsoleClient(address)
        with talking, silent:
            talking.wait_until_up(PATIENCE_S)
            start_s = time.monotonic()
            talking.ask("exit asked")
            wait_for(lambda: not node.components["console"]._backing._thread.is_alive())  # type: ignore[attr-defined]
            assert time.monotonic() - start_s < 2.0
    assert not any("did not end" in note for note in node.notes)


@pytest.mark.slow
def test_a_console_that_floods_and_one_that_does_not_read_cost_memory_to_a_bound() -> None:
    flood = encode_frame(b'{"$":"command","number":1,"line":"dump"}') * 2000
    with running() as (node, address), stranger(address) as sock:
        sock.sendall(encode_frame(HELLO))
        sock.settimeout(0.2)
        with suppress(TimeoutError):
            while True:  # until the node stops reading
                sock.sendall(flood)
        receiver: Any = node.components["console"]
        for one in receiver._lines:
            assert len(one.conversation.output) < 1 << 18
            assert len(one.conversation._asked) <= wire.READ_BYTES
        assert not RemoteConsole(address, ["list"]).run()[0].is_error


@pytest.mark.slow
def test_in_a_paced_lock_step_a_console_is_answered_while_virtual_time_goes_on() -> None:
    console = CommandReceiverFactory(0)
    runner = SimRunner(
        Config(factories={"urov": [console, TickerFactory(rate_hz=20.0)]}), pace=1.0, until_s=600.0
    )  # fmt: skip
    thread = threading.Thread(target=runner.run)
    thread.start()
    wait_for(lambda: console.port)
    answers = RemoteConsole(("127.0.0.1", console.port), ["store depth_m 1", "list loops", "exit seen"]).run()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert not any(answer.is_error for answer in answers)
    assert runner.nodes["urov"].exit_reason == "seen"
    assert runner.nodes["urov"].get_data("depth_m") == 1


@pytest.mark.slow
def test_a_run_as_fast_as_it_goes_answers_between_its_moments() -> None:
    console = CommandReceiverFactory(0)
    clock = SimClock()
    node = Node("r", Config(factories={"r": [console, TickerFactory(rate_hz=1000.0)]}), clock=clock)
    thread = threading.Thread(target=LockStep([node], clock, until_s=1e9).run)
    thread.start()
    wait_for(lambda: console.port)
    (_, answer) = RemoteConsole(("127.0.0.1", console.port), ["list", "exit seen"], wait_s=PATIENCE_S).run()
    thread.join(PATIENCE_S)
    assert not answer.is_error
    assert node.exit_reason == "seen"


@pytest.mark.slow
def test_in_lock_step_it_adds_no_moments_and_a_run_ends_as_without_it() -> None:
    clock = SimClock()
    node = Node("r", Config(factories={"r": [CommandReceiverFactory(0), TimeoutLoopFactory(seconds=3)]}), clock=clock)
    LockStep([node], clock).run()
    assert (node.exit_reason, clock.now_s()) == ("timeout", 3.0)
