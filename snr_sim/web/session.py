"""The page of a machine, and one browser's connection to it: messages in and out, without a socket.

What it may ask of a machine is bounded here: how often, how much at once, and who may change anything.
"""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, TypeAlias

import msgspec

from snr_sim.links.token_bucket import TokenBucket
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.values import JSON_ERRORS
from snr_sim.web.live_machine import LiveMachine
from snr_sim.web.messages import (
    Do,
    Edit,
    Edited,
    FromPage,
    FromServer,
    Give,
    Gone,
    HungUpError,
    Refused,
    Rights,
    SetValue,
    Show,
    State,
    Timeline,
    Try,
    Why,
    decode_from_page,
    encode,
)
from snr_sim.web.recorded_machine import RecordedMachine

MESSAGES_PER_S, MESSAGES_AT_ONCE = 200.0, 400.0
CHANGES_PER_S, CHANGES_AT_ONCE = 50.0, 50.0  # edits, variables, buttons
MAX_CHANGES = 200  # of state in one message
MOMENTS_PER_MESSAGE, MAX_TIMELINES = 2000, 32
MAX_QUESTIONS = 4  # that are being answered
IDLE_PERIOD_S = 0.2  # of messages while nothing but time and ages change
Send: TypeAlias = Callable[[bytes], None]  # queues a message for the browser; HungUpError if too many wait


