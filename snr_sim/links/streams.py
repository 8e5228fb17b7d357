"""Streams: transport of a link over byte streams, sockets or pipes.

The node's own thread reads what has arrived while it waits in its inbox, because a change of threads takes
longer than all the rest. The link's thread does everything else (connects, greets, pings, sends what could not be sent
at once) in one `select`. It also reads when the node is too busy to wait in its inbox.
"""

from __future__ import annotations

import logging
import selectors
import socket
from collections.abc import Callable, Collection, Iterable
from contextlib import ExitStack, suppress
from functools import partial
from operator import attrgetter
from typing import Any

from snr_sim.links.link import REPORT_PERIOD_S, Carry, Link, Transport
from snr_sim.links.peers import Peers
from snr_sim.links.session import SessionConfig
from snr_sim.links.socket_port import SocketPort
from snr_sim.links.stream_peer import Account, StreamPeer

READ_BYTES = 1 << 17  # per system call, of an incomplete frame
# Of new frames, a round reads so many bytes of all peers together, in equal shares: the next page then waits for few
# tasks, whatever others send. 8 KiB are a hundred small pages.
ROUND_BYTES = 1 << 13
MIN_SHARE_BYTES = 1 << 8
ROUND_S = 0.02  # maximum duration of a round; the remaining peers follow in the next
# Period at which pages are read for a node that still has tasks of the last ones to do.
BUSY_READ_PERIOD_S = 0.1
HOUSEKEEPING_PERIOD_S = 0.05  # time-outs, keep-alives, reports
# While no stream comes or goes and the node is idle, so many times per keep-alive, but not more often than that: an
# idle link then wakes 8 times a second, not 20.
IDLE_CHECKS = 4
BUSY_CHECK_PERIOD_S = 0.002  # period at which a busy node is checked: does it wait in its inbox, has it caught up?
# Time limit for a closing link to send what waits and get its receipt confirmed. Shorter than that of joining a loop.
LINGER_S = 0.3
_USED_S = attrgetter("account.used_s")


