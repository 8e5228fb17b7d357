import socket
import threading

from snr_sim import Config, Mode, Node, tasks
from snr_sim.core.door import Door
from snr_sim.core.lookout import Lookout

LIMIT_S = 90.0


def test_what_can_be_read_is_served_on_the_thread_that_waits() -> None:
    door, (near, far) = Door(), socket.socketpair()
    served: list[tuple[bytes, int]] = []

    def serve() -> None:
        served.append((far.recv(10), threading.get_ident()))
        door.put(tasks.event("came"), "wire")

    with near, far:
        door.watch(far.fileno(), serve)
        near.send(b"x")
        while not door.waiting:
            door.wait(LIMIT_S)
        door.unwatch(far.fileno())
        door.close()
    assert served == [(b"x", threading.get_ident())]


def test_a_task_from_another_thread_ends_the_wait_also_while_descriptors_are_watched() -> None:
    door, (near, far) = Door(), socket.socketpair()
    received = []
    with near, far:
        door.watch(far.fileno(), lambda: None)
        thread = threading.Thread(target=lambda: [door.put(tasks.event(str(i)), "t") for i in range(10_000)])
        thread.start()
        while len(received) < 10_000:
            door.wait(LIMIT_S)
            while door.waiting:
                received.append(door.waiting.popleft()[0].name)
        thread.join()
        door.close()
    assert received == [str(i) for i in range(10_000)]


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

        def serve() -> None:
            far.recv(10)
            served.set()

        door.watch(far.fileno(), serve)
        thread.join(LIMIT_S)
        assert not thread.is_alive()
        door.close()


def test_what_is_no_longer_watched_is_not_served() -> None:
    lookout, (near, far) = Lookout(), socket.socketpair()
    with near, far:
        near.send(b"x")
        lookout.watch(far.fileno(), lambda: None)
        assert len(lookout.wait(LIMIT_S)) == 1
        lookout.unwatch(far.fileno())
        lookout.unwatch(far.fileno())  # twice is as good as once
        assert lookout.wait(0.0) == []
    lookout.wake()
    assert len(lookout.wait(LIMIT_S)) == 1
    lookout.close()
    lookout.wake()  # too late, and no error


def test_a_node_that_ends_lets_go_of_what_it_watched_with() -> None:
    node = Node("test", Config(Mode.TEST, {"test": []}))
    near, far = socket.socketpair()
    with near, far:
        node.door.watch(far.fileno(), lambda: node.enter(tasks.terminate(far.recv(10).decode()), "wire"))
        near.send(b"enough")
        node.loop()
    assert node.exit_reason == "enough"
    node.door.close()
