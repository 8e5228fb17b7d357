"""The client's end of a console connection: it waits for a node, detects that the node is gone, and reconnects."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from snr_sim import CommandReceiverFactory, Config, ConsoleClient, Node, RemoteConsole, tasks
from snr_sim.links.frames import encode_frame
from snr_sim.prelude.errors import ConfigError, LinkError
from snr_sim.testing.parts import PartFactory

PATIENCE_S = 60.0


class Told:
    """Sentences reported on another thread."""

    def __init__(self) -> None:
        self.sentences: list[str] = []
        self._came = threading.Condition()

    def __call__(self, sentence: str) -> None:
        with self._came:
            self.sentences.append(sentence)
            self._came.notify_all()

    def wait_for(self, is_enough: Callable[[list[str]], bool]) -> None:
        with self._came:
            assert self._came.wait_for(lambda: is_enough(self.sentences), PATIENCE_S), self.sentences


@contextmanager
def node_at(port: int) -> Iterator[int]:
    begun = threading.Event()
    console = CommandReceiverFactory(port)
    node = Node("urov", Config(factories={"urov": [console, PartFactory(begin=lambda part: begun.set())]}))
    thread = threading.Thread(target=node.loop)
    thread.start()
    assert begun.wait(PATIENCE_S)
    try:
        yield console.port
    finally:
        node.enter(tasks.terminate("test"), "test")
        thread.join(PATIENCE_S)


@pytest.mark.slow
def test_a_line_that_is_lost_is_said_and_called_again_until_the_node_is_back() -> None:
    told = Told()
    with node_at(0) as port:
        client = ConsoleClient(("127.0.0.1", port), retry_wait_s=0.01, on_state=told)
        client.__enter__()
        client.wait_until_up(PATIENCE_S)
    told.wait_for(lambda said: len(said) == 2)
    assert "connected to urov_node" in told.sentences[0]
    assert "lost" in told.sentences[1]
    assert "ended: test" in told.sentences[1]
    with pytest.raises(LinkError, match="no line"):
        client.ask("list")
    assert client.complete("li") == []
    with node_at(port):
        client.wait_until_up(PATIENCE_S)
        assert not client.ask("list").is_error
        assert client.complete("li") == ["list"]
        client.__exit__()


@pytest.mark.slow
def test_a_script_may_start_before_its_node() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
    answers: list[object] = []
    remote = RemoteConsole(("127.0.0.1", port), ["list"], retry_wait_s=0.01, wait_s=PATIENCE_S)
    thread = threading.Thread(target=lambda: answers.extend(remote.run()))
    thread.start()
    with node_at(port):
        thread.join(PATIENCE_S)
    assert len(answers) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (b"", "closed"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "does not speak this protocol"),
        (encode_frame(b'{"$":"words"}'), "that is none"),
    ],
)
def test_a_port_that_is_no_console_is_said_in_words(said: bytes, reason: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            sock, _ = listener.accept()
            with sock:
                sock.sendall(said)
                sock.recv(4096)

        thread = threading.Thread(target=answer)
        thread.start()
        with ConsoleClient(listener.getsockname(), retry_wait_s=60.0) as client:
            thread.join(PATIENCE_S)
            until_s = time.monotonic() + PATIENCE_S
            while "nobody has been called" in client.reason and time.monotonic() < until_s:
                time.sleep(0.005)
            with pytest.raises(LinkError, match="No console at 127") as caught:
                client.wait_until_up(0.0)
    assert reason in str(caught.value)


@pytest.mark.slow
def test_a_host_that_does_not_resolve_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody_knows(*args: object, **options: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", nobody_knows)
    with ConsoleClient(("robot.local", 1), retry_wait_s=0.01) as client:
        until_s = time.monotonic() + PATIENCE_S
        while "not known" not in client.reason and time.monotonic() < until_s:
            time.sleep(0.005)
        with pytest.raises(LinkError, match=r"No console at robot\.local:1: Name or service not known"):
            client.wait_until_up(0.0)


@pytest.mark.slow
@pytest.mark.parametrize("host", ["x" * 70, "\0"])
def test_a_host_that_can_be_none_is_said(host: str) -> None:
    with pytest.raises(LinkError, match="No console"):
        RemoteConsole((host, 1), ["list"], wait_s=0.1).run()


def test_a_token_that_is_none_is_refused_when_it_is_given() -> None:
    with pytest.raises(ConfigError, match="at least 16"):
        RemoteConsole(("127.0.0.1", 1), token="short")


@pytest.mark.slow
def test_a_line_no_node_would_take_is_refused_here() -> None:
    with node_at(0) as port:
        long, broken = RemoteConsole(("127.0.0.1", port), ["x" * 20_000, "store x \ud800"]).run()
    assert "20000 characters" in long.text
    assert "UTF-8" in broken.text
    assert long.is_error
    assert broken.is_error