class Streams(Transport):
    """Waits for all its streams at once, and shares them with the node's thread: hold the lock to access them.

    Streams are read in rounds. In a round each is read once, up to its share, in order of the time used lately,
    least first (`_in_turn`). The next round begins when the node has handled the last one, or has had at least as much
    time as that round took. So whatever some peers send, accepted or not, it delays another peer by one round at most.

    Each wait in the inbox is a round, since a node that waits has handled the last one. Streams that are not up share
    one account of time.

    An error of one stream closes that stream (`_for`). Other errors restart the link.
    """

    def __init__(self, link: Link, config: SessionConfig) -> None:
        super().__init__(link)
        self.peers: Peers = Peers(link, config)
        self.carry: Carry = self.peers.carry
        self.carry_to: Callable[[Collection[str], bytes], int] = self.peers.carry_to
        self.notes: Callable[[], Iterable[str]] = self.peers.notes
        self.streams: list[StreamPeer] = []  # all, including those that are not up
        self.now_s: Callable[[], float] = link.parent.clock.now_s
        self._node = link.parent
        self._housekeep_s = 0.0
        self._reported_up: object = None
        self._report_s = 0.0
        self._idle_period_s = max(HOUSEKEEPING_PERIOD_S, config.keep_alive_s / IDLE_CHECKS)
        self._is_woken = False
        self._is_round_over = False
        self._is_slow = link.options.faults is not None  # then each frame is due at a time of its own
        self._wait_count = -1  # number of the node's waits in its inbox, when last read
        self._is_node_busy = True
        self.forged: int = 0  # streams whose data was changed between the two ends
        self._read_s = float("-inf")  # when pages last arrived
        self._rest_s = float("-inf")  # no round for a busy node before: it gets the time the last one took
        self._half_read: dict[StreamPeer, None] = {}  # streams with bytes that `select` does not show
        self._greeting = Account()  # of all streams that are not up, together

    def open(self, ports: ExitStack) -> None:
        """Open what each round waits for; see Transport."""
        self._selector: selectors.BaseSelector = selectors.DefaultSelector()
        ports.callback(self._selector.close)
        self._wake_in, self._wake_out = socket.socketpair()
        for sock in (self._wake_in, self._wake_out):
            ports.callback(sock.close)
            sock.setblocking(False)
        self._selector.register(self._wake_out, selectors.EVENT_READ, self._on_wake_up)
        ports.callback(self._drop_all)

    def wake(self) -> None:
        """Wake the link's thread; from any thread."""
        if not self._is_woken:
            self._is_woken = True
            with suppress(OSError):  # a full pipe wakes it as well, and a closed one means the end
                self._wake_in.send(b"\0")

    def _on_wake_up(self, events: int) -> None:
        with suppress(OSError):
            self._wake_out.recv(4096)
        self._is_woken = False  # before the work, so that what arrives during it wakes the thread again
        self._is_round_over = True  # the link may be about to stop
        self._poll()

    def _poll(self) -> None:
        """Handle a wake-up: a page waits, or the link is to stop."""
        self._pump_all()

    def round(self) -> None:
        """Wait for events and handle them, repeatedly while pages arrive."""
        select, now = self._selector.select, self.now_s
        self._is_round_over = False
        while not self._is_round_over:
            now_s = now()
            until_s = self._until_s(now_s)
            events = select(max(0.0, until_s - now_s))
            if events or self._half_read:
                with self.lock:
                    self._act_on(events)
            if not events or now_s >= until_s or not self.link.has_few_tasks():
                break
        with self.lock:
            self._read_for_busy_node(now())
            self._housekeep(now())

    def _act_on(self, events: list[tuple[selectors.SelectorKey, int]]) -> None:
        ready: dict[StreamPeer, int] = {}
        for key, mask in events:
            if isinstance(key.data, StreamPeer):
                ready[key.data] = mask
            else:
                key.data(mask)
        for stream in self._half_read:
            ready[stream] = ready.get(stream, 0) | selectors.EVENT_READ
        if ready:
            self._in_turn(list(ready), lambda stream: self._for(stream, self._serve, ready[stream]))

    def _in_turn(self, streams: list[StreamPeer], act: Callable[[StreamPeer], object]) -> None:
        """Act on each stream once, in the order of time used lately, least first, until the time of a round is over."""
        begun_s = now_s = self.now_s()
        if len(streams) > 1:
            streams = sorted(streams, key=_USED_S)
        for stream in streams:
            account = stream.account
            act(stream)
            last_s, now_s = now_s, self.now_s()
            account.used_s += now_s - last_s
            if now_s - begun_s > ROUND_S:
                break
        if now_s - begun_s > BUSY_CHECK_PERIOD_S:
            self._rest_s = now_s + (now_s - begun_s)

    def _until_s(self, now_s: float) -> float:
        if self._half_read and not self.link.is_paused:
            return now_s
        if self.link.is_paused or self._is_node_busy:
            return now_s + BUSY_CHECK_PERIOD_S
        return (
            min([self._housekeep_s, *(stream.due_s for stream in self.streams)]) if self._is_slow else self._housekeep_s
        )

    def drain_and_close(self) -> None:
        """Send what waits and send the goodbye message, within `LINGER_S`."""
        with self.lock:
            for stream in self.streams:
                self._set_read_by_node(stream, False)
        drain_and_close(self.streams, self.now_s, self.peers.bye_reason())

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        return {**self.peers.state(now_s), "failures": self.link.failures, "forged": self.forged}

    # Streams

    def _for(self, stream: StreamPeer, act: Callable[..., object], *args: object) -> None:
        """Act on one stream, if it is still open. An exception closes this stream and no other."""
        if not stream.is_open:
            return  # an earlier event of the same `select` has closed it
        try:
            act(stream, *args)
        except Exception as error:
            stream.fail(error)
            if stream.is_open:
                self._drop(stream)

    def _add_stream(self, port: SocketPort, where: str) -> StreamPeer:
        channel = self.peers.new_channel() if self._is_slow else None
        stream = StreamPeer(port, self.peers.new_session(), self.link, channel, where, self._greeting)
        self.streams.append(stream)
        self._for(stream, self._pump)
        return stream

    def _pump(self, stream: StreamPeer) -> None:
        """Send what waits for a peer, and update its state."""
        stream.pump(self.now_s())
        if stream.failure or stream.session.is_closed:
            self._end_session(stream)
        if stream.is_open:
            self._watch(stream)

    def _pump_all(self) -> None:
        """Pump the streams that have something to do; most have nothing, each round."""
        now_s = self.now_s()
        for stream in [stream for stream in self.streams if stream.needs_pump(now_s)]:
            self._for(stream, self._pump)

    def _serve(self, stream: StreamPeer, events: int) -> None:
        if events & selectors.EVENT_READ and stream.watched & selectors.EVENT_READ:
            self._read(stream)
        self._pump(stream)

    def _serve_in_inbox(self, ready: list[StreamPeer]) -> None:
        """Read a round of what has arrived, on the node's thread, which is idle in its inbox."""
        with self.lock:
            self._in_turn(ready, self._read_in_inbox)
            for stream in ready:
                if stream.failure or stream.session.wants_attention:
                    break
            else:
                return
        self.wake()

    def _read_in_inbox(self, stream: StreamPeer) -> None:
        try:
            if not stream.is_read_by_node:
                return
            self._read(stream)
            if stream.session.is_up and stream.session.wants_attention:
                # Answer a ping here, like a page: a change of threads takes far longer than the transit.
                stream.pump(self.now_s())
                if stream.has_more:
                    self.wake()
        except Exception as error:  # the link's thread closes the stream
            stream.fail(error)

    def _read_for_busy_node(self, now_s: float) -> None:
        """Read a round for a node that has not waited in its inbox since the last check."""
        inbox = self._node.inbox
        is_absent = not inbox.is_waiting and inbox.wait_count == self._wait_count
        self._is_node_busy, self._wait_count = not inbox.is_waiting, inbox.wait_count
        is_early = now_s < self._rest_s or (now_s < self._read_s + BUSY_READ_PERIOD_S and not self.link.has_few_tasks())
        was_paused, self.link.is_paused = self.link.is_paused, self.link.check_back_pressure() or is_early
        if self.link.is_paused != was_paused:
            for stream in list(self.streams):
                self._for(stream, self._watch)
        if is_absent and not self.link.is_paused:
            idle_streams = [stream for stream in self.streams if stream.is_read_by_node]
            self._in_turn(idle_streams, lambda stream: self._for(stream, self._read))

    def _read(self, stream: StreamPeer) -> None:
        """Accept what has arrived: of new frames no more than the stream's share."""
        session = stream.session
        size_bytes = max(MIN_SHARE_BYTES, ROUND_BYTES // (len(self.peers.up) or 1))
        if stream.unread_bytes and session.missing_bytes > size_bytes:
            size_bytes = min(READ_BYTES, session.missing_bytes)
        try:
            data = stream.port.read(size_bytes)
        except BlockingIOError:
            return
        except OSError as error:
            stream.fail(error)
            return
        if not data:
            session.close("the connection was closed.")
            stream.failure = session.reason
            return
        if not stream.port.is_shareable:
            self._half_read.pop(stream, None)
            if stream.port.has_more():
                self._half_read[stream] = None
        stream.unread_bytes += len(data)
        now_s = self.now_s()
        pages = session.receive(data, now_s)
        if not stream.is_admitted and session.is_up:
            stream.is_admitted, stream.account = True, Account()
            stream.pump(self.now_s())  # the session's messages precede the first page
            self._admit(stream)
            self._housekeep_s = 0.0  # report it now
        if pages:
            self.link.note_size(stream.unread_bytes // len(pages))
            stream.unread_bytes = 0
            self._read_s = now_s
            self.link.accept_pages(pages, stream)

    def _end_session(self, stream: StreamPeer) -> None:
        """End a session. Closing at once could discard the reason before the peer reads it, so closing is delayed."""
        leaves_s = self._note_end(stream)
        if stream.due_s == float("inf"):  # otherwise the reason is still delayed by faults
            stream.end_writing()
        if stream.failure or self.now_s() >= leaves_s:
            self._drop(stream)

    def _note_end(self, stream: StreamPeer) -> float:
        """Record once why a session is over; return the time limit for closing its stream."""
        if stream.leaves_s is not None:
            return stream.leaves_s
        stream.leaves_s = self.now_s() + LINGER_S
        if stream.failure:
            stream.session.close(stream.failure)
        if stream.is_admitted:
            self.peers.remove(stream)
        self.link.reason = stream.session.reason
        self.link.rejected += stream.session.rejected
        self.forged += stream.session.was_forged
        is_news = stream.session.was_forged and self.forged == 1  # warned once: it can happen again and again
        self.link.log.log(logging.WARNING if is_news else logging.INFO, "%s: %s", stream.where, self.link.reason)
        self._housekeep_s = 0.0
        return stream.leaves_s

    def _drop(self, stream: StreamPeer) -> None:
        """Close a stream. Every step is tried, whatever the others raise."""
        if stream.bug is not None:
            self.link.failures += 1
            # One traceback is enough: a peer must not fill the log with more of them.
            self.link.log.error(
                "%s: %s", stream.where, stream.failure, exc_info=stream.bug if self.link.failures == 1 else None
            )
        self.streams.remove(stream)
        stream.is_open = False
        self._half_read.pop(stream, None)
        self.link.attempt(partial(self._note_end, stream))
        self.link.attempt(partial(self._watch, stream))
        self.link.attempt(stream.port.close)
        self.link.attempt(partial(self._on_closed, stream))

    def _drop_all(self) -> None:
        for stream in list(self.streams):
            stream.session.close("the link was closed.")  # if it did not end in good order
            self._drop(stream)

    def _admit(self, stream: StreamPeer) -> None:
        """Start to use a session that is up."""
        self.peers.admit(stream)

    def _on_closed(self, stream: StreamPeer) -> None:
        """Forget a stream that is closed; a client connects again."""

    def _watch(self, stream: StreamPeer) -> None:
        """Register in `select` the events that this stream needs now."""
        is_open, is_leaving = stream.is_open, stream.leaves_s is not None
        is_read_by_node = is_open and stream.is_admitted and stream.port.is_shareable and not is_leaving
        self._set_read_by_node(stream, is_read_by_node)
        is_read = is_leaving or not (is_read_by_node or (stream.is_admitted and self.link.is_paused))
        events = 0
        if is_open:
            events = (selectors.EVENT_READ if is_read else 0) | (selectors.EVENT_WRITE if stream.is_blocked else 0)
        if events == stream.watched:
            return
        if not events:
            self._selector.unregister(stream.descriptor)
        elif not stream.watched:
            self._selector.register(stream.descriptor, events, stream)
        else:
            self._selector.modify(stream.descriptor, events, stream)
        stream.watched = events

    def _set_read_by_node(self, stream: StreamPeer, is_watched: bool) -> None:
        """Add or remove a stream that the node's thread reads while it waits in its inbox."""
        if is_watched and not stream.is_read_by_node:
            self._node.inbox.watch(stream.descriptor, self._serve_in_inbox, stream)
            stream.is_read_by_node = True
        elif stream.is_read_by_node and not is_watched:
            stream.is_read_by_node = False
            self._node.inbox.unwatch(stream.descriptor)

    def _housekeep(self, now_s: float) -> None:
        """Do periodic work: keep-alives, time-outs, reports."""
        self._pump_all()
        if now_s < self._housekeep_s:
            return
        is_idle = not (self.link.is_paused or self._is_node_busy or any(map(_is_changing, self.streams)))
        self._housekeep_s = now_s + (self._idle_period_s if is_idle else HOUSEKEEPING_PERIOD_S)
        if self._is_woken:  # the wake-up may have come while the link restarted, and had no effect then
            self._is_woken = False
            self._poll()
        self._greeting.used_s /= 2
        for stream in list(self.streams):
            stream.account.used_s /= 2
            if self.link.is_paused:
                stream.session.reset_idle_timer(now_s)
            self._for(stream, lambda stream: stream.session.tick(now_s))
        self._pump_all()
        if self.peers.up is not self._reported_up or now_s >= self._report_s:
            self._reported_up, self._report_s = self.peers.up, now_s + REPORT_PERIOD_S
            self.link.report(now_s)


def _is_changing(stream: StreamPeer) -> bool:
    """Whether a stream is not up yet, or no more."""
    return not stream.is_admitted or stream.leaves_s is not None


def drain_and_close(streams: list[StreamPeer], now_s: Callable[[], float], reason: str) -> None:
    """Send what waits, send the goodbye message, and wait for the peers to close, at most `LINGER_S`."""
    give_up_s = now_s() + LINGER_S
    with selectors.DefaultSelector() as selector:
        for stream in streams:
            if not stream.failure:
                selector.register(stream.descriptor, selectors.EVENT_READ | selectors.EVENT_WRITE, stream)
        while selector.get_map() and (spare_s := give_up_s - now_s()) > 0:
            due_s = min(stream.due_s for stream in streams)
            for key, _ in selector.select(min(spare_s, max(0.001, due_s - now_s()))):
                stream = key.data
                try:
                    events = _send_goodbye(stream, now_s(), reason)
                except Exception as error:  # the others still get their goodbye
                    stream.fail(error)
                    events = 0
                if not events:
                    selector.unregister(key.fileobj)
                elif events != key.events:
                    selector.modify(key.fileobj, events, stream)


def _send_goodbye(stream: StreamPeer, now_s: float, reason: str) -> int:
    """Send what waits, then the goodbye; return the events to wait for, 0 if the peer has closed."""
    stream.pump(now_s)
    if stream.failure or _has_closed(stream):
        return 0
    if stream.has_more:
        return selectors.EVENT_READ | selectors.EVENT_WRITE
    if not stream.session.is_closed:
        stream.session.bye(reason)
        return selectors.EVENT_READ | selectors.EVENT_WRITE
    stream.end_writing()
    return selectors.EVENT_READ


def _has_closed(stream: StreamPeer) -> bool:
    try:
        return not stream.port.read(READ_BYTES)
    except BlockingIOError:
        return False
    except OSError:
        return True
