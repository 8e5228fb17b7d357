"""ZenohTransport: connects one node to a ZenohNet. The only module that imports `zenoh`.

What Zenoh sees of each node, at its address in the net (see fleet.py):

    <place>/alive        a liveliness token, which Zenoh removes when the node ends in any way
    <place>/page/<key>   its pages, exactly as Page.serialize writes them, with a sequence number attached
    <place>/ping         replies with its time to each query; a query contains the name of its sender

Zenoh runs callbacks on its own threads. The callbacks only store what arrives, in bounded queues; the link's thread
does the rest, including calls that may block: sending. When a node joins late, every node publishes its newest page of
each key again, in order with the others; receivers ignore sequence numbers that they already have, and derive from
them what was lost.
"""

from __future__ import annotations

import atexit
import heapq
import json
import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

from snr_sim.links.faults import LossyChannel
from snr_sim.links.fleet import ALONE, PING_BYTES, Fleet, Member, RemotePeer, Subscription, encode_key_part
from snr_sim.links.link import Link
from snr_sim.links.messages import decode_page
from snr_sim.links.queues import FairQueue, SendQueue
from snr_sim.links.restarting import BackOff
from snr_sim.prelude.errors import LinkError, MissingExtraError, SnrError
from snr_sim.prelude.task import DataKey
from snr_sim.prelude.waiting import WakeUp

HOUSEKEEPING_PERIOD_S = 0.05
MAX_TIME_BYTES = 32  # maximum length of the reply to a ping
PAUSED_POLL_PERIOD_S = 0.002  # period at which a paused link checks whether the node has caught up
# A newcomer's token can arrive before Zenoh routes pages to it. What is put in between is lost: 4 of 80 first pages
# never arrived while both cores were busy.
RESEND_S = 0.5
LINGER_S = 0.3  # maximum time in which a closing link sends what waits
LEAVE_S = 5.0  # maximum time that the end of the program waits for links that are still leaving
BATCH_BYTES = 1 << 17
MAX_ADDRESS_BYTES = 1 << 13
NUMBER_BYTES = 8


@dataclass(slots=True, eq=False)
class QueuedPage:
    """A page in transit. Its length is that of the serialised page."""

    key: DataKey
    raw: bytes  # as Page.serialize writes it
    peer: RemotePeer | None = None  # its sender; None is this node
    number: int = 0  # sequence number of the page for its key
    is_sent: bool = False  # to any node

    def __len__(self) -> int:
        return len(self.raw)


