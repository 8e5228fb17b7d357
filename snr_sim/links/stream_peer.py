"""StreamPeer: a remote peer at a byte stream: which thread sends, and in which order frames wait.

The node's thread never blocks. If no frame is queued, it tries to send a page itself (a system call that takes what
fits and returns), because that is quickest; otherwise the page is queued and the link's thread is woken.
"""

from __future__ import annotations

import errno
import heapq
import threading
from contextlib import suppress

from snr_sim.links.faults import LossyChannel
from snr_sim.links.link import Link
from snr_sim.links.peers import Peer
from snr_sim.links.restarting import error_text
from snr_sim.links.session import MAX_WAITING_BYTES, Session
from snr_sim.links.socket_port import SocketPort

WRITE_BYTES = 1 << 17  # minimum per system call, if so much waits


class Account:
    """Time spent lately on reading from a peer, or from several; see `Streams._in_turn`."""

    used_s: float = 0.0


class StreamPeer(Peer):
    """A remote peer at a port; `where` describes its address."""

    sent: int
    dropped: int

    def __init__(
        self, port: SocketPort, session: Session, link: Link, channel: LossyChannel | None, where: str, account: Account
    ) -> None:
        super().__init__(session, link.options, channel)
        self.where: str = where
        self.account: Account = account
        self.port: SocketPort = port
        self.descriptor: int = port.fileno()  # kept: a closed port has none, and `select` does not forget it by itself
        self.failure: str = ""  # error of the port, if any
        self.bug: Exception | None = None  # the exception, if our own code failed and not the port
        self.is_open: bool = True  # until its port is closed; only `Streams` sets it
        self.is_admitted: bool = False
        self.is_blocked: bool = False  # the port accepts nothing now
        self.unread_bytes: int = 0  # received since the last page
        self.watched: int = 0  # events that `select` waits for
        self.is_read_by_node: bool = False  # whether the node's thread reads it while it waits in its inbox
        self.leaves_s: float | None = None  # time limit for closing it, once the session is over
        self._link = link
        self._sending = threading.Lock()  # held for one call to the port, which does not block
        self._has_ended = False
        self._cut_off: bytes | memoryview = b""  # the rest of a frame that was sent in part
        self._control: list[bytes] = []
        self._delayed: list[tuple[float, int, bytes, bool]] = []
        self._count = 0

    def put(self, frame: bytes) -> None:
        """Send a page at once if no frame waits; otherwise queue it and wake the link's thread."""
        if self.channel is not None:
            self._delay(self.channel, frame, is_page=True)
            self._link.transport.wake()
            return
        with self._sending:
            is_first = not (self._control or len(self._cut_off) or self.queue.frames or self.failure)
            if is_first and self.port.is_shareable and self._link.has_few_tasks() and self._try(frame):
                return
            self.queue.put(frame)
        self._link.transport.wake()

    def _try(self, frame: bytes) -> bool:
        """Send what fits of a page, and keep the rest to be sent first; return whether the stream still works."""
        sealed, done = self.session.seal(frame), 0
        try:
            done = self.port.write(sealed)
        except BlockingIOError:
            pass  # a sealed frame counts as sent: no later frame may precede it
        except Exception as error:  # on the node's thread, which must continue whatever happens to this stream
            self.fail(error)
            return False
        self.sent += 1
        if done < len(sealed):
            self._cut_off = sealed[done:]
            self._link.transport.wake()
        return True

    def fail(self, error: Exception) -> None:
        """Record what broke the stream; only the first error is kept. The link's thread closes it."""
        if not self.failure:
            self.failure = error_text(error)
            self.bug = None if isinstance(error, OSError) else error

    def pump(self, now_s: float) -> None:
        """Send as much of the waiting frames as the port accepts; on the link's thread."""
        output = self.session.take_output()
        if self.channel is None:
            self._control += output
            if output and sum(map(len, self._control)) > MAX_WAITING_BYTES:
                self.fail(OSError(errno.ENOBUFS, "the other end does not read its answers."))
        else:
            for frame in output:
                self._delay(self.channel, frame, is_page=False)
            self._deliver_due(now_s)
        try:
            while self._write_some():
                pass
            self.is_blocked = False
        except BlockingIOError:
            self.is_blocked = True
        except OSError as error:
            self.fail(error)

    def _write_some(self) -> bool:
        """Write once; return whether there is more to write."""
        with self._sending:
            if not len(self._cut_off):
                if self._control:
                    frames, self._control = self._control, []
                else:
                    frames = self.queue.take(WRITE_BYTES)
                    self.sent += len(frames)
                if not frames:
                    return False
                self._cut_off = memoryview(b"".join(map(self.session.seal, frames)))
            self._cut_off = self._cut_off[self.port.write(self._cut_off) :]
            return bool(len(self._cut_off) or self._control or self.queue.frames)

    def end_writing(self) -> None:
        """Signal the end of the stream to the peer, once."""
        if not self._has_ended:
            self._has_ended = True
            with suppress(OSError):  # broken already, with the same result
                self.port.end_writing()

    @property
    def waiting(self) -> int:
        """Number of pages that wait to be sent, including those that faults delay."""
        with self._sending:
            return len(self.queue) + sum(is_page for _, _, _, is_page in self._delayed)

    @property
    def has_more(self) -> bool:
        """Whether something still waits to be sent."""
        return bool(self._control or self._delayed or self.queue.frames or len(self._cut_off))

    def needs_pump(self, now_s: float) -> bool:
        """Whether there is something to send, or to close."""
        if self.failure or self.has_more:
            return True
        return self.session.wants_attention if self.leaves_s is None else now_s >= self.leaves_s

    @property
    def due_s(self) -> float:
        """Time when the next delayed frame is due."""
        return self._delayed[0][0] if self._delayed else float("inf")

    def _delay(self, channel: LossyChannel, frame: bytes, is_page: bool) -> None:
        with self._sending:
            if is_page and len(self._delayed) >= self.queue.max_pages:
                self.dropped += 1
                return
            for arrival_s in channel.arrivals_s(len(frame), self._link.get_time_s(), is_page):
                self._count += 1
                heapq.heappush(self._delayed, (arrival_s, self._count, frame, is_page))

    def _deliver_due(self, now_s: float) -> None:
        with self._sending:
            while self._delayed and self._delayed[0][0] <= now_s:
                _, _, frame, is_page = heapq.heappop(self._delayed)
                if is_page:
                    self.queue.put(frame)
                else:
                    self._control.append(frame)
