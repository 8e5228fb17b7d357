"""Programs that attack a link's server, one per KIND: `python attackers.py KIND PORT`. Each runs until it is killed.

All connect from 127.0.0.1, as the honest pilot does. Those with the secret complete the greeting and become peers.
"""

from __future__ import annotations

import random
import select
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress

from snr_sim import Page
from snr_sim.links.frames import MAX_FRAME_BYTES, encode_frame
from snr_sim.links.messages import PROTOCOL, VERSION, Auth, HelloMessage, Ping, encode_message
from snr_sim.links.session import Session, SessionConfig

HERE = "127.0.0.1"
SECRET = b"a secret of 16 bytes or more"
PORT = 0
GREETED_S = 20.0  # maximum duration of a greeting
RNG = random.Random(1)


def page(key: str, data: object = 1) -> bytes:
    return Page(key, data, "attacker", 0.0).serialize()


def large_page(key: str, item: bytes = b"{}") -> bytes:
    """Return a page of the maximum frame size with many small values, which takes long to decode."""
    begin, end = page(key, []).split(b"[]")
    count = (MAX_FRAME_BYTES - len(begin) - len(end) - 2) // (len(item) + 1)
    return begin + b"[" + b",".join([item] * count) + b"]" + end


def connect() -> socket.socket:
    sock = socket.create_connection((HERE, PORT), GREETED_S)
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return sock


def reset(sock: socket.socket) -> None:
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    sock.close()


class Far:
    """A peer that greets as a node does, and then sends what no node would."""

    def __init__(self, secret: bytes = SECRET, node: str = "attacker") -> None:
        self.sock = connect()
        self.session = Session(SessionConfig(node, is_server=False, secret=secret), time.monotonic())
        self.rest = b""  # frames that are not sent yet
        self.greeting = b""  # all data sent until the session was up
        self.is_reading = True

    def greet(self) -> Far:
        """Complete the greeting and return self; raise ConnectionError if the session is closed."""
        give_up_s = time.monotonic() + GREETED_S
        while not self.session.is_up:
            self.rest += b"".join(map(self.session.seal, self.session.take_output()))
            self.greeting += self.rest
            self.push()
            select.select([self.sock], [], [], 0.1)
            self.pull()
            if self.session.is_closed or time.monotonic() > give_up_s:
                self.close()
                raise ConnectionError(self.session.reason)
        self.rest += b"".join(map(self.session.seal, self.session.take_output()))
        return self

    def send(self, payloads: Iterable[bytes]) -> None:
        """Queue payloads, each in a frame."""
        self.rest += b"".join(map(self.session.seal, [*self.session.take_output(), *map(encode_frame, payloads)]))

    def push(self) -> bool:
        """Send what fits; return whether any byte was sent."""
        with suppress(BlockingIOError):
            done = self.sock.send(self.rest) if self.rest else 0
            self.rest = self.rest[done:]
            return done > 0
        return False

    def pull(self) -> None:
        """Read what has arrived."""
        with suppress(BlockingIOError):
            data = self.sock.recv(1 << 16)
            if not data:
                raise ConnectionError("closed by the server")
            self.session.receive(data, time.monotonic())

    def keep_alive(self) -> None:
        """Do what an honest peer does, too: read, and keep the session alive."""
        if self.is_reading:
            self.pull()
            self.session.tick(time.monotonic())
            self.rest += b"".join(map(self.session.seal, self.session.take_output()))

    def close(self) -> None:
        self.sock.close()


def peers(
    count: int, act: Callable[[Far], None], pause_s: float = 0.0, reads: bool = True, node: str = "attacker"
) -> None:
    """Run peers with the secret that act each time their queue is sent, and reconnect when closed."""
    fars: list[Far] = []
    while True:
        while len(fars) < count:
            with suppress(OSError):
                fars.append(Far(node=node).greet())
                fars[-1].is_reading = reads
        is_moving = False
        for far in list(fars):
            try:
                far.keep_alive()
                if not far.rest:
                    act(far)
                is_moving = far.push() or is_moving
            except OSError:
                far.close()
                fars.remove(far)
        if pause_s or not is_moving:
            time.sleep(pause_s or 0.001)


def flood(key: str, count: int, node: str = "attacker") -> None:
    pages = [page(key, i) for i in range(200)]
    peers(count, lambda far: far.send(pages), node=node)


def byte_by_byte() -> None:
    frame = page("other")

    def act(far: Far) -> None:
        far.send([frame])
        far.rest, rest = far.rest[:1], far.rest[1:]
        for byte in rest:
            with suppress(BlockingIOError):
                while not far.push():
                    pass
            far.rest = bytes([byte])

    peers(20, act)


