"""Session: the protocol between the two ends of a link, without a port and without a clock.

Bytes in, messages and bytes to send out, and a state. Time is an argument. So a silent peer, a wrong secret or a
flood of invalid bytes takes a few lines to test, and TCP, pipes and simulated links all behave alike:

    greeting -> (proving) -> up -> closed

Both ends greet at once, because taking turns saves nothing. Only proofs take turns: the server answers only a client's
correct proof, so unauthenticated clients learn nothing from it. A frame gets its MAC, which counts frames, only when it
is certain to be the next that leaves: at the port, and after the faults of a link, which lose and repeat pages.
"""

from __future__ import annotations

import hmac
import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, get_args

import msgspec

from snr_sim.links.frames import MAC_BYTES, MAX_FRAME_BYTES, FrameMac, LengthPrefixedReader, encode_frame
from snr_sim.links.messages import (
    MAX_REASON_CHARS,
    NONCE_BYTES,
    PROTOCOL,
    VERSION,
    Auth,
    Bye,
    Control,
    HelloMessage,
    Ping,
    Pong,
    RefusedMessage,
    decode_control,
    decode_message,
    encode_message,
)
from snr_sim.links.security import derive_key
from snr_sim.prelude.errors import FrameTooLargeError, SnrError
from snr_sim.prelude.text import visible

# An end that has not sent its hello yet gets no more of our memory than this.
MAX_GREETING_BYTES = 4096
# With a secret, the first frames of each end (hello and auth) have no MAC, since the ends are not authenticated yet.
# Later frames have one.
FRAMES_WITHOUT_MAC = 2
# Limit of answers that wait because the other end does not read; beyond it the session is closed.
MAX_WAITING_BYTES = 1 << 16
# The quickest of so many pings determines the clock offset. With more, a drift between the clocks shows up late.
OFFSETS_REMEMBERED = 8
STEADY_TIMES = 4  # so often data are received, at different times, until a session counts as one that lasts
_CONTROL = frozenset(get_args(Control))


class SessionState(StrEnum):
    """State of a session."""

    greeting = "greeting"
    proving = "proving"
    up = "up"
    closed = "closed"


# Looked up once: in Python 3.11 access to an Enum member takes 0.1 us.
_UP, _CLOSED = SessionState.up, SessionState.closed


@dataclass(frozen=True)
class SessionConfig:
    """One end's settings for its sessions."""

    node: str  # name of the node
    is_server: bool  # whether this is the end that accepts connections
    secret: bytes | None = None  # shared by both ends; None requires none
    purpose: str = "pages"  # protocol of the port
    max_frame_bytes: int = MAX_FRAME_BYTES  # the longest payload it accepts
    keep_alive_s: float = 0.5  # period between pings
    timeout_s: float = 3.0  # silence after which the session ends
    greeting_s: float | None = None  # maximum duration of the greeting; `timeout_s` if None
    # What users call the secret, and how they pass it; for messages.
    secret_is: tuple[str, str] = ("shared secret", "the same secret= on both ends")


