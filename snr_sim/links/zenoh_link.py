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
from queue import Empty, SimpleQueue
from typing import Any

from snr_sim.links.back_off import BackOff
from snr_sim.links.faults import Way
from snr_sim.links.fleet import ALONE, PING_BYTES, Far, Fleet, Hearing, Member, encoded
from snr_sim.links.link import Link
from snr_sim.links.send_queue import SendQueue
from snr_sim.links.wire_bounds import decode_page
from snr_sim.prelude.errors import LinkError, MissingExtra, SnrError
from snr_sim.prelude.page import DataKey

TEND_EVERY_S = 0.05
MAX_TIME_BYTES = 32  # maximum length of the reply to a ping
DEAF_LOOK_S = 0.002  # period at which a paused link checks whether the node has caught up
# A newcomer's token can arrive before Zenoh routes pages to it. What is put in between is lost: 4 of 80 first pages
# never arrived while both cores were busy.
RESEND_S = 0.5
LINGER_S = 0.3  # maximum time in which a closing link sends what waits
LEAVE_S = 5.0  # maximum time that the end of the program waits for links that are still leaving
BATCH_BYTES = 1 << 17
MAX_PLACE_BYTES = 1 << 13
NUMBER_BYTES = 8


@dataclass(slots=True, eq=False)
class Letter:
    """A page in transit. Its length is that of the serialised page.

    Args:
        key: key of the page.
        raw: the page, as Page.serialize writes it.
        far: its sender; None is this node.
        number: sequence number of the page for its key.
        is_sent: whether it was sent to any node.
    """

    key: DataKey
    raw: bytes
    far: Far | None = None
    number: int = 0
    is_sent: bool = False

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
        """Return `callback` as a handler.

        Args:
            wrap: zenoh.handlers.Callback.
            callback: handles what Zenoh delivers.
        """
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
    """Sends and receives pages over Zenoh.

    Args:
        link, member, hearing: as of Fleet.
        config: Zenoh's configuration, by the names of its settings.
        waits_for: description of what it connects to, for messages; "" if it listens.
    """

    def __init__(self, link: Link, member: Member, hearing: Hearing, config: dict[str, Any], waits_for: str) -> None:
        super().__init__(link, member, hearing)
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
        self._outbox: SendQueue[Letter] = SendQueue(options.queue_pages, options.policy)
        self._inbox: SendQueue[Letter] = SendQueue(options.queue_pages, options.policy)
        self._guard = threading.Lock()  # held briefly: guards both queues above and the delayed pages below
        self._newest: dict[DataKey, Letter] = {}
        self._publishers: dict[DataKey, Any] = {}
        self._way = None if options.faults is None else Way(options.faults, node.seed, f"link:{link.name}:{node.role}")
        self._delayed: list[tuple[float, int, Callable[[], None]]] = []  # delayed by faults, ordered by arrival time
        self._count = 0
        self._bell: SimpleQueue[None] = SimpleQueue()
        self._is_rung = False
        self._tend_s = 0.0

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
                f"The net '{self.link.options.name}' cannot be opened: {_in_words(error)}",
                fix="is another program listening there, and is it an address of this machine?",
            ) from error

    def _connect(self) -> None:
        """Try to connect; on the link's thread, which may block here."""
        try:
            session = self._zenoh.open(self._config)
        except self._zenoh.ZError as error:
            self.link.reason = f"waits for {self._waits_for}: {_in_words(error)}"
            self._try_s = self.now_s() + self._back_off.next_s()
            return
        if self.link.is_terminated():
            session.close()
            return
        self._session = session

    def _join_net(self) -> None:
        """Subscribe first and declare the liveliness token last, so that a node seen by others can already receive."""
        session, accept, robots = self._session, self.link.options.accept, self.hearing.robots
        prefix = self.roster.prefix
        self.roster.own_place = place = self.roster.place_of(self.member, str(session.zid()))
        self.link.reason = ALONE
        remote = self._zenoh.Locality.REMOTE
        for robot in ["*"] if robots is None else [encoded(robot) for robot in sorted(robots)]:
            for key in ["*"] if accept is None else [encoded(key) for key in sorted(accept)]:
                session.declare_subscriber(
                    f"{prefix}/{robot}/*/*/page/{key}", self._background(self._came), allowed_origin=remote
                )
        session.declare_queryable(f"{place}/ping", self._background(self._asked), allowed_origin=remote)
        alive = session.liveliness()
        alive.declare_subscriber(f"{prefix}/*/*/*/alive", self._background(self._seen), history=True)
        self._token = alive.declare_token(f"{place}/alive")
        self._has_joined = True

    def _background(self, callback: Callable[[Any], None]) -> Any:
        return self._callbacks.make(self._zenoh.handlers.Callback, callback)

    # On Zenoh's threads. None of these may raise: Zenoh would only print the exception.

    def _came(self, sample: Any) -> None:
        """Queue an arriving page for the link's thread, if its address, size and sequence number are acceptable."""
        place, _, key = str(sample.key_expr).rpartition("/page/")
        size_bytes = len(sample.payload)
        attached = b"" if sample.attachment is None else sample.attachment.to_bytes()[: NUMBER_BYTES + 1]
        number = int.from_bytes(attached, "big") if len(attached) == NUMBER_BYTES else 0
        raw = sample.payload.to_bytes() if size_bytes <= self.link.options.max_frame_bytes else b""
        far, is_new = self.roster.takes(place, key, number, self.now_s())
        if far is None or not raw:
            self.link.unwanted += 1
        elif is_new:
            with self._guard:
                self._inbox.put(Letter(key, raw, far))
            self.wake()

    def _seen(self, sample: Any) -> None:
        """Record that a node joined or left."""
        place = str(sample.key_expr).removesuffix("/alive")
        if sample.kind == self._zenoh.SampleKind.DELETE:
            self.roster.leaves(place)
        else:
            self.roster.shows(place, self.now_s())
        self._tend_soon()

    def _tend_soon(self) -> None:
        self._tend_s = 0.0
        self.wake()

    def _asked(self, query: Any) -> None:
        """Answer the ping of another node."""
        if query.payload is not None and len(query.payload) <= MAX_PLACE_BYTES:
            self.roster.hears(query.payload.to_bytes().decode(errors="replace"), self.now_s())
        self._put_on_the_way(PING_BYTES, lambda: self._answer(query), is_page=False)

    def _answer(self, query: Any) -> None:
        with suppress(self._zenoh.ZError):  # the node that asked has left
            query.reply(f"{self.roster.own_place}/ping", repr(self.now_s()).encode())

    def _answered(self, asked_s: float, reply: Any) -> None:
        if reply.ok is None:
            return
        now_s = self.now_s()
        far = self.roster.hears(str(reply.ok.key_expr).removesuffix("/ping"), now_s)
        if far is not None:
            far.rtt_s = max(0.0, now_s - asked_s)
            their_s = _time_in(reply.ok.payload)
            if their_s is not None:
                far.note_offset(now_s - their_s)

    # On the node's thread

    def send(self, key: DataKey, raw: bytes) -> None:
        """Send a page to all others; see Fleet."""
        letter = Letter(key, raw)
        self._put_on_the_way(len(raw), lambda: self._post(letter), is_page=True)

    def _post(self, letter: Letter) -> None:
        with self._guard:
            self._outbox.put(letter)
        self.wake()

    # From any thread

    def _put_on_the_way(self, size_bytes: int, arrive: Callable[[], None], is_page: bool) -> None:
        """Call `arrive` when what this link sends arrives: at once, unless there are faults."""
        if self._way is None:
            arrive()
            return
        with self._guard:
            if len(self._delayed) >= self._outbox.max_pages:
                self.link.dropped += is_page
                return
            for arrival_s in self._way.arrivals_s(size_bytes, self.now_s(), is_page):
                self._count += 1
                heapq.heappush(self._delayed, (arrival_s, self._count, arrive))
        self.wake()

    def wake(self) -> None:
        """Wake the link's thread; see Transport."""
        if not self._is_rung:
            self._is_rung = True
            self._bell.put(None)

    # On the link's thread

    def round(self) -> None:
        """Wait until there is work, and do it."""
        due_s = min(self._tend_s, self._delayed[0][0]) if self._delayed else self._tend_s
        wait_s = DEAF_LOOK_S if self.link.is_deaf else due_s - self.now_s()
        if wait_s > 0:
            with suppress(Empty):
                self._bell.get(timeout=wait_s)
        self._is_rung = False  # before the work, so that what arrives during it wakes the thread again
        now_s = self.now_s()
        if self._session is None and now_s >= self._try_s:
            self._connect()
        if self._session is not None and not self._has_joined:
            self._join_net()
        self._arrive()
        self._take_in()
        self._send_out()
        self._tend(self.now_s())

    def _arrive(self) -> None:
        now_s = self.now_s()
        while self._delayed and self._delayed[0][0] <= now_s:
            with self._guard:
                _, _, arrive = heapq.heappop(self._delayed)
            arrive()

    def _take_in(self) -> None:
        while not self.link.must_wait():
            with self._guard:
                letters = self._inbox.take(BATCH_BYTES)
            if not letters:
                return
            for letter in letters:
                self._read(letter)

    def _read(self, letter: Letter) -> None:
        far = letter.far
        assert far is not None
        try:
            page = decode_page(letter.raw)
        except (SnrError, ValueError, RecursionError, MemoryError, OverflowError):
            page = None
        if page is None or encoded(page.key) != letter.key:
            self.link.unwanted += 1
            return
        self.link.note_size(len(letter))
        far.received += 1
        self.let_in(far.member, page, far)

    def _send_out(self) -> None:
        """Send what waits; block as long as a remote node does not read."""
        is_heard = bool(self.roster.here())
        if self.roster.take_newcomer():
            self._resend_s = self.now_s() + RESEND_S
            self._send_newest(is_heard)
        while True:
            with self._guard:
                letters = self._outbox.take(BATCH_BYTES)
            if not letters:
                return
            for letter in letters:
                last = self._newest.pop(letter.key, None)  # removed first, so that the dict keeps the order of storing
                if last is not None and not last.is_sent:
                    self.link.dropped += 1
                letter.number = last.number + 1 if last is not None else 1
                self._newest[letter.key] = letter
                self._put(letter, is_heard)

    def _send_newest(self, is_heard: bool) -> None:
        """Send the newest page of each key again; receivers ignore numbers that they have."""
        for letter in list(self._newest.values()):
            self._put(letter, is_heard)

    def _put(self, letter: Letter, is_heard: bool) -> None:
        if self._session is None:
            return
        if is_heard and not letter.is_sent:
            letter.is_sent = True
            self.link.sent += 1
        publisher = self._publishers.get(letter.key)
        if publisher is None:
            publisher = self._publishers[letter.key] = self._session.declare_publisher(
                f"{self.roster.own_place}/page/{encoded(letter.key)}",
                encoding=self._zenoh.Encoding.APPLICATION_JSON,
                # Not BLOCK: with it, one node that does not read can stop Zenoh's routing for all (1.10).
                congestion_control=self._zenoh.CongestionControl.DROP,
                allowed_destination=self._zenoh.Locality.REMOTE,
            )
        publisher.put(letter.raw, attachment=letter.number.to_bytes(NUMBER_BYTES, "big"))

    def _tend(self, now_s: float) -> None:
        """Do periodic work: pings and reports."""
        if now_s < self._tend_s:
            return
        self._tend_s = now_s + TEND_EVERY_S
        if now_s >= self._ping_s:
            self._ping_s = now_s + self.link.options.keep_alive_s
            self._put_on_the_way(PING_BYTES, lambda: self._ask(now_s), is_page=False)
        if now_s >= self._resend_s:
            self._resend_s = math.inf
            self._send_newest(bool(self.roster.here()))
        self.link.report(now_s)

    def _ask(self, now_s: float) -> None:
        """Ping all other nodes."""
        if self._session is None:
            return
        self._session.get(
            f"{self.roster.prefix}/*/*/*/ping",
            self._background(lambda reply: self._answered(now_s, reply)),
            target=self._zenoh.QueryTarget.ALL,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            timeout=self.link.options.timeout_s,
            payload=self.roster.own_place,
            congestion_control=self._zenoh.CongestionControl.DROP,
            allowed_destination=self._zenoh.Locality.REMOTE,
        )

    @property
    def dropped(self) -> int:
        """Number of pages known not to have arrived; those of others by their sequence numbers."""
        lost = 0 if self._way is None else self._way.lost
        return self.link.dropped + self._outbox.dropped + self._inbox.dropped + self.roster.missed + lost

    def state_of(self, far: Far, now_s: float) -> dict[str, Any]:
        """Return the state of another node; see Fleet."""
        more = {"clock_offset_s": far.clock_offset_s, "dropped": far.missed, "received": far.received}
        return {**super().state_of(far, now_s), **more}

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        return {**super().state(now_s), "failures": self.link.failures}

    def see_off(self) -> None:
        """Send what waits, and leave; see Transport."""
        self._leave(self._send_out)

    def _shut(self) -> None:
        if not self.link.is_shut:
            return  # at the end of the program: the link has left already, and may still be sending
        self._leave(lambda: None)
        self._session, self._has_joined = None, False
        self._callbacks = ZenohCallbacks()
        self._publishers.clear()
        self.roster.cut_off()

    def _leave(self, say_last: Callable[[], None]) -> None:
        """Leave on a separate thread and wait at most `LINGER_S`: calls into Zenoh may block."""
        session, callbacks = self._session, self._callbacks
        if session is None:
            return

        def leave() -> None:
            with suppress(self._zenoh.ZError):
                say_last()
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


def _in_words(error: Exception) -> str:
    """Return Zenoh's message without the location in Zenoh's source."""
    return str(error).partition(" at /")[0].strip()


def _zenoh() -> Any:
    try:
        import zenoh
    except ImportError:
        raise MissingExtra("eclipse-zenoh", "zenoh") from None
    return zenoh