def all_at_once() -> None:
    """Complete the longest frames of many peers at once."""
    fars = [Far().greet() for _ in range(40)]
    data = large_page("nothing")
    while True:
        for far in fars:
            far.send([data])
        while any(len(far.rest) > 1 for far in fars):
            for far in fars:
                with suppress(BlockingIOError):
                    far.rest = far.rest[far.sock.send(memoryview(far.rest)[:-1]) :]
                far.pull()
            time.sleep(0.001)
        for far in fars:
            far.push()


def newcomers(act: Callable[[socket.socket], None], kept: int = 0, pause_s: float = 0.0) -> None:
    """Connect and act, repeatedly; keep so many connections open."""
    held: list[socket.socket] = []
    while True:
        try:
            sock = connect()
        except OSError:
            time.sleep(0.01)
            continue
        with suppress(OSError):
            act(sock)
        held.append(sock)
        if len(held) > kept:
            held.pop(0).close()
        if pause_s:
            time.sleep(pause_s)


def half_open() -> None:
    hello = encode_frame(encode_message(HelloMessage(PROTOCOL, VERSION, "x", "0" * 32, "pages", True, 1 << 20)))
    newcomers(lambda sock: sock.sendall(RNG.choice((b"", hello[:20], hello))), kept=300, pause_s=0.001)


def drip() -> None:
    """Send greetings byte by byte over many connections."""
    hello = encode_frame(encode_message(HelloMessage(PROTOCOL, VERSION, "x", "0" * 32, "pages", True, 1 << 20)))
    held: list[list] = []
    while True:
        while len(held) < 100:
            held.append([connect(), 0])
        for one in list(held):
            try:
                one[0].send(hello[one[1] : one[1] + 1])
                one[1] += 1
            except OSError:
                one[0].close()
                held.remove(one)
        time.sleep(0.005)


def wrong_secret() -> None:
    while True:
        with suppress(OSError):
            Far(b"another secret of 16 bytes").greet()


def replay() -> None:
    """Send a recorded greeting of an honest client, repeatedly."""
    honest = Far().greet()
    newcomers(lambda sock: sock.sendall(honest.greeting), kept=50)


def come_and_go() -> None:
    """Connect with the secret and disconnect, repeatedly."""
    while True:
        with suppress(OSError):
            far = Far(node=f"attacker{RNG.randrange(1000)}").greet()
            far.push()
            RNG.choice((far.close, lambda far=far: reset(far.sock)))()


NESTED = b'{"$":"page","key":"x","origin":"a","created_at_s":0,"data":' + b"[" * 99_999 + b"]" * 99_999 + b"}"
PINGS = [encode_message(Ping(1.0))] * 500
KINDS: dict[str, Callable[[], None]] = {
    "nothing": lambda: time.sleep(1e6),
    "flood of pages of a key that is not accepted": lambda: flood("nothing", 1),
    "the same from 20 peers": lambda: flood("nothing", 20),
    "flood of accepted pages": lambda: flood("other", 1),
    "the same from 60 peers": lambda: flood("other", 60),
    "flood in the pilot's name": lambda: flood("stick2", 4, node="pilot"),
    "the longest frames": lambda: peers(4, lambda far: far.send([large_page("nothing")])),
    "the longest frames of an accepted key": lambda: peers(4, lambda far: far.send([large_page("other", b"1.5")])),
    "the longest frames of 40 peers at once": all_at_once,
    "senders byte by byte": byte_by_byte,
    "slow readers": lambda: peers(20, lambda far: None, pause_s=0.01, reads=False),
    "pings whose answers are not read": lambda: peers(4, lambda far: far.send(PINGS), reads=False),
    "many peers, each within its budget": lambda: peers(60, lambda far: far.send([page("other")]), pause_s=0.02),
    "nonsense pages": lambda: peers(4, lambda far: far.send([b"[1, 2, 3]"])),
    "deeply nested pages": lambda: peers(4, lambda far: far.send([NESTED])),
    "announced lengths of 4 GB": lambda: peers(4, lambda far: setattr(far, "rest", b"\xff\xff\xff\xff")),
    "messages out of turn": lambda: peers(4, lambda far: far.send([encode_message(Auth("0" * 64))])),
    "coming and going with the secret": come_and_go,
    "half-open connections": half_open,
    "greetings byte by byte": drip,
    "storm of connections": lambda: newcomers(lambda sock: None),
    "storm of connections that are reset": lambda: newcomers(reset),
    "wrong secrets": wrong_secret,
    "replayed greetings": replay,
    "random bytes": lambda: newcomers(lambda sock: sock.sendall(RNG.randbytes(RNG.randrange(1, 2000)))),
}


def main() -> None:
    """Print that the attack starts, and attack."""
    global PORT
    PORT = int(sys.argv[2])
    print("begins", flush=True)
    KINDS[sys.argv[1]]()


if __name__ == "__main__":
    main()
