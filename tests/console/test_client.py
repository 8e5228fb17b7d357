"""The client's end of a console connection: it waits for a node, detects that the node is gone, and reconnects."""

import socket
import threading
import time
from collections.abc import Callable

import pytest

from snr_sim import ConsoleClient, RemoteConsole
from snr_sim.links.frames import encode_frame
from snr_sim.prelude.errors import ConfigError, LinkError
from tests.on_thread import TIMEOUT_S

from .conftest import running


class StateLog:
    """Sentences reported on another thread."""

    def __init__(self) -> None:
        self.sentences: list[str] = []
        self._changed = threading.Condition()

    def __call__(self, sentence: str) -> None:
        with self._changed:
            self.sentences.append(sentence)
            self._changed.notify_all()

    def wait_for(self, is_enough: Callable[[list[str]], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(lambda: is_enough(self.sentences), TIMEOUT_S), self.sentences


@pytest.mark.slow
def test_client_reports_lost_connection_and_reconnects() -> None:
    states = StateLog()
    with running() as (_, address):
        client = ConsoleClient(address, retry_wait_s=0.01, on_state=states)
        client.__enter__()
        client.wait_until_up(TIMEOUT_S)
    states.wait_for(lambda sentences: len(sentences) == 2)
    assert "connected to urov_node" in states.sentences[0]
    assert "lost" in states.sentences[1]
    assert "ended: test" in states.sentences[1]
    with pytest.raises(LinkError, match="no connection"):
        client.ask("list")
    assert client.complete("li") == []
    with running(port=address[1]):
        client.wait_until_up(TIMEOUT_S)
        assert not client.ask("list").is_error
        assert client.complete("li") == ["list"]
        client.__exit__()


@pytest.mark.slow
def test_script_started_before_its_node_gets_answers() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
    answers: list[object] = []
    remote = RemoteConsole(("127.0.0.1", port), ["list"], retry_wait_s=0.01, wait_s=TIMEOUT_S)
    thread = threading.Thread(target=lambda: answers.extend(remote.run()))
    thread.start()
    with running(port=port):
        thread.join(TIMEOUT_S)
    assert len(answers) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "closed"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "does not speak this protocol"),
        (encode_frame(b'{"$":"words"}'), "an invalid message"),
    ],
)
def test_non_console_port_raises_link_error_with_reason(data: bytes, reason: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            sock, _ = listener.accept()
            with sock:
                sock.sendall(data)
                sock.recv(4096)

        thread = threading.Thread(target=answer)
        thread.start()
        with ConsoleClient(listener.getsockname(), retry_wait_s=60.0) as client:
            thread.join(TIMEOUT_S)
            until_s = time.monotonic() + TIMEOUT_S
            while "no connection has been tried" in client.reason and time.monotonic() < until_s:
                time.sleep(0.005)
            with pytest.raises(LinkError, match="No console at 127") as caught:
                client.wait_until_up(0.0)
    assert reason in str(caught.value)


@pytest.mark.slow
def test_unresolvable_host_raises_link_error_with_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def raise_gaierror(*args: object, **options: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", raise_gaierror)
    with ConsoleClient(("robot.local", 1), retry_wait_s=0.01) as client:
        until_s = time.monotonic() + TIMEOUT_S
        while "not known" not in client.reason and time.monotonic() < until_s:
            time.sleep(0.005)
        with pytest.raises(LinkError, match=r"No console at robot\.local:1: Name or service not known"):
            client.wait_until_up(0.0)


@pytest.mark.slow
@pytest.mark.parametrize("host", ["x" * 70, "\0"])
def test_invalid_host_raises_link_error_with_reason(host: str) -> None:
    with pytest.raises(LinkError, match="No console"):
        RemoteConsole((host, 1), ["list"], wait_s=0.1).run()


def test_invalid_token_raises_config_error_at_construction() -> None:
    with pytest.raises(ConfigError, match="at least 16"):
        RemoteConsole(("127.0.0.1", 1), token="short")


@pytest.mark.slow
def test_invalid_line_is_rejected_by_the_client() -> None:
    with running() as (_, address):
        long, broken = RemoteConsole(address, ["x" * 20_000, "store x \ud800"]).run()
    assert "20000 characters" in long.text
    assert "UTF-8" in broken.text
    assert long.is_error
    assert broken.is_error
