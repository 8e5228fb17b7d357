"""A network in one thread: sockets, listeners, selectors and a clock for links, without ports and waiting.

As in a real one, a descriptor is the lowest free number, a selector keeps a descriptor that was closed without
unregistering it, `send` takes a part, `recv` returns a part, and a connection can break at any time.
"""

from __future__ import annotations

import errno
import functools
import heapq
import itertools
import os
import selectors
import socket
from collections import deque
from random import Random
from typing import Any

import pytest

from snr_sim.core import node
from snr_sim.core.clocks import WallClock
from snr_sim.core.loop import Loop
from snr_sim.core.node_life import NodeLife
from snr_sim.links import restarting, socket_port, tcp_client
from snr_sim.links.tcp_client import Connector

BUFFER_BYTES = 4096  # small, so that senders have to wait
SELECT_S = 1e-4  # duration of a call, so that a loop that spins makes time pass
HERE = "127.0.0.1"
READ, WRITE = selectors.EVENT_READ, selectors.EVENT_WRITE
READ_WRITE = READ | WRITE


strerror = functools.cache(os.strerror)


def failure(number: int) -> OSError:
    return OSError(number, strerror(number))


class Network:
    """Shared state of all sockets of one test: descriptors, time and randomness."""

    def __init__(self, seed: int) -> None:
        self.rng = Random(seed)
        self.nonces = Random(f"nonces {seed}")  # the choices of `rng` do not depend on how many there are
        self.now_s = 0.0
        self.open: dict[int, Any] = {}  # sockets by descriptor
        self.unused = itertools.count(3)  # descriptors that none had yet
        self.free: list[int] = []  # a heap of those that were closed: as in a kernel, a new one gets the lowest number
        self.listeners: dict[int, SimListener] = {}  # by port
        self.is_full = False  # `accept` finds no free descriptor
        self.max_wait_s = float("inf")  # maximum duration of a wait before the caller checks again

    def install(self, patch: pytest.MonkeyPatch) -> None:
        """Replace the computer's network by this one for links."""
        patch.setattr(selectors, "DefaultSelector", lambda: SimSelector(self))
        patch.setattr(socket, "socketpair", self.pair)
        patch.setattr(socket_port, "listen", lambda host, port, who: SimListener(self, port))
        patch.setattr(tcp_client, "connect", self.connect)
        patch.setattr(Connector, "begin", Connector._connect)  # at once, without a thread
        patch.setattr(restarting, "Random", lambda: self.rng)
        patch.setattr(os, "urandom", self.nonces.randbytes)
        patch.setattr(node, "ThreadExecutor", StepExecutor)

    def pass_time(self, time_s: float) -> None:
        """Advance time, and with it what happens in the network by itself."""
        self.now_s += time_s

    def pair(self, is_accepted: bool = True) -> tuple[SimSocket, SimSocket]:
        one, other = SimSocket(self), SimSocket(self, is_accepted)
        one.far, other.far = other, one
        return one, other

    def connect(self, host: str, port: int, address: str = HERE) -> SimSocket:
        """Return a connected socket, as `tcp_client.connect` does."""
        near = self.connect_if_possible(port, address)
        if near is None:
            raise failure(errno.ECONNREFUSED)
        return near

    def connect_if_possible(self, port: int, address: str) -> SimSocket | None:
        """Return a connected socket; None if the connection is refused."""
        listener = self.listeners.get(port)
        if listener is None or len(listener.waiting) >= 128:
            return None
        near, far = self.pair(is_accepted=False)  # it gets a descriptor when it is accepted
        listener.waiting.append((far, (address, 40000)))
        return near


class Descriptor:
    """An object with a descriptor until it is closed."""

    def __init__(self, network: Network, is_open: bool = True) -> None:
        self.network = network
        self.descriptor = -1
        if is_open:
            self.acquire()

    def acquire(self) -> None:
        network = self.network
        self.descriptor = heapq.heappop(network.free) if network.free else next(network.unused)
        network.open[self.descriptor] = self

    def release(self) -> None:
        if self.descriptor >= 0:
            del self.network.open[self.descriptor]
            heapq.heappush(self.network.free, self.descriptor)
            self.descriptor = -1

    def fileno(self) -> int:
        return self.descriptor

    def setblocking(self, is_blocking: bool) -> None:
        assert not is_blocking

    def setsockopt(self, *args: int) -> None:
        pass


