"""Conversation: a node's end of the connection to one remote console. Owns no port: bytes and time in, bytes out.

All its parts are bounded: received bytes that are not decoded yet, command lines that wait, answers that are not read.
"""

from __future__ import annotations

from collections import deque

from snr_sim.console.session import Session
from snr_sim.console.table import Answer
from snr_sim.console.wire import Command, Complete, completed, decode_asked, replied
from snr_sim.links.allowance import Allowance
from snr_sim.links.session import Session as WireSession
from snr_sim.links.session import Terms

OUTPUT_MAX_BYTES = 1 << 17  # from this size on, no lines are answered and no bytes read until the console has read
LINES_PER_S = 500.0  # of all consoles together: limits their load on the node's computer
LINES_AT_ONCE = 100.0


class Conversation:
    """Protocol state of one console's connection.

    Args:
        terms: session settings of the node's end.
        session: carries out commands.
        now_s: the time, always of the same clock.
        allowance: shared with other conversations.
    """

    def __init__(self, terms: Terms, session: Session, now_s: float, allowance: Allowance) -> None:
        self.wire = WireSession(terms, now_s, decode_asked)
        self.output = bytearray()
        self.session = session
        self._allowance = allowance
        self._waiting_number = 0  # of the command whose result is not known yet
        self._asked: deque[Command | Complete] = deque()
        self._flush()

    @property
    def is_over(self) -> bool:
        """Whether nothing more is to be read; `output` may still have to be sent."""
        return self.wire.is_closed

    @property
    def wants_bytes(self) -> bool:
        """Whether all earlier data is handled and the console has read the answers."""
        return not (self._asked or self.is_over or len(self.output) > OUTPUT_MAX_BYTES)

    @property
    def is_busy(self) -> bool:
        """Whether there is work as soon as the allowance permits."""
        return bool(self._asked) and len(self.output) <= OUTPUT_MAX_BYTES and not self.session.is_waiting

    def receive(self, data: bytes, now_s: float) -> None:
        """Handle received bytes."""
        self._asked += self.wire.receive(data, now_s)
        self._flush()

    def work(self, now_s: float) -> None:
        """Answer waiting lines, show watched pages that have changed, and do periodic work."""
        outcome = self.session.outcome(now_s)
        if outcome is not None:
            self._send(replied(self._waiting_number, outcome))
        while self.is_busy and not self.is_over and self._allowance.take(now_s):
            self._answer(self._asked.popleft())
        if self._asked and len(self.output) <= OUTPUT_MAX_BYTES:
            self.wire.forgive_silence(now_s)  # this end does not read, so it cannot notice a silent console
        if self.wire.is_up and len(self.output) <= OUTPUT_MAX_BYTES:
            for answer in self.session.changes(now_s):
                self._send(replied(0, answer))
        self.wire.tick(now_s)
        self._flush()

    def end(self, reason: str) -> None:
        """Say goodbye; a client that waits for a command's result is notified that none will arrive here."""
        if self.wire.is_up and self.session.is_waiting:
            text = f"This line ends before it is known what came of the command; {reason} Try: dump, on a new line."
            self._send(replied(self._waiting_number, Answer(text, is_error=True)))
        self.wire.bye(reason)
        self._flush()

    def refuse(self, reason: str) -> None:
        """End the connection as rejected, with a reason."""
        self.wire.refuse(reason)
        self._flush()

    def _answer(self, asked: Command | Complete) -> None:
        if isinstance(asked, Command):
            answer = self.session.answer(asked.line)
            if self.session.is_waiting:
                self._waiting_number = asked.number
            else:
                self._send(replied(asked.number, answer))
        else:
            self._send(completed(asked.number, self.session.complete(asked.line)))

    def _flush(self) -> None:
        for frame in self.wire.take_output():
            self._send(frame)

    def _send(self, frame: bytes) -> None:
        self.output += self.wire.seal(frame)
