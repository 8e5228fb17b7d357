"""Link: carries pages between this node and others, over one transport for each medium.

Out: the node's core passes each page of one of the link's keys to `_send_page`, right after it was stored. In: pages
of the remote peer enter through the node's inbox, with the link's name as their source. So a replay, which
makes no loops, needs no link. The link stores its own state as a page of its own name:
{up, age_s, dropped, rtt_s, ...}.

Errors of this node's own pages (not encodable, or longer than `max_frame_bytes`) end the node with the line that stored
them, or have new code that may have stored them rolled back. A page of another node that the next link cannot carry is
dropped, counted and logged once: its sender must not end a node that forwards it. On the wall clock the node's thread
sends a page itself if few tasks wait.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, TypeAlias

from msgspec.structs import replace

from snr_sim.core.clocks import SimClock
from snr_sim.core.component import ComponentLog
from snr_sim.core.datastore import LINK_PREFIX
from snr_sim.core.loop import LoopFactory
from snr_sim.core.run_diagnostics import describe_unusable_page
from snr_sim.links.frames import HEADER_BYTES, encode_frame
from snr_sim.links.messages import UNACCEPTABLE, Control, decode_message, encode_page, memory_bytes
from snr_sim.links.options import MAX_KEY_CHARS, MAX_KEYS, LinkOptions
from snr_sim.links.restarting import RestartingLoop
from snr_sim.prelude.errors import ComponentFailedError, SnrError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.recorder import RECORDING_KEY
from snr_sim.prelude.task import DataKey, Page, Task, TaskType
from snr_sim.prelude.tasks import ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME
from snr_sim.prelude.values import LONG_BYTES

BEFORE_LOOPS = -1  # under a SimClock, pages due at the same time as loops arrive first, so that loops find them
REPORT_PERIOD_S = 1.0
HOUSEKEEPING_HZ = 10.0
# From this many on, the link accepts nothing until the node has worked off half of them: a flood waits at its sender.
MAX_TASKS_WAITING = 10_000
MAX_BYTES_WAITING = 1 << 26
# With more tasks than this waiting, more pages are likely to follow: then one send for several is cheaper.
FEW_TASKS = 32
# Number of pages of other nodes whose forwarding is remembered, so that none circulates in a mesh indefinitely.
_MAX_RELAYED = 4096
MAX_REJECTED_KEYS = 20  # keys not in `accept` that the remote peer sent, for a note
# Keys with which this node reports on itself; a peer's page of such a key is accepted only if `accept` contains it.
LOCAL_KEYS = frozenset((TaskType.reload.value, ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME))
_STORE_PAGE = TaskType.store_page
_STORED, _PROCESSED = b'"process":false}', b'"process":true}'  # ends of a page's JSON, as `Page.serialize` writes it


@dataclass
class UnsendablePages:
    """Handler of pages that a link cannot send: an error for a page of its own node; those of other nodes are dropped.

    `link` describes the link in the error, and in `log` for the first dropped page; `component` is its name.
    """

    node: NodeApi
    link: str
    log: logging.Logger | ComponentLog
    component: str = ""
    is_warned: bool = False

    def drop(self, page: Page, error: SnrError) -> None:
        """Drop a page of another node, which must not end this node by an invalid page, or of code that is rolled back.

        Raises:
            SnrError: the page is this node's own; of the type of `error`.
        """
        what = f"{self.link} cannot send page '{page.key}': {error.message}"
        text, suspects = describe_unusable_page(self.node, page, what, self.component)
        failure = type(error)(text, fix=error.fix)
        if page.origin == self.node.name:
            name, at_s = self.node.name, page.created_at_s
            if not self.node.blame_suspects(ComponentFailedError(str(failure), name, "", "", suspects, at_s)):
                raise failure from error
        elif not self.is_warned:
            self.is_warned = True
            self.log.warning("%s Dropped, as will be all such pages.", failure)


def link_state(
    link: Link, peers: Iterable[tuple[str, dict[str, Any]]], dropped: int, sent: int, reason: str
) -> dict[str, Any]:
    """Return the state of a link from those of its peers; of several with one name, all but the first get a number."""
    states: dict[str, Any] = {}
    for name, state in peers:
        label, count = name, 2
        while label in states:
            label, count = f"{name}#{count}", count + 1
        states[label] = state
    return {
        "up": bool(states),
        "age_s": max((state["age_s"] for state in states.values()), default=None),
        "dropped": dropped,
        "rtt_s": max((state["rtt_s"] for state in states.values() if state["rtt_s"] is not None), default=None),
        "sent": sent,
        "received": link.received,
        "rejected": link.rejected,
        "reason": reason,
        "peers": states,
    }


Carry: TypeAlias = Callable[[Page, bytes, bytes, object], None]


class Transport:
    """Transport of a link's pages: one subclass per medium. All but `carry` and `carry_to` run on the link's thread."""

    # Sends a page to every peer except its sender, on the node's thread. Arguments: the page, its serialised form, its
    # frame, and its sender or None.
    carry: Carry
    # Sends a frame to the peers whose nodes have these names, also to the one that made its page; returns to how many.
    carry_to: Callable[[Collection[str], bytes], int]
    notes: Callable[[], Iterable[str]] = tuple  # returns notes for the end of the run

    def __init__(self, link: Link) -> None:
        self.link: Link = link
        self.lock: threading.Lock = threading.Lock()  # held to close everything, and for what must not happen meanwhile

    def open(self, ports: ExitStack) -> None:
        """Open what is needed, and push callbacks to close it onto `ports`; a first failure is an error of `begin`."""

    def round(self) -> None:
        """Wait for an event and handle it; in lock step do what is due."""
        raise NotImplementedError

    def wake(self) -> None:
        """End the wait of a round."""

    def drain_and_close(self) -> None:
        """Send the goodbye message to all peers before everything is closed."""

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link: at least what `link_state` returns."""
        raise NotImplementedError


