"""ConsoleProtocol: a node's end of the connection to one remote console. Owns no port: bytes and time in, bytes out.

All its parts are bounded: received bytes that are not decoded yet, command lines that wait, answers that are not read.
"""

from __future__ import annotations

from collections import deque

from snr_sim.console.session import ConsoleSession
from snr_sim.console.table import CommandResult
from snr_sim.console.wire import CommandMessage, CompleteMessage, decode_request, encode_completions, encode_reply
from snr_sim.links.session import Session as WireSession
from snr_sim.links.session import SessionConfig
from snr_sim.links.token_bucket import TokenBucket

MAX_OUTPUT_BYTES = 1 << 17  # from this size on, no lines are answered and no bytes read until the console has read
LINES_PER_S = 500.0  # of all consoles together: limits their load on the node's computer
LINES_AT_ONCE = 100.0


class ConsoleProtocol:
    """Protocol state of one console's connection, which shares the token bucket with others."""

    def __init__(self, config: SessionConfig, session: ConsoleSession, now_s: float, token_bucket: TokenBucket) -> None:
        self.wire: WireSession = WireSession(config, now_s, decode_request)
        self.output: bytearray = bytearray()
        self.session: ConsoleSession = session
        self._token_bucket = token_bucket
        self._waiting_number = 0  # of the command whose result is not known yet
        self._requests: deque[CommandMessage | CompleteMessage] = deque()
        self._flush()

    @property
    def is_over(self) -> bool:
        """Whether nothing more is to be read; `output` may still have to be sent."""
        return self.wire.is_closed

    @property
    def wants_bytes(self) -> bool:
        """Whether all earlier data is handled and the console has read the answers."""
        return not (self._requests or self.is_over or len(self.output) > MAX_OUTPUT_BYTES)

    @property
    def is_busy(self) -> bool:
        """Whether there is work as soon as the token bucket permits."""
        return bool(self._requests) and len(self.output) <= MAX_OUTPUT_BYTES and not self.session.is_waiting

    def receive(self, data: bytes, now_s: float) -> None:
        """Handle received bytes."""
        self._requests += self.wire.receive(data, now_s)
        self._flush()

    def work(self, now_s: float) -> None:
        """Answer waiting lines, show watched pages that have changed, and do periodic work."""
        outcome = self.session.outcome(now_s)
        if outcome is not None:
            self._send(encode_reply(self._waiting_number, outcome))
        while self.is_busy and not self.is_over and self._token_bucket.take(now_s):
            self._answer(self._requests.popleft())
        if self._requests and len(self.output) <= MAX_OUTPUT_BYTES:
            self.wire.reset_idle_timer(now_s)  # this end does not read, so it cannot notice a silent console
        if self.wire.is_up and len(self.output) <= MAX_OUTPUT_BYTES:
            for answer in self.session.changes(now_s):
                self._send(encode_reply(0, answer))
        self.wire.tick(now_s)
        self._flush()

    def end(self, reason: str) -> None:
        """Send the goodbye message; a client that waits for a command's result is notified that none will arrive."""
        if self.wire.is_up and self.session.is_waiting:
            text = f"The connection closes before the command has a result: {reason} Try: dump, on a new connection."
            self._send(encode_reply(self._waiting_number, CommandResult(text, is_error=True)))
        self.wire.bye(reason)
        self._flush()

    def refuse(self, reason: str) -> None:
        """End the connection as rejected, with a reason."""
        self.wire.refuse(reason)
        self._flush()

    def _answer(self, request: CommandMessage | CompleteMessage) -> None:
        if isinstance(request, CommandMessage):
            answer = self.session.execute(request.line)
            if self.session.is_waiting:
                self._waiting_number = request.number
            else:
                self._send(encode_reply(request.number, answer))
        else:
            self._send(encode_completions(request.number, self.session.complete(request.line)))

    def _flush(self) -> None:
        for frame in self.wire.take_output():
            self._send(frame)

    def _send(self, frame: bytes) -> None:
        self.output += self.wire.seal(frame)
