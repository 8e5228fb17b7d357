"""The page of a machine: its connections, each of which is sent what has changed."""

from __future__ import annotations

import re
from contextlib import suppress

from snr_sim.web.messages import Gone, encode
from snr_sim.web.pages import HungUpError, Rights, Send, Session
from snr_sim.web.session import MachineSession, ShownMachine


class MachinePage:
    """A page at `/machine/NAME/`. Implements Page.

    Args:
        machine: what it shows.
    """

    shell = "live.html"

    def __init__(self, machine: ShownMachine) -> None:
        self.path: str = f"machine/{re.sub(r'[^A-Za-z0-9_.-]', '_', machine.name)}"
        self.title: str = f"{machine.name}: {machine.title}"
        self._machine = machine
        self._sessions: list[MachineSession] = []

    def open(self, rights: Rights, send: Send) -> MachineSession:
        """Return the session of a new connection."""
        session = MachineSession(self._machine, rights, send)
        self._sessions.append(session)
        return session

    def close(self, session: Session) -> None:
        """Forget a connection: it has been closed."""
        assert isinstance(session, MachineSession)
        session.close()
        self._sessions.remove(session)

    def tick(self, now_s: float) -> None:
        """Send what has changed."""
        self._machine.update(now_s)
        if not self._sessions:
            return
        state = self._machine.newest()
        for session in list(self._sessions):
            with suppress(HungUpError):  # it reads nothing: the server closes it
                session.show(state, now_s)

    def gone(self, reason: str) -> None:
        """Send that the server ends."""
        for session in list(self._sessions):
            with suppress(HungUpError):
                session.send(Gone(reason))

    def goodbye(self, reason: str) -> bytes:
        """Return the last message of a connection."""
        return encode(Gone(reason))