class Session:
    """One end of a connection. Not thread-safe. Times are of the same clock, whichever it is.

    `decode` decodes payloads; `receive` returns its results, except for control messages. The nonce is random if not
    given.
    """

    def __init__(
        self,
        config: SessionConfig,
        now_s: float,
        decode: Callable[[bytes], Any] = decode_message,
        nonce: bytes | None = None,
    ) -> None:
        self.config: SessionConfig = config
        self.state: SessionState = SessionState.greeting
        self.reason: str = ""  # why it closed, as text
        self.was_refused: bool = False  # by either end: an early retry is of no use
        self.was_left: bool = False  # by the other end, in good order
        self.was_forged: bool = False  # a frame was changed between the two ends
        self.peer: HelloMessage | None = None
        self.peer_node: str = ""  # name of the other end's node, once received
        self.rtt_s: float | None = None
        # Add this to a time of the other end's clock to get our time; too large by at most a one-way latency.
        self.clock_offset_s: float | None = None
        self.last_received_s: float = now_s
        self._silent_since_s = now_s  # as that, or since this end has begun to read again
        self._received_s: deque[float] = deque(maxlen=STEADY_TIMES)  # newest times, at least half a keep-alive apart
        self.begun_s: float = now_s
        self.rejected: int = 0  # while it was up: invalid messages, or values beyond their bounds
        self._decode = decode
        self._reader = LengthPrefixedReader(min(MAX_GREETING_BYTES, config.max_frame_bytes))
        self._ping_s = now_s
        self._offsets_s: deque[float] = deque(maxlen=OFFSETS_REMEMBERED)
        self._outbox: list[bytes] = []
        self._outbox_bytes = 0
        self._sealed = 0  # frames that went through `seal` without a MAC
        self._mac_out: FrameMac | None = None  # both are set after the other end's hello, if there is a secret
        self._mac_in: FrameMac | None = None
        self._proofs = ("", "")  # of this end, and the expected one of the other end
        who = (config.node, (nonce or os.urandom(NONCE_BYTES)).hex(), config.purpose)
        hello = HelloMessage(PROTOCOL, VERSION, *who, config.secret is not None, config.max_frame_bytes)
        self._hello = encode_frame(encode_message(hello))
        self._put(self._hello)

    @property
    def is_up(self) -> bool:
        """Whether the other end is known, authenticated and not gone."""
        return self.state is _UP

    @property
    def is_closed(self) -> bool:
        """Whether it is over; `reason` is then set."""
        return self.state is _CLOSED

    @property
    def wants_attention(self) -> bool:
        """Whether there is something to send, or the session is over."""
        return bool(self._outbox) or self.state is _CLOSED

    @property
    def missing_bytes(self) -> int:
        """Number of bytes of an incomplete frame that are still missing."""
        return self._reader.missing_bytes

    def take_output(self) -> list[bytes]:
        """Return and forget the frames to send, in order and not sealed yet."""
        frames, self._outbox, self._outbox_bytes = self._outbox, [], 0
        return frames

    def seal(self, frame: bytes) -> bytes:
        """Return a frame as it is sent: with its MAC, if there is a secret.

        Call it once for every frame of the session, from `take_output` and elsewhere, in sending order. So call it
        only when it is certain that the frame is sent, and is the next one; from one thread at a time.
        """
        mac = self._mac_out
        if mac is not None and self._sealed >= FRAMES_WITHOUT_MAC:
            return mac.seal(frame)
        self._sealed += 1  # before the other end's hello, it gets only a hello and a last message
        return frame

    def receive(self, data: bytes, now_s: float) -> list[Any]:
        """Take bytes as they arrive; return the messages in them that are not the session's own: pages.

        Never raises, whatever the bytes: an error closes the session, and `reason` describes it.
        """
        taken: list[Any] = []
        if self.state is _CLOSED:
            return taken
        self.last_received_s = self._silent_since_s = now_s
        if not self._received_s or now_s - self._received_s[-1] >= 0.5 * self.config.keep_alive_s:
            self._received_s.append(now_s)
        try:
            # One at a time until both are authenticated: only then does the other end's size limit grow.
            while self.state is not _UP:
                frames, data = self._reader.feed(data, at_most=1), b""
                if not frames:
                    return taken
                # Of an end that is not authenticated yet, only the greeting is read.
                self._answer_greeting(frames[0], now_s)
                if self.state is _CLOSED:
                    return taken
            decode, mac = self._decode, self._mac_in
            for payload in self._reader.feed(data):
                raw = payload if mac is None else mac.open(payload)
                if raw is None:
                    self._refuse_forged()
                    return taken
                message = decode(raw)
                if type(message) in _CONTROL:
                    self._answer(message, now_s)
                    if self.state is not _UP:
                        return taken
                else:
                    taken.append(message)
        except FrameTooLargeError as error:
            self.refuse(str(error))
        except (msgspec.MsgspecError, SnrError, ValueError, RecursionError, MemoryError, OverflowError) as error:
            self.rejected += self.is_up
            during = "" if self.is_up else " before the greeting was complete"
            self.refuse(f"an invalid message arrived{during}: {error}")
        return taken

    def is_received_steadily(self, since_s: float) -> bool:
        """Return whether the other end has sent something again and again since a time.

        What a busy end reads late, all at once, counts once, however late it is.
        """
        return len(self._received_s) == STEADY_TIMES and self._received_s[0] > since_s

    def reset_idle_timer(self, now_s: float) -> None:
        """Reset the idle timer, because it was this end that did not read."""
        self._silent_since_s = now_s

    def tick(self, now_s: float) -> None:
        """Do what is due: ping the other end; close the session if it has been silent for too long."""
        config = self.config
        if self.is_closed:
            return
        if self.is_up:
            # Recorded in the page of the link, so another text changes the digests of recorded runs.
            what, since_s, limit_s = "nothing was heard", self._silent_since_s, config.timeout_s  # plain: hear
        else:
            what, since_s = "the greeting was not completed", self.begun_s
            limit_s = config.timeout_s if config.greeting_s is None else config.greeting_s
        if now_s - since_s > limit_s:
            self.close(f"{what} for {limit_s:g} s.")
        elif self.is_up and now_s - self._ping_s >= config.keep_alive_s:
            self._ping(now_s)

    def _ping(self, now_s: float) -> None:
        self._ping_s = now_s
        self._send(Ping(now_s))

    def bye(self, reason: str) -> None:
        """End the session in good order."""
        if self.state is not _CLOSED:
            self._send(Bye(reason[:MAX_REASON_CHARS]))
            self.close(reason)

    def refuse(self, reason: str) -> None:
        """End the session and send the reason to the other end."""
        if self.state is not _CLOSED:
            reason = printable_line(reason)  # it may quote received text
            self._send(RefusedMessage(reason))
            self.was_refused = True
            self.close(reason)

    def close(self, reason: str) -> None:
        """Close the session at this end, if it is not closed yet, and send nothing."""
        if self.state is not _CLOSED:
            self.state = _CLOSED
            self.reason = reason

    def _refuse_forged(self) -> None:
        self.was_forged = True
        self.refuse(
            f"a frame came that '{self.peer_node}' did not send, or not now (its MAC is wrong): something between the "
            "two ends adds, changes, repeats or leaves out frames. Try: another cable or network."
        )

    def _answer_greeting(self, payload: bytes, now_s: float) -> None:
        message = decode_control(payload)
        if isinstance(message, HelloMessage) and self.peer is None and self.config.secret is not None:
            self._derive_keys(self.config.secret, encode_frame(payload))
        self._answer(message, now_s)

    def _derive_keys(self, secret: bytes, their_hello: bytes) -> None:
        """Compute the proofs of both ends, and the keys of the frames in each direction."""
        sides, hellos = ("client", "server"), (self._hello, their_hello)
        if self.config.is_server:
            sides, hellos = sides[::-1], hellos[::-1]
        own, other = (
            {use: derive_key(secret, f"{side} {use}", *hellos) for use in ("proof", "frames")} for side in sides
        )
        self._proofs = (own["proof"].hex(), other["proof"].hex())
        self._mac_out, self._mac_in = FrameMac(own["frames"]), FrameMac(other["frames"])

    def _answer(self, message: Control, now_s: float) -> None:
        match message:
            case Bye():
                self.was_left = True
                self.close(f"'{self.peer_node}' left: {printable_line(message.reason)}")
            case RefusedMessage():
                self.was_refused = True
                self.close(f"the other end refused: {printable_line(message.reason)}")
            case HelloMessage() if self.peer is None:
                self._greet(message, now_s)
            case Auth() if self.state is SessionState.proving:
                self._check(message, now_s)
            case Ping() if self.is_up:
                self._offsets_s.append(now_s - message.stamp_s)
                self.clock_offset_s = min(self._offsets_s)  # of the quickest ping
                self._send(Pong(message.stamp_s))
            case Pong() if self.is_up:
                if message.stamp_s == self._ping_s:
                    self.rtt_s = max(0.0, now_s - message.stamp_s)
            case _:
                self.refuse(f"a {message.__struct_config__.tag} came out of turn.")

    def _greet(self, hello: HelloMessage, now_s: float) -> None:
        config = self.config
        has_secret = config.secret is not None
        if hello.protocol != PROTOCOL or hello.version != VERSION:
            self.refuse(
                f"node '{config.node}' speaks {PROTOCOL} version {VERSION}, the other end {hello.protocol} version "
                f"{hello.version}. Try: the same release of snr_sim on both."
            )
        elif not hello.node.isprintable():
            self.refuse(
                f"the other end names itself {hello.node!a}, with characters that no terminal shows. "
                "Try: a role's name of letters, digits and underscores."
            )
        elif hello.purpose != config.purpose:
            self.refuse(
                f"node '{config.node}' is here for {config.purpose}, node '{hello.node}' for {hello.purpose}. "
                "Try: is that the right port?"
            )
        elif hello.auth != has_secret:
            who, other = (config.node, hello.node) if has_secret else (hello.node, config.node)
            self.peer, self.peer_node = hello, hello.node  # since the hello is valid, although the end is not trusted
            what, fix = config.secret_is
            self.refuse(f"node '{who}' asks for a {what}, node '{other}' has none. Try: {fix}.")
        else:
            self.peer, self.peer_node = hello, hello.node
            if not has_secret:
                self._go_up(now_s)
                return
            self.state = SessionState.proving
            if not config.is_server:  # the client proves first: a server reveals nothing to unauthenticated clients
                self._send(Auth(self._proofs[0]))

    def _check(self, auth: Auth, now_s: float) -> None:
        own, other = self._proofs
        if not hmac.compare_digest(auth.proof, other):
            what, fix = self.config.secret_is
            self.refuse(
                f"the {what}s of the two ends differ, or a third party forwarded or changed a greeting. Try: {fix}."
            )
            return
        if self.config.is_server:
            self._send(Auth(own))
        self._go_up(now_s)

    def _go_up(self, now_s: float) -> None:
        self.state = SessionState.up
        self._ping(now_s)  # before any page, so that the other end knows the age of our first page
        self._reader.max_bytes = self.config.max_frame_bytes + (0 if self._mac_in is None else MAC_BYTES)

    def _send(self, message: Control) -> None:
        self._put(encode_frame(encode_message(message)))

    def _put(self, frame: bytes) -> None:
        self._outbox.append(frame)
        self._outbox_bytes += len(frame)
        if self._outbox_bytes > MAX_WAITING_BYTES:
            self.close("the other end does not read its answers.")


def printable_line(reason: str) -> str:
    """Return a reason without control characters: the remote peer wrote it, and an operator's terminal shows it.

    >>> printable_line("gone.\\n  Try: \\x1b[2J")
    'gone. Try: \\\\x1b[2J'
    """
    return visible(" ".join(reason[:MAX_REASON_CHARS].split()))[:MAX_REASON_CHARS]