class Link(RestartingLoop):
    """Sends pages of its keys over a transport, accepts those that arrive, and stores the state of the link.

    `simulated` makes its transport if the node runs under a SimClock; otherwise `real` does.

    Attributes:
        forwards: whether a component calls `forward` for each page of a peer; to be set before the link begins.
    """

    forwards: bool = False

    def __init__(
        self,
        factory: LoopFactory,
        parent: NodeApi,
        options: LinkOptions,
        real: Callable[[Link], Transport],
        simulated: Callable[[Link], Transport],
    ) -> None:
        is_simulated = isinstance(parent.clock, SimClock)
        rate_hz = HOUSEKEEPING_HZ if is_simulated else 0.0  # on a thread its own waiting paces it
        super().__init__(factory, parent, f"link_{options.name}", rate_hz)
        self.restarts: bool = not is_simulated
        self.options: LinkOptions = options
        self.dropped: int = 0  # pages known at this end not to have arrived
        self.sent: int = 0
        self.received: int = 0
        self.rejected: int = 0  # pages that arrived and were not accepted
        self.reason: str = ""  # why it is down, as text, set by its transport
        self._unstored: dict[int, tuple[Page, object]] = {}  # arrived, not stored yet: page and sender
        self._relayed: dict[int, None] = {}
        self._arrived: dict[int, tuple[Page, bytes]] = {}  # to be forwarded: page, and its JSON
        self._unsendable = UnsendablePages(parent, f"'{self.name}'", self.log, self.name)
        self._largest_bytes = 1  # of recent pages
        self.is_paused: bool = False  # nothing more is read, because the node has too much to do
        self._accepted: set[DataKey] = set()  # keys of `accept` that arrived
        self._rejected_keys: set[DataKey] = set()  # the first few keys that arrived and are not in it
        self._held_bytes: dict[DataKey, int] = {}  # without `accept`: keys that arrived, and memory of large pages
        self._all_held_bytes = 0
        self._is_full = False
        self._reported: tuple[Any, ...] = ()
        self._reported_s = float("-inf")
        self._logged: tuple[Any, ...] = ()
        self.transport: Transport = simulated(self) if is_simulated else real(self)
        self._carry = self.transport.carry

    def begin(self) -> None:
        """Open what is needed, and start to receive the node's pages."""
        self._open()
        for key in self.options.keys:
            self.parent.add_store_listener(key, self._send_page)
        super().begin()

    def join(self) -> None:
        """Take no more pages, send what waits, and close."""
        super().join()
        if self._executor is not None:
            for key in self.options.keys:
                self.parent.remove_store_listener(key, self._send_page)

    def stop(self) -> None:
        """Request the end of the rounds, and end a round that waits."""
        super().stop()
        if self._executor is not None:
            self.transport.wake()

    def terminate(self) -> None:
        """Report at the end of the run what was not sent, and which keys never occurred: they may be misspelt."""
        # If the link is only removed, its pages may still be stored later; and a node that never ran stored none.
        if self.parent.is_finished and not self.parent.never_ran:
            self._note_missed_keys()
        for words in self.transport.notes():
            self.parent.add_note(f"'{self.name}': {words}")

    def _note_missed_keys(self) -> None:
        stored = self.parent.datastore.pages
        for key in self.options.keys:
            if key not in stored and key != RECORDING_KEY:  # that page exists only in case of an error
                near = suggest(key, stored.keys() - {self.name}, "stored were")
                self.parent.add_note(f"'{self.name}' sends '{key}', but no page with this key was stored; {near}")
        missed = (self.options.accept or frozenset()) - self._accepted - {RECORDING_KEY}
        for key in sorted(missed) if self._rejected_keys else ():
            near = suggest(key, self._rejected_keys, "kept out were")
            self.parent.add_note(f"'{self.name}' accepts '{key}', of which no page came; {near}")

    # Methods of RestartingLoop

    def _open_ports(self, ports: ExitStack) -> None:
        self.transport.open(ports)

    def _round(self) -> None:
        self.transport.round()

    def _shut(self) -> None:
        with self.transport.lock:
            super()._shut()

    def _drain_and_close(self) -> None:
        self.transport.drain_and_close()

    def _show_down(self, reason: str) -> None:
        self.reason, self._reported = reason, ()
        self.report(self.get_time_s())

    # Out

    def send(self, page: Page, to: Collection[str] | None = None) -> None:
        """Send a page, whatever its key, on the node's thread: for a component that decides who gets it.

        Args:
            page: of this node, or of another one.
            to: names of the nodes that get it; for those that are not connected it counts as dropped. None sends it
                to all peers, or keeps it for the next one, as a page of the link's keys.

        Raises:
            SnrError: it cannot be encoded, and is of this node.
        """
        encoded = self._encode(page)
        if encoded is not None and to is None:
            self._carry(page, *encoded, None)
        elif encoded is not None and to:
            self.dropped += max(0, len(to) - self.transport.carry_to(to, encoded[1]))

    def forward(self, page: Page, to: Collection[str]) -> None:
        """Send a page of a peer to other nodes, which also handle it, in the bytes that it came in.

        Args:
            page: that was just stored; call this once for each, as its bytes are kept until then.
            to: names of the nodes, perhaps none; see `send`.
        """
        _, raw = self._arrived.pop(id(page), (page, b""))
        if not to:
            return
        if raw.endswith(_STORED):
            raw = raw[: -len(_STORED)] + _PROCESSED
        if raw.endswith(_PROCESSED):  # JSON of any peer: it may have another order of fields
            self.dropped += max(
                0, len(to) - self.transport.carry_to(to, encode_frame(raw, self.options.max_frame_bytes))
            )
        else:
            self.send(replace(page, process=True), to)

    def decode_and_keep(self, raw: bytes) -> Control | Page:
        """Return the message in a frame, and keep the bytes of a page for `forward`."""
        message = decode_message(raw, self.is_acceptable)
        if type(message) is Page and message is not UNACCEPTABLE:
            self._arrived[id(message)] = message, raw
        return message

    def _send_page(self, page: Page) -> None:
        _, by = self._unstored.pop(id(page), (page, None))
        encoded = self._encode(page)
        if encoded is not None and (page.origin == self.parent.name or not self._has_relayed(encoded[0])):
            self._carry(page, *encoded, by)

    def _encode(self, page: Page) -> tuple[bytes, bytes] | None:
        """Return a page as JSON and as a frame; None if it cannot be sent and is dropped."""
        try:
            raw = encode_page(page)
            return raw, encode_frame(raw, self.options.max_frame_bytes)
        except SnrError as error:
            self._unsendable.drop(page, error)
            self.dropped += 1
            return None

    def _has_relayed(self, raw: bytes) -> bool:
        """Whether this exact page of another node was forwarded before, and so has arrived in a circle."""
        fingerprint = hash(raw)
        if fingerprint in self._relayed:
            return True
        self._relayed[fingerprint] = None
        if len(self._relayed) > _MAX_RELAYED:
            del self._relayed[next(iter(self._relayed))]
        return False

    # In

    def accept_pages(self, pages: Sequence[Page], by: object, is_chosen: bool = False) -> None:
        """Store the pages of a peer that this node accepts; all if the transport has selected them."""
        is_acceptable, enter, name = self.is_acceptable, self.parent.inbox.put, self.name
        for page in pages:
            key = page.key
            if page is UNACCEPTABLE or not (is_chosen or is_acceptable(key, page.origin)):
                self.rejected += 1
                self._arrived.pop(id(page), None)
                continue
            if key in self.options.keys:
                self._unstored[id(page)] = (page, by)
            enter(Task(_STORE_PAGE, key, [page]), name)
        self.received += len(pages)

    def is_acceptable(self, key: DataKey, origin: str, raw: bytes = b"") -> bool:
        """Whether to accept a page of this key, origin and JSON, which is required of large pages only."""
        if origin == self.parent.name:
            return False
        accept = self.options.accept
        if accept is not None:
            return self.is_accepted(key, accept)
        is_own_state = key in LOCAL_KEYS or (key.startswith(LINK_PREFIX) and key in self.parent.components)
        return 0 < len(key) <= MAX_KEY_CHARS and not is_own_state and self.has_room_for(key, raw)

    def has_room_for(self, key: DataKey, raw: bytes) -> bool:
        """Whether a link without `accept` takes a page of this key and JSON. Warns once.

        Its peers may fill so many keys, and so much memory with the newest pages of all of them. Small pages count as
        nothing, so that large ones do not displace them.
        """
        held_bytes = self._held_bytes.get(key)
        if held_bytes is None and len(self._held_bytes) >= MAX_KEYS:
            return self._warn_of_full(f"takes {MAX_KEYS} different keys", key)
        if len(raw) >= LONG_BYTES:
            total_bytes = self._all_held_bytes - (held_bytes or 0) + (size_bytes := memory_bytes(raw))
            if total_bytes > self.options.max_held_bytes:
                return self._warn_of_full(f"takes pages that fill {self.options.max_held_bytes / 1e6:.0f} MB", key)
            self._all_held_bytes, self._held_bytes[key] = total_bytes, size_bytes
        elif held_bytes is None:
            self._held_bytes[key] = 0
        return True

    def _warn_of_full(self, what: str, key: DataKey) -> bool:
        if not self._is_full:
            self._is_full = True
            fix = "accept=[...] names the keys to take."
            self.log.warning("'%s' %s. %.80r is dropped, and all further. %s", self.name, what, key, fix)
        return False

    def is_accepted(self, key: DataKey, accept: frozenset[DataKey]) -> bool:
        """Whether a key is in `accept`; the key is remembered for notes at the end, if there is room."""
        if key in accept:
            self._accepted.add(key)
            return True
        if len(self._rejected_keys) < MAX_REJECTED_KEYS and len(key) <= MAX_KEY_CHARS and key.isprintable():
            self._rejected_keys.add(key)
        return False

    def has_few_tasks(self) -> bool:
        """Whether the node has few other tasks waiting."""
        return self.parent.queued_task_count <= FEW_TASKS

    def note_size(self, page_bytes: int) -> None:
        """Record the size of an arriving page; see `check_back_pressure`."""
        if page_bytes > self._largest_bytes:
            self._largest_bytes = page_bytes

    def check_back_pressure(self) -> bool:
        """Whether the node has too many tasks waiting for the link to accept more."""
        tasks = self.parent.queued_task_count
        if self.is_paused:
            tasks *= 2
        self.is_paused = tasks > MAX_TASKS_WAITING or tasks * (self._largest_bytes + HEADER_BYTES) > MAX_BYTES_WAITING
        return self.is_paused

    # State

    def report(self, now_s: float) -> None:
        """Store the link's state, if it has changed or a second has passed."""
        state = self.transport.state(now_s)
        gist = (state["up"], *state["peers"])
        # Not at each change of the reason: unauthenticated clients that come and go could flood the node with reports.
        if gist == self._reported and now_s - self._reported_s < REPORT_PERIOD_S:
            return
        if (*gist, state["reason"]) != self._logged:
            self._log_change(state)
            self._logged = (*gist, state["reason"])
        self._reported, self._reported_s = gist, now_s
        self._largest_bytes = max(1, self._largest_bytes // 2)
        self.store_data(self.name, state)

    def _log_change(self, state: Mapping[str, Any]) -> None:
        if state["up"]:
            self.log.info("%s is up: %s", self.name, ", ".join(state["peers"]))
        else:
            is_news = bool(self._logged)  # the first state, without a peer, is not worth a log line
            level = logging.WARNING if is_news else logging.INFO
            self.log.log(level, "%s is down: %s", self.name, state["reason"])