class MachineSession:
    """A connection.

    Args:
        machine: what it shows.
        rights: of the browser.
        send: queues a message for it.
    """

    def __init__(self, machine: LiveMachine | RecordedMachine, rights: Rights, send: Send) -> None:
        self._machine = machine
        self._rights = rights
        self._send = send
        self._messages = TokenBucket(MESSAGES_PER_S, MESSAGES_AT_ONCE)
        self._changes = TokenBucket(CHANGES_PER_S, CHANGES_AT_ONCE)
        self._answering: set[asyncio.Task[None]] = set()
        self._shown: object = None  # the content of the last state, without times and ages
        self._shown_s = float("-inf")
        self._numbers: set[int] = set()  # of the programs that the browser has
        self._count = 0  # of the changes that it has
        self._generation = 0
        self._begin()

    def _begin(self) -> None:
        """Send what a browser needs first."""
        hello = self._machine.hello(self._rights)
        self._generation, self._numbers = self._machine.generation, {hello.number}
        self._count = self._machine.moments.count
        self.send(hello)
        self._send_timeline(hello.until_s)

    def send(self, message: FromServer) -> None:
        """Send a message."""
        self._send(encode(message))

    def _send_timeline(self, until_s: float) -> None:
        moments, _ = self._machine.moments.since(0, self._count)
        size = max(MOMENTS_PER_MESSAGE, len(moments) // MAX_TIMELINES + 1)
        for i in range(0, max(len(moments), 1), size):
            self.send(Timeline(moments[i : i + size], until_s, i + size >= len(moments)))

    def show(self, state: State, now_s: float) -> None:
        """Send the newest state, if it is due."""
        if self._generation != self._machine.generation:
            self._begin()
        content = (
            state.number, state.active, state.last, state.variables, state.problems, state.is_paused,
            _values(state.reads), _values(state.drives), self._machine.moments.count,
        )  # fmt: skip
        if content == self._shown and now_s - self._shown_s < IDLE_PERIOD_S:
            return
        self._shown, self._shown_s = content, now_s
        changes, missed = self._machine.moments.since(self._count, MAX_CHANGES)
        self._count = self._machine.moments.count
        self._send_state(msgspec.structs.replace(state, changes=changes, missed=missed))

    def _send_state(self, state: State) -> None:
        if state.number not in self._numbers:
            program = self._machine.program(state.number)
            if program is not None:
                self._numbers.add(state.number)
                self.send(program)
        self.send(state)

    def receive(self, data: str | bytes) -> None:
        """Handle a message of the browser.

        Raises:
            HungUpError: it is not a message, or there are too many.
        """
        if not self._messages.take(time.monotonic()):
            raise HungUpError(f"More than {MESSAGES_PER_S:g} messages a second.")
        try:
            message = decode_from_page(data)
        except JSON_ERRORS as error:
            raise HungUpError(f"What came is not a message: {error}.") from None
        try:
            self._carry_out(message)
        except SnrError as error:
            self.refuse(message, str(error))

    def _carry_out(self, message: FromPage) -> None:
        match message:
            case Show():
                self._answer(message, partial(self._show_moment, message.t_s))
                return
            case Why():
                self._answer(message, partial(self._explain, message))
                return
        if self._rights != "change":
            self.refuse(message, "This address may only look. The one with ?token= may change the machine.")
            return
        machine = self._machine
        if isinstance(machine, RecordedMachine):
            self.refuse(message, "A recorded run cannot be changed. Try: snr run SCENARIO --live for one that can.")
            return
        if not self._changes.take(time.monotonic()):
            raise HungUpError(f"More than {CHANGES_PER_S:g} changes a second.")
        match message:
            case Edit():
                machine.edit(message, self.answer_edit)
            case Try():
                self._answer(message, partial(self._rehearse, machine, message))
            case SetValue():
                machine.set_value(message.path, message.value)
            case Give():
                machine.give(message.signal)
            case Do(what="undo"):
                machine.undo(self.answer_edit)
            case Do():
                machine.press(message.what)

    def refuse(self, message: msgspec.Struct, reason: str) -> None:
        """Send that a message was not carried out."""
        self.send(Refused(str(message.__struct_config__.tag), reason))

    def answer_edit(self, edited: Edited) -> None:
        """Send the answer to an edit, unless the browser reads nothing: then its connection is being closed."""
        with suppress(HungUpError):
            self.send(edited)

    def _answer(self, message: Show | Why | Try, work: Callable[[], Awaitable[None]]) -> None:
        """Answer later, while other messages are handled."""
        if len(self._answering) >= MAX_QUESTIONS:
            self.refuse(message, f"{MAX_QUESTIONS} questions are being answered: wait for one of them.")
            return
        task = asyncio.get_running_loop().create_task(self._without_errors(message, work))
        self._answering.add(task)
        task.add_done_callback(self._answering.discard)

    async def _without_errors(self, message: Show | Why | Try, work: Callable[[], Awaitable[None]]) -> None:
        with suppress(HungUpError):  # the browser reads nothing, and its connection is being closed
            try:
                await work()
            except SnrError as error:
                self.refuse(message, str(error))

    async def _show_moment(self, t_s: float) -> None:
        self._send_state(await self._machine.state_at(t_s))

    async def _explain(self, asked: Why) -> None:
        self.send(await self._machine.explanations.of(asked))

    async def _rehearse(self, machine: LiveMachine, asked: Try) -> None:
        self.send(await machine.explanations.rehearsal(machine.name, *machine.with_text(asked), asked.at_s))

    def close(self) -> None:
        """End what is being answered."""
        for task in list(self._answering):
            task.cancel()


class MachinePage:
    """A page at `/machine/NAME/`, on the server's thread.

    WebSocket of /<path>/socket --> open --> MachineSession.receive
    30 times a second           --> tick --> `send` of its sessions

    Args:
        machine: what it shows.
    """

    shell = "live.html"

    def __init__(self, machine: LiveMachine | RecordedMachine) -> None:
        self.path: str = f"machine/{re.sub(r'[^A-Za-z0-9_.-]', '_', machine.name)}"
        self.title: str = f"{machine.name}: {machine.title}"
        self._machine = machine
        self._sessions: list[MachineSession] = []

    def open(self, rights: Rights, send: Send) -> MachineSession:
        """Return the session of a new connection."""
        session = MachineSession(self._machine, rights, send)
        self._sessions.append(session)
        return session

    def close(self, session: MachineSession) -> None:
        """Forget a connection: it has been closed."""
        session.close()
        self._sessions.remove(session)

    def tick(self, now_s: float) -> None:
        """Send what has changed; `now_s` is wall time."""
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
        """Return the last message of a connection that the server closes."""
        return encode(Gone(reason))


def _values(parts: Mapping[str, Any]) -> dict[str, Any]:
    return {name: one.value for name, one in parts.items()}