class ZenohCallbacks:
    """Make callbacks, and wait until the threads that Zenoh (1.10) starts for them have ended.

    Zenoh starts a Python thread for each callback, a daemon where the declaring thread is one, and ends it when the
    session closes or a query is over. `Session.close` does not wait for that. Up to Python 3.13, a daemon that takes
    Python's lock while the interpreter ends is unwound through Zenoh's Rust frames, which aborts the whole process
    ("FATAL: exception not rethrown"). So the end of the program has to wait for these threads first.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._open = 0  # callbacks whose thread has not begun to end
        self._ending: list[threading.Thread] = []

    def make(self, wrap: Callable[..., Any], callback: Callable[[Any], None]) -> Any:
        """Return `callback`, which handles what Zenoh delivers, as a handler; `wrap` is zenoh.handlers.Callback."""
        with self._changed:
            self._open += 1
        return wrap(callback, self._end)

    def _end(self) -> None:
        """Record that this thread ends; Zenoh calls it there, after the last call of the callback."""
        with self._changed:
            self._open -= 1
            self._ending = [thread for thread in self._ending if thread.is_alive()]
            self._ending.append(threading.current_thread())
            self._changed.notify_all()

    def wait(self, timeout_s: float) -> bool:
        """Wait until all threads have ended, at most `timeout_s`, and return whether they have."""
        until_s = time.monotonic() + timeout_s
        with self._changed:
            if not self._changed.wait_for(lambda: self._open == 0, timeout_s):
                return False
            ending = list(self._ending)
        for thread in ending:
            thread.join(max(0.0, until_s - time.monotonic()))
        return not any(thread.is_alive() for thread in ending)


class ZenohTransport(Fleet):
    """Sends and receives pages over Zenoh. `waits_for` names what it connects to; it is empty if this end listens."""

    def __init__(
        self, link: Link, member: Member, subscription: Subscription, config: dict[str, Any], waits_for: str
    ) -> None:
        super().__init__(link, member, subscription)
        options, node = link.options, link.parent
        self._waits_for = waits_for
        if waits_for:
            link.reason = f"waits for {waits_for}."
        self._settings = config
        self._session: Any = None
        self._callbacks = ZenohCallbacks()
        self._has_joined = False
        self._back_off = BackOff()
        self._try_s = 0.0
        self._resend_s = math.inf  # moment at which the newest pages are sent to a newcomer a second time
        self._outbox: SendQueue[QueuedPage] = SendQueue(options.queue_pages, options.policy)
        self._inbox: FairQueue[QueuedPage] = FairQueue(options.queue_pages, options.policy)
        self._queue_lock = threading.Lock()  # held briefly: guards both queues above and the delayed pages below
        self._newest: dict[DataKey, QueuedPage] = {}
        self._publishers: dict[DataKey, Any] = {}
        self._channel = (
            None if options.faults is None else LossyChannel(options.faults, node.seed, f"link:{link.name}:{node.role}")
        )
        self._delayed: list[tuple[float, int, Callable[[], None]]] = []  # delayed by faults, ordered by arrival time
        self._count = 0
        self._wake_up = WakeUp()
        self._is_woken = False
        self._housekeep_s = 0.0

    def open(self, ports: ExitStack) -> None:
        """Open a session if this end listens; see Transport."""
        ports.callback(self._shut)
        self._zenoh = zenoh = _zenoh()
        self._config = zenoh.Config()
        for name, value in self._settings.items():
            self._config.insert_json5(name, json.dumps(value))
        if self._waits_for:
            return  # connecting may block, so it is done on the link's thread
        try:
            self._session = zenoh.open(self._config)
        except zenoh.ZError as error:
            raise LinkError(
                f"The net '{self.link.options.name}' cannot be opened: {_describe_error(error)}",
                fix="is another program listening there, and is it an address of this machine?",
            ) from error

    def _connect(self) -> None:
        """Try to connect; on the link's thread, which may block here."""
        try:
            session = self._zenoh.open(self._config)
        except self._zenoh.ZError as error:
            self.link.reason = f"waits for {self._waits_for}: {_describe_error(error)}"
            self._try_s = self.now_s() + self._back_off.next_s()
            return
        if self.link.is_terminated():
            session.close()
            return
        self._session = session

    def _join_net(self) -> None:
        """Subscribe first and declare the liveliness token last, so that a node seen by others can already receive."""
        session, accept, robots = self._session, self.link.options.accept, self.subscription.robots
        prefix = self.peer_table.prefix
        self.peer_table.own_address = address = self.peer_table.address_of(self.member, str(session.zid()))
        self.link.reason = ALONE
        remote = self._zenoh.Locality.REMOTE
        for robot in ["*"] if robots is None else [encode_key_part(robot) for robot in sorted(robots)]:
            for key in ["*"] if accept is None else [encode_key_part(key) for key in sorted(accept)]:
                session.declare_subscriber(
                    f"{prefix}/{robot}/*/*/page/{key}", self._background(self._on_sample), allowed_origin=remote
                )
        session.declare_queryable(f"{address}/ping", self._background(self._on_query), allowed_origin=remote)
        alive = session.liveliness()
        alive.declare_subscriber(f"{prefix}/*/*/*/alive", self._background(self._on_liveliness), history=True)
        self._token = alive.declare_token(f"{address}/alive")
        self._has_joined = True

    def _background(self, callback: Callable[[Any], None]) -> Any:
        return self._callbacks.make(self._zenoh.handlers.Callback, callback)

    # On Zenoh's threads. None of these may raise: Zenoh would only print the exception.

    def _on_sample(self, sample: Any) -> None:
        """Queue an arriving page for the link's thread, if its address, size and sequence number are acceptable."""
        address, _, key = str(sample.key_expr).rpartition("/page/")
        size_bytes = len(sample.payload)
        attached = b"" if sample.attachment is None else sample.attachment.to_bytes()[: NUMBER_BYTES + 1]
        number = int.from_bytes(attached, "big") if len(attached) == NUMBER_BYTES else 0
        raw = sample.payload.to_bytes() if size_bytes <= self.link.options.max_frame_bytes else b""
        peer, is_new = self.peer_table.record_page(address, key, number, self.now_s())
        if peer is None or not raw:
            self.link.rejected += 1
        elif is_new:
            with self._queue_lock:
                self._inbox.put(peer, QueuedPage(key, raw, peer))
            self.wake()

    def _on_liveliness(self, sample: Any) -> None:
        """Record that a node joined or left."""
        address = str(sample.key_expr).removesuffix("/alive")
        if sample.kind == self._zenoh.SampleKind.DELETE:
            self.peer_table.record_leave(address)
        else:
            self.peer_table.mark_present(address, self.now_s(), joins=True)
        self._housekeep_s = 0.0
        self.wake()

    def _on_query(self, query: Any) -> None:
        """Answer the ping of another node."""
        if query.payload is not None and len(query.payload) <= MAX_ADDRESS_BYTES:
            self.peer_table.mark_present(query.payload.to_bytes().decode(errors="replace"), self.now_s())
        self._delay(PING_BYTES, lambda: self._answer(query), is_page=False)

    def _answer(self, query: Any) -> None:
        with suppress(self._zenoh.ZError):  # the node that asked has left
            query.reply(f"{self.peer_table.own_address}/ping", repr(self.now_s()).encode())

    def _on_reply(self, asked_s: float, reply: Any) -> None:
        if reply.ok is None:
            return
        now_s = self.now_s()
        peer = self.peer_table.mark_present(str(reply.ok.key_expr).removesuffix("/ping"), now_s)
        if peer is not None:
            peer.rtt_s = max(0.0, now_s - asked_s)
            their_s = _time_in(reply.ok.payload)
            if their_s is not None:
                peer.note_offset(now_s - their_s)

    # On the node's thread

    def send(self, key: DataKey, raw: bytes) -> None:
        """Send a page to all others; see Fleet."""
        queued = QueuedPage(key, raw)
        self._delay(len(raw), lambda: self._enqueue(queued), is_page=True)

    def _enqueue(self, queued: QueuedPage) -> None:
        with self._queue_lock:
            self._outbox.put(queued)
        self.wake()

    # From any thread

    def _delay(self, size_bytes: int, arrive: Callable[[], None], is_page: bool) -> None:
        """Call `arrive` when what this link sends arrives: at once, unless there are faults."""
        if self._channel is None:
            arrive()
            return
        with self._queue_lock:
            if len(self._delayed) >= self._outbox.max_pages:
                self.link.dropped += is_page
                return
            for arrival_s in self._channel.arrivals_s(size_bytes, self.now_s(), is_page):
                self._count += 1
                heapq.heappush(self._delayed, (arrival_s, self._count, arrive))
        self.wake()

    def wake(self) -> None:
        """Wake the link's thread; see Transport."""
        if not self._is_woken:
            self._is_woken = True
            self._wake_up.wake()

    # On the link's thread

    def round(self) -> None:
        """Wait until there is work, and do it."""
        due_s = min(self._housekeep_s, self._delayed[0][0]) if self._delayed else self._housekeep_s
        wait_s = PAUSED_POLL_PERIOD_S if self.link.is_paused else due_s - self.now_s()
        if wait_s > 0:
            self._wake_up.wait(wait_s)
        self._is_woken = False  # before the work, so that what arrives during it wakes the thread again
        now_s = self.now_s()
        if self._session is None and now_s >= self._try_s:
            self._connect()
        if self._session is not None and not self._has_joined:
            self._join_net()
        self._deliver_due()
        self._receive_pages()
        self._send_pages()
        self._housekeep(self.now_s())

    def _deliver_due(self) -> None:
        now_s = self.now_s()
        while self._delayed and self._delayed[0][0] <= now_s:
            with self._queue_lock:
                _, _, arrive = heapq.heappop(self._delayed)
            arrive()

    def _receive_pages(self) -> None:
        while not self.link.check_back_pressure():
            with self._queue_lock:
                batch = self._inbox.take(BATCH_BYTES)
            if not batch:
                return
            for queued in batch:
                self._read(queued)

    def _read(self, queued: QueuedPage) -> None:
        peer = queued.peer
        assert peer is not None
        try:
            page = decode_page(queued.raw)
        except (SnrError, ValueError, RecursionError, MemoryError, OverflowError):
            page = None
        if page is None or encode_key_part(page.key) != queued.key:
            self.link.rejected += 1
            return
        self.link.note_size(len(queued))
        peer.received += 1
        self.accept_page(peer.member, page, queued.raw, peer)

    def _send_pages(self) -> None:
        """Send what waits; block as long as a remote node does not read."""
        has_receivers = bool(self.peer_table.present())
        if self.peer_table.consume_new_peer_flag():
            self._resend_s = self.now_s() + RESEND_S
            self._send_newest(has_receivers)
        while True:
            with self._queue_lock:
                batch = self._outbox.take(BATCH_BYTES)
            if not batch:
                return
            for queued in batch:
                last = self._newest.pop(queued.key, None)  # removed first, so that the dict keeps the order of storing
                if last is not None and not last.is_sent:
                    self.link.dropped += 1
                queued.number = last.number + 1 if last is not None else 1
                self._newest[queued.key] = queued
                self._put(queued, has_receivers)

    def _send_newest(self, has_receivers: bool) -> None:
        """Send the newest page of each key again; receivers ignore numbers that they have."""
        for queued in list(self._newest.values()):
            self._put(queued, has_receivers)

    def _put(self, queued: QueuedPage, has_receivers: bool) -> None:
        if self._session is None:
            return
        if has_receivers and not queued.is_sent:
            queued.is_sent = True
            self.link.sent += 1
        publisher = self._publishers.get(queued.key)
        if publisher is None:
            publisher = self._publishers[queued.key] = self._session.declare_publisher(
                f"{self.peer_table.own_address}/page/{encode_key_part(queued.key)}",
                encoding=self._zenoh.Encoding.APPLICATION_JSON,
                # Not BLOCK: with it, one node that does not read can stop Zenoh's routing for all (1.10).
                congestion_control=self._zenoh.CongestionControl.DROP,
                allowed_destination=self._zenoh.Locality.REMOTE,
            )
        publisher.put(queued.raw, attachment=queued.number.to_bytes(NUMBER_BYTES, "big"))

    def _housekeep(self, now_s: float) -> None:
        """Do periodic work: pings and reports."""
        if now_s < self._housekeep_s:
            return
        self._housekeep_s = now_s + HOUSEKEEPING_PERIOD_S
        if now_s >= self._ping_s:
            self._ping_s = now_s + self.link.options.keep_alive_s
            self._delay(PING_BYTES, lambda: self._ping_all(now_s), is_page=False)
        if now_s >= self._resend_s:
            self._resend_s = math.inf
            self._send_newest(bool(self.peer_table.present()))
        self.link.report(now_s)

    def _ping_all(self, now_s: float) -> None:
        """Ping all other nodes."""
        if self._session is None:
            return
        self._session.get(
            f"{self.peer_table.prefix}/*/*/*/ping",
            self._background(lambda reply: self._on_reply(now_s, reply)),
            target=self._zenoh.QueryTarget.ALL,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            timeout=self.link.options.timeout_s,
            payload=self.peer_table.own_address,
            congestion_control=self._zenoh.CongestionControl.DROP,
            allowed_destination=self._zenoh.Locality.REMOTE,
        )

    @property
    def dropped(self) -> int:
        """Number of pages known not to have arrived; those of others by their sequence numbers."""
        lost = 0 if self._channel is None else self._channel.lost
        return self.link.dropped + self._outbox.dropped + self._inbox.dropped + self.peer_table.missed + lost

    def state_of(self, peer: RemotePeer, now_s: float) -> dict[str, Any]:
        """Return the state of another node; see Fleet."""
        more = {"clock_offset_s": peer.clock_offset_s, "dropped": peer.missed, "received": peer.received}
        return {**super().state_of(peer, now_s), **more}

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        return {**super().state(now_s), "failures": self.link.failures}

    def drain_and_close(self) -> None:
        """Send what waits, and leave; see Transport."""
        self._leave(self._send_pages)

    def _shut(self) -> None:
        if not self.link.is_shut:
            return  # at the end of the program: the link has left already, and may still be sending
        self._leave(lambda: None)
        self._session, self._has_joined = None, False
        self._callbacks = ZenohCallbacks()
        self._publishers.clear()
        self.peer_table.mark_all_gone()

    def _leave(self, send_last: Callable[[], None]) -> None:
        """Leave on a separate thread and wait at most `LINGER_S`: calls into Zenoh may block."""
        session, callbacks = self._session, self._callbacks
        if session is None:
            return

        def leave() -> None:
            with suppress(self._zenoh.ZError):
                send_last()
            session.close()
            callbacks.wait(LEAVE_S)

        leaving = threading.Thread(target=leave, name=f"{self.link.name} leaves", daemon=True)
        leaving.start()
        leaving.join(LINGER_S)
        if leaving.is_alive():  # Python aborts if it ends while a thread is inside Zenoh
            atexit.register(leaving.join, LEAVE_S)


def _time_in(payload: Any) -> float | None:
    """Return the time in a reply to a ping, or None if it is invalid."""
    try:
        time_s = float(payload.to_bytes()[:MAX_TIME_BYTES])
    except ValueError:
        return None
    return time_s if math.isfinite(time_s) else None


def _describe_error(error: Exception) -> str:
    """Return Zenoh's message without the location in Zenoh's source."""
    return str(error).partition(" at /")[0].strip()


def _zenoh() -> Any:
    try:
        import zenoh
    except ImportError:
        raise MissingExtraError("eclipse-zenoh", "zenoh") from None
    return zenoh
