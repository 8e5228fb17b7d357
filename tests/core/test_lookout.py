import socket
import threading

import pytest

from snr_sim import Config, Mode, Node, tasks
from snr_sim.core.door import Door
from snr_sim.core.lookout import Lookout

LIMIT_S = 90.0


def test_what_can_be_read_is_served_on_the_thread_that_waits() -> None:
    door, (near, far) = Door(), socket.socketpair()
    served: list[tuple[bytes, int]] = []

    def serve(what: list[None]) -> None:
        served.append((far.recv(10), threading.get_ident()))
        door.put(tasks.event("came"), "wire")

    with near, far:
        door.watch(far.fileno(), serve, None)
        near.send(b"x")
        while not door.waiting:
            door.wait(LIMIT_S)
        door.unwatch(far.fileno())
        door.close()
    assert served == [(b"x", threading.get_ident())]


@pytest.mark.slow
def test_a_task_from_another_thread_ends_the_wait_also_while_descriptors_are_watched() -> None:
    door, (near, far) = Door(), socket.socketpair()
    received = []
    with near, far:
        door.watch(far.fileno(), lambda what: None, None)
        thread = threading.Thread(target=lambda: [door.put(tasks.event(str(i)), "t") for i in range(10_000)])
        thread.start()
        while len(received) < 10_000:
            door.wait(LIMIT_S)
            while door.waiting:
                received.append(door.waiting.popleft()[0].name)
        thread.join()
        door.close()
    assert received == [str(i) for i in range(10_000)]


@pytest.mark.slow
def test_whoever_waits_already_when_watching_begins_waits_for_that_too() -> None:
    door, (near, far) = Door(), socket.socketpair()
    served = threading.Event()
    with near, far:
        near.send(b"x")

        def wait() -> None:
            while not served.is_set():
                door.wait()

        thread = threading.Thread(target=wait)
        thread.start()

        def serve(what: list[None]) -> None:
            far.recv(10)
            served.set()

        door.watch(far.fileno(), serve, None)
        thread.join(LIMIT_S)
        assert not thread.is_alive()
        door.close()


@pytest.mark.slow
def test_two_who_begin_watching_at_one_moment_are_both_served(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two links that come up together, each on its thread: the second comes while the first one is at it."""
    door, (near, far), (other_near, other_far) = Door(), socket.socketpair(), socket.socketpair()
    served: set[str] = set()
    second = threading.Thread(target=lambda: door.watch(other_far.fileno(), served.update, "second"))

    class Slow(Lookout):
        def __init__(self) -> None:
            super().__init__()
            if second.ident is None:
                second.start()
                second.join(0.2)

    monkeypatch.setattr("snr_sim.core.door.Lookout", Slow)
    with near, far, other_near, other_far:
        near.send(b"x")
        other_near.send(b"x")
        door.watch(far.fileno(), served.update, "first")
        second.join(LIMIT_S)
        door.wait(LIMIT_S)
        door.close()
    assert served == {"first", "second"}


def test_what_is_no_longer_watched_is_not_served() -> None:
    lookout, (near, far) = Lookout(), socket.socketpair()
    with near, far:
        near.send(b"x")
        lookout.watch(far.fileno(), lambda what: None, None)
        assert len(lookout.wait(LIMIT_S)) == 1
        lookout.unwatch(far.fileno())
        lookout.unwatch(far.fileno())  # twice is as good as once
        assert list(lookout.wait(0.0)) == []
    lookout.wake()
    assert len(lookout.wait(LIMIT_S)) == 1
    lookout.close()
    lookout.wake()  # too late, and no error


def test_a_node_that_ends_lets_go_of_what_it_watched_with() -> None:
    node = Node("test", Config(Mode.TEST, {"test": []}))
    near, far = socket.socketpair()
    with near, far:
        node.door.watch(far.fileno(), lambda what: node.enter(tasks.terminate(far.recv(10).decode()), "wire"), None)
        near.send(b"enough")
        node.loop()
    assert node.exit_reason == "enough"
    node.door.close()