class SimSocket(Descriptor):
    """One end of a connection. `bug`, if set, is raised by its next calls: an error of our own code."""

    is_ended = False  # the other end sends no more
    is_reset = False
    bug: Exception | None = None
    far: SimSocket | None = None

    def __init__(self, network: Network, is_open: bool = True) -> None:
        super().__init__(network, is_open)
        self.come = bytearray()

    @property
    def ready(self) -> int:
        far = self.far
        if far is None or self.is_reset:
            return READ_WRITE
        is_writable = len(far.come) < BUFFER_BYTES
        if self.come or self.is_ended:
            return READ_WRITE if is_writable else READ
        return WRITE if is_writable else 0

    def part(self, max_bytes: int) -> int:
        rng = self.network.rng
        return max_bytes if rng.random() < 0.6 else rng.randint(1, max_bytes)

    def check(self) -> None:
        if self.bug is not None:
            raise self.bug
        if self.descriptor < 0:
            raise failure(errno.EBADF)

    def recv(self, max_bytes: int) -> bytes:
        if self.bug is not None or self.descriptor < 0:
            self.check()
        come = self.come
        if come:
            data = bytes(come[: self.part(min(max_bytes, len(come)))])
            del come[: len(data)]
            return data
        if self.is_reset:
            raise failure(errno.ECONNRESET)
        if self.is_ended or self.far is None:
            return b""
        raise BlockingIOError

    def send(self, data: bytes | memoryview) -> int:
        if self.bug is not None or self.descriptor < 0:
            self.check()
        far = self.far
        if far is None or self.is_reset:
            raise failure(self.network.rng.choice((errno.ECONNRESET, errno.EPIPE)))
        room, size = BUFFER_BYTES - len(far.come), len(data)
        if room <= 0:
            raise BlockingIOError
        done = self.part(size if size < room else room)
        far.come += data if done == size else data[:done]
        return done

    def shutdown(self, how: int) -> None:
        self.check()
        if self.far is None or self.is_reset:
            raise failure(errno.ENOTCONN)
        self.far.is_ended = True

    def close(self) -> None:
        """Close it: the other end reads to the end, or is reset if data was left unread here."""
        if self.bug is not None:
            self.bug, bug = None, self.bug
            self.close()
            raise bug
        far = self.far
        if far is not None:
            far.is_ended = True
            if self.come:
                far.is_reset = True
            far.far = self.far = None
        self.release()

    def cut(self) -> None:
        """Cut the connection without notice to either end: nothing arrives any more."""
        for sock in (self, self.far):
            if sock is not None:
                sock.far = SimSocket(self.network, is_open=False)
                sock.far.far = sock

    def reset(self) -> None:
        """Close it with a reset."""
        if self.far is not None:
            self.far.is_reset = True
        self.close()


class SimListener(Descriptor):
    """A listening socket."""

    def __init__(self, network: Network, port: int) -> None:
        super().__init__(network)
        self.port = port or 9120
        self.waiting: deque[tuple[SimSocket, tuple[str, int]]] = deque()
        network.listeners[self.port] = self

    @property
    def ready(self) -> int:
        return READ if self.waiting else 0

    def getsockname(self) -> tuple[str, int]:
        return HERE, self.port

    def accept(self) -> tuple[SimSocket, tuple[str, int]]:
        if self.network.is_full:
            raise failure(errno.EMFILE)
        if not self.waiting:
            raise BlockingIOError
        sock, address = self.waiting.popleft()
        if self.network.rng.random() < 0.02:
            sock.reset()
            raise failure(errno.ECONNABORTED)
        sock.acquire()
        return sock, address

    def close(self) -> None:
        for sock, _ in self.waiting:
            sock.reset()
        self.waiting.clear()
        self.network.listeners.pop(self.port, None)
        self.release()


class SimSelector(selectors.SelectSelector):
    """Returns all that is ready, in random order; if nothing is, time advances at once."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network
        self.bug: Exception | None = None
        # The kernel's view, by descriptor: a registration is of a socket, not of a number.
        self.known: dict[int, tuple[selectors.SelectorKey, Any, int]] = {}

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        key = super().register(fileobj, events, data)
        if key.fd not in self.network.open:
            super().unregister(fileobj)
            raise failure(errno.EBADF)
        self.known[key.fd] = (key, self.network.open[key.fd], key.events)
        return key

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        key = super().unregister(fileobj)
        del self.known[key.fd]
        return key

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if self.bug is not None:
            raise self.bug
        network = self.network
        open_now = network.open
        ready = [
            (key, events)
            for descriptor, (key, sock, requested) in self.known.items()
            if open_now.get(descriptor) is sock and (events := requested & sock.ready)
        ]
        if len(ready) > 1:
            network.rng.shuffle(ready)
        network.pass_time(SELECT_S if ready or not timeout else max(SELECT_S, min(timeout, network.max_wait_s)))
        return ready


class SimTime(WallClock):
    """The network's clock, as a real-time clock, so that nodes under it use real links and not simulated ones."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def now_s(self) -> float:
        return self.network.now_s


class StepExecutor:
    """Calls a loop when the test requests it, instead of a thread."""

    setup_timeout_s = 0.0

    def __init__(self, loop: Loop, life: NodeLife) -> None:
        self.loop, self.life = loop, life
        self.is_stopped = self.is_halted = False
        self.ticks = 0
        self.late_s = 0.0

    def start(self) -> None:
        self.life.call_loop(self.loop, "setup")

    def step(self) -> None:
        due_s = self.loop.next_tick_at_s
        if not self.is_stopped and (due_s is None or self.loop.get_time_s() >= due_s):
            self.ticks += 1
            self.life.call_loop(self.loop, "loop")

    def wake(self) -> None:
        pass

    def stop(self) -> None:
        self.is_stopped = True

    def join(self) -> None:
        self.stop()
        if not self.is_halted:
            self.is_halted = True
            self.loop.halt()
