"""One tool of ROS at a node, without a socket: what it may ask, how often, and what it is sent."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import msgspec

from snr_sim.core.node import Node
from snr_sim.links.messages import check_bounds
from snr_sim.links.token_bucket import TokenBucket
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import SnrError, suggest
from snr_sim.prelude.task import Page
from snr_sim.prelude.values import JSON_ERRORS
from snr_sim.web.messages import MAX_NAME_CHARS, HungUpError, Rights

MESSAGES_PER_S, MESSAGES_AT_ONCE = 200.0, 400.0
MAX_CALLS = 16  # of services, that wait for their answers
CALL_TIMEOUT_S = 5.0

Name: TypeAlias = Annotated[str, msgspec.Meta(max_length=MAX_NAME_CHARS)]


class Request(msgspec.Struct, frozen=True):
    """A message of a client. Fields that are not listed are ignored: they concern types of ROS, and its queues."""

    op: Literal["advertise", "unadvertise", "publish", "subscribe", "unsubscribe", "call_service"]
    id: Name | None = None
    topic: Name = ""
    msg: dict[str, Any] = {}
    throttle_rate: Annotated[float, msgspec.Meta(ge=0.0, le=1e7)] = 0.0  # shortest time between two pages [ms]
    service: Name = ""
    args: Any = None
    timeout: Annotated[float, msgspec.Meta(ge=0.0, le=60.0)] = CALL_TIMEOUT_S


_decode: Callable[[str | bytes], Request] = msgspec.json.Decoder(Request).decode


class Service(NamedTuple):
    """A service: the event that a call causes, and the key of the page whose next one is its answer."""

    event: str
    answer: str


@dataclass(frozen=True)
class Offer:
    """What tools may use; see `RosbridgeFactory`.

    Args:
        topics, events, services: by their names in ROS.
        source: of the events, for the recording.
    """

    topics: Mapping[str, str]
    events: Mapping[str, str]
    services: Mapping[str, Service]
    source: str


class RosbridgePage:
    """What the server needs to know: its sessions."""

    def __init__(self, node: Node, offer: Offer) -> None:
        self._node, self._offer = node, offer
        self._sessions: list[RosSession] = []

    def open(self, rights: Rights, send: Callable[[bytes], None]) -> RosSession:
        """Return the session of a new connection."""
        session = RosSession(self._node, self._offer, rights, send)
        self._sessions.append(session)
        return session

    def close(self, session: RosSession) -> None:
        """Forget a connection."""
        self._sessions.remove(session)

    def tick(self, now_s: float) -> None:
        """Send what is new; `now_s` is wall time."""
        for session in list(self._sessions):
            with suppress(HungUpError):  # it reads nothing: the server closes it
                session.tick(now_s)

    def goodbye(self, reason: str) -> bytes:
        """Return the last message of a connection that the server closes."""
        return _error(reason)


class _Subscription:
    """A topic that a client is sent."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.sent: Page | None = None
        self.due_s = float("-inf")


class _Call(NamedTuple):
    """A call that waits for its answer: a page that is not `before`."""

    request: Request
    before: Page | None
    over_s: float


