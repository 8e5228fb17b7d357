import socket
import threading

import pytest

from snr_sim import Config, Mode, Node, tasks
from snr_sim.core.inbox import Inbox, SelectorWaiter

LIMIT_S = 90.0


def test_readable_descriptor_is_served_on_waiting_thread() -> None:
    inbox, (near, far) = Inbox(), socket.socketpair()
    served: list[tuple[bytes, int]] = []

    def serve(what: list[None]) -> None:
        served.append((far.recv(10), threading.get_ident()))
        inbox.put(tasks.event("came"), "wire")

    with near, far:
        inbox.watch(far.fileno(), serve, None)
        near.send(b"x")
        while not inbox.waiting:
            inbox.wait(LIMIT_S)
        inbox.unwatch(far.fileno())
        inbox.close()
    assert served == [(b"x", threading.get_ident())]


@pytest.mark.slow
def test_a_task_from_another_thread_ends_the_wait_also_while_descriptors_are_watched() -> None:
    inbox, (near, far) = Inbox(), socket.socketpair()
    received = []
    with near, far:
        inbox.watch(far.fileno(), lambda what: None, None)
        thread = threading.Thread(target=lambda: [inbox.put(tasks.event(str(i)), "t") for i in range(10_000)])
        thread.start()
        while len(received) < 10_000:
            inbox.wait(LIMIT_S)
            while inbox.waiting:
                received.append(inbox.waiting.popleft()[0].name)
        thread.join()
        inbox.close()
    assert received == [str(i) for i in range(10_000)]


@pytest.mark.slow
def test_watch_during_wait_applies_to_that_wait() -> None:
    inbox, (near, far) = Inbox(), socket.socketpair()
    served = threading.Event()
    with near, far:
        near.send(b"x")

        def wait() -> None:
            while not served.is_set():
                inbox.wait()

        thread = threading.Thread(target=wait)
        thread.start()

        def serve(what: list[None]) -> None:
            far.recv(10)
            served.set()

        inbox.watch(far.fileno(), serve, None)
        thread.join(LIMIT_S)
        assert not thread.is_alive()
        inbox.close()


@pytest.mark.slow
def test_concurrent_watch_calls_are_both_served(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two links that come up together, each on its thread: the second comes while the first one is at it."""
    inbox, (near, far), (other_near, other_far) = Inbox(), socket.socketpair(), socket.socketpair()
    served: set[str] = set()
    second = threading.Thread(target=lambda: inbox.watch(other_far.fileno(), served.update, "second"))

    class Slow(SelectorWaiter):
        def __init__(self) -> None:
            super().__init__()
            if second.ident is None:
                second.start()
                second.join(0.2)

    monkeypatch.setattr("snr_sim.core.inbox.SelectorWaiter", Slow)
    with near, far, other_near, other_far:
        near.send(b"x")
        other_near.send(b"x")
        inbox.watch(far.fileno(), served.update, "first")
        second.join(LIMIT_S)
        inbox.wait(LIMIT_S)
        inbox.close()
    assert served == {"first", "second"}


def test_unwatched_descriptor_is_not_served() -> None:
    selector_waiter, (near, far) = SelectorWaiter(), socket.socketpair()
    with near, far:
        near.send(b"x")
        selector_waiter.watch(far.fileno(), lambda what: None, None)
        assert len(selector_waiter.wait(LIMIT_S)) == 1
        selector_waiter.unwatch(far.fileno())
        selector_waiter.unwatch(far.fileno())  # twice is as good as once
        assert list(selector_waiter.wait(0.0)) == []
    selector_waiter.wake()
    assert len(selector_waiter.wait(LIMIT_S)) == 1
    selector_waiter.close()
    selector_waiter.wake()  # too late, and no error


def test_ended_node_closes_its_selector() -> None:
    node = Node("test", Config(Mode.TEST, {"test": []}))
    near, far = socket.socketpair()
    with near, far:
        node.inbox.watch(
            far.fileno(), lambda what: node.enqueue_input(tasks.terminate(far.recv(10).decode()), "wire"), None
        )
        near.send(b"enough")
        node.loop()
    assert node.exit_reason == "enough"
    node.inbox.close()
