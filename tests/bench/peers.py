"""Round trips of the same bytes over other transports, between two processes on loopback, to compare links with.

Each function runs the near end and starts the far end as a process of this file.
"""

from __future__ import annotations

import importlib.util
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Sequence

HOST = "127.0.0.1"
LIMIT_S = 60.0  # a far end that has nothing to do for so long ends by itself


def free_port() -> int:
    """Return a TCP port that is free now."""
    with socket.socket() as sock:
        sock.bind((HOST, 0))
        return int(sock.getsockname()[1])


def tcp_round_trips_s(payload: bytes, count: int) -> list[float]:
    """Return round trips through bare TCP: length, bytes, TCP_NODELAY, and nothing else."""
    with socket.create_server((HOST, 0)) as server, _far_end("tcp", server.getsockname()[1]):
        server.settimeout(LIMIT_S)
        sock, _ = server.accept()
        with sock:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return timed(lambda: (_send(sock, payload), _receive(sock)), count)


def _send(sock: socket.socket, payload: bytes) -> None:
    sock.sendall(struct.pack(">I", len(payload)) + payload)


def _receive(sock: socket.socket) -> bytes:
    (length,) = struct.unpack(">I", sock.recv(4, socket.MSG_WAITALL))
    return sock.recv(length, socket.MSG_WAITALL)


def _tcp_far_end(port: int) -> None:
    with socket.create_connection((HOST, port), LIMIT_S) as sock:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            while True:
                _send(sock, _receive(sock))
        except (OSError, struct.error):
            pass  # the near end has gone


def zeromq_round_trips_s(payload: bytes, count: int) -> list[float]:
    """Return round trips through a pair of ZeroMQ's PAIR sockets over TCP."""
    import zmq

    with zmq.Context() as context, context.socket(zmq.PAIR) as sock:
        sock.linger = 0
        sock.rcvtimeo = int(1e3 * LIMIT_S)
        port = sock.bind_to_random_port(f"tcp://{HOST}")
        with _far_end("zeromq", port):
            return timed(lambda: (sock.send(payload), sock.recv()), count)


def _zeromq_far_end(port: int) -> None:
    import zmq

    with zmq.Context() as context, context.socket(zmq.PAIR) as sock:
        sock.linger = 0
        sock.rcvtimeo = int(1e3 * LIMIT_S)
        sock.connect(f"tcp://{HOST}:{port}")
        while message := sock.recv():
            sock.send(message)


def zenoh_round_trips_s(payload: bytes, count: int) -> list[float]:
    """Return round trips through Zenoh peers over TCP: express, read from a queue, the quicker of its ways here."""
    import zenoh

    port = free_port()
    with zenoh.open(_zenoh_config("listen", port)) as session:
        subscriber = session.declare_subscriber("pong", zenoh.handlers.FifoChannel(64))
        publisher = session.declare_publisher("ping", express=True)
        with _far_end("zenoh", port):
            give_up_s = time.monotonic() + LIMIT_S
            while not publisher.matching_status.matching:  # polled: there is no notification of a connected peer
                assert time.monotonic() < give_up_s, "the far end has not come"
                time.sleep(0.01)
            answer = timed(lambda: (publisher.put(payload), subscriber.recv()), count)
            publisher.put(b"")
            return answer


def _zenoh_far_end(port: int) -> None:
    import zenoh

    with zenoh.open(_zenoh_config("connect", port)) as session:
        publisher = session.declare_publisher("pong", express=True)
        subscriber = session.declare_subscriber("ping", zenoh.handlers.FifoChannel(64))
        while payload := subscriber.recv().payload.to_bytes():
            publisher.put(payload)


def _zenoh_config(verb: str, port: int) -> object:
    import zenoh

    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5(f"{verb}/endpoints", f'["tcp/{HOST}:{port}"]')
    return config


def timed(round_trip: Callable[[], object], count: int) -> list[float]:
    """Return how long each of so many round trips took [s]."""
    times_s = []
    for _ in range(count):
        start_s = time.perf_counter()
        round_trip()
        times_s.append(time.perf_counter() - start_s)
    return times_s


class FarEnd:
    """Runs a far end in a process of its own meanwhile.

    Args:
        command: of the process.
        descriptors: that it inherits.
    """

    def __init__(self, command: Sequence[str], descriptors: Sequence[int] = ()) -> None:
        self._process = subprocess.Popen(command, pass_fds=tuple(descriptors))

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait()


def _far_end(kind: str, port: int) -> FarEnd:
    return FarEnd([sys.executable, __file__, kind, str(port)])


# Transports to compare with snr_sim's links; those whose package is installed.
ROUND_TRIPS: dict[str, Callable[[bytes, int], list[float]]] = {
    name: function
    for name, package, function in (
        ("bare TCP", "socket", tcp_round_trips_s),
        ("ZeroMQ", "zmq", zeromq_round_trips_s),
        ("Zenoh", "zenoh", zenoh_round_trips_s),
    )
    if importlib.util.find_spec(package) is not None
}

if __name__ == "__main__":
    {"tcp": _tcp_far_end, "zeromq": _zeromq_far_end, "zenoh": _zenoh_far_end}[sys.argv[1]](int(sys.argv[2]))