class RosSession:
    """One client. It may have as many subscriptions as there are topics, and `MAX_CALLS` calls.

    Pages are read on the server's thread, and the node does nothing for them. What a client asks enters the node's
    inbox, so it is recorded and replayed.
    """

    def __init__(self, node: Node, offer: Offer, rights: Rights, send: Callable[[bytes], None]) -> None:
        self._node, self._offer, self._rights, self._send = node, offer, rights, send
        self._messages = TokenBucket(MESSAGES_PER_S, MESSAGES_AT_ONCE)
        self._subscribed: dict[str, _Subscription] = {}
        self._calls: list[_Call] = []

    def receive(self, data: str | bytes) -> None:
        """Handle a message; what cannot be done is answered with a status message.

        Raises:
            HungUpError: there are too many, or one is not JSON within bounds.
        """
        if not self._messages.take(time.monotonic()):
            raise HungUpError(f"More than {MESSAGES_PER_S:g} messages a second.")
        try:
            check_bounds(data.encode() if isinstance(data, str) else data)
            request = _decode(data)
        except msgspec.ValidationError as error:
            self._send(_error(f"Not a request of this server: {error}."))
            return
        except (*JSON_ERRORS, SnrError) as error:
            raise HungUpError(f"What came is not a message: {error}.") from None
        problem = self._carry_out(request)
        if problem:
            self._send(_error(problem, request.id))

    def _carry_out(self, request: Request) -> str:
        """Do what a message asks for; return why that is not possible."""
        offer, topic = self._offer, request.topic
        if request.op in ("publish", "call_service") and self._rights != "change":
            return "This token may only subscribe."
        if request.op == "subscribe" and topic not in offer.topics:
            return _unknown("topic of a page", topic, offer.topics)
        if request.op in ("advertise", "publish") and topic not in offer.events:
            return _unknown("topic of an event", topic, offer.events)
        match request.op:
            case "subscribe":
                self._subscribed[topic] = _Subscription(1e-3 * request.throttle_rate)
            case "unsubscribe":
                self._subscribed.pop(topic, None)
            case "publish":
                self._schedule(offer.events[topic], request.msg)
            case "call_service":
                self._call(request)
        return ""

    def _call(self, request: Request) -> None:
        service = self._offer.services.get(request.service)
        if service is None or len(self._calls) >= MAX_CALLS:
            problem = _unknown("service", request.service, self._offer.services)
            problem = problem if service is None else f"{MAX_CALLS} calls wait for their answers."
            self._send(_response(request, problem, False))
            return
        before = self._node.datastore.pages.get(service.answer)
        self._calls.append(_Call(request, before, time.monotonic() + request.timeout))
        self._schedule(service.event, request.args)

    def _schedule(self, event: str, message: Any) -> None:
        """Send an event: its values are the message's `data`, or else the message, unless that is empty."""
        given = message.get("data", message) if isinstance(message, dict) else message
        values = given if isinstance(given, list) else [] if given in (None, {}) else [given]
        self._node.enqueue_input(tasks.event(event, values), self._offer.source)

    def tick(self, now_s: float) -> None:
        """Send pages that are new, and the answers of calls."""
        pages = self._node.datastore.pages.get  # `get` of the datastore would count keys that are not there as missed
        for topic, one in self._subscribed.items():
            page = pages(self._offer.topics[topic])
            if page is not None and page is not one.sent and now_s >= one.due_s:
                one.sent, one.due_s = page, now_s + one.period_s
                self._send(msgspec.json.encode({"op": "publish", "topic": topic, "msg": _message(page)}))
        for call in list(self._calls):
            page = pages(self._offer.services[call.request.service].answer)
            has_answer = page is not None and page is not call.before
            if has_answer or now_s >= call.over_s:
                self._calls.remove(call)
                answer: Any = _message(page) if has_answer else f"No answer within {call.request.timeout:g} s."
                self._send(_response(call.request, answer, has_answer))


def _unknown(what: str, name: str, known: Mapping[str, object]) -> str:
    return f"There is no {what} '{name:.80}': {suggest(name[:80], known)}"


def _message(page: Page | None) -> msgspec.Raw:
    """Return the message of a page; what JSON cannot have is text."""
    assert page is not None
    try:
        data = msgspec.to_builtins(page.data, str_keys=True, enc_hook=_plain)
        return msgspec.Raw(msgspec.json.encode(data if isinstance(data, dict) else {"data": data}))
    except (TypeError, ValueError, RecursionError):  # keys that are tuples, half a character of two
        return msgspec.Raw(msgspec.json.encode({"data": ascii(page.data)[:MAX_NAME_CHARS]}))


def _plain(value: Any) -> Any:
    """Return an array as lists, and any other object as text."""
    return value.tolist() if hasattr(value, "tolist") else repr(value)


def _response(request: Request, values: Any, result: bool) -> bytes:
    found = {"op": "service_response", "id": request.id, "service": request.service, "values": values, "result": result}
    return msgspec.json.encode(found)


def _error(text: str, request_id: str | None = None) -> bytes:
    return msgspec.json.encode({"op": "status", "level": "error", "msg": text, "id": request_id})
