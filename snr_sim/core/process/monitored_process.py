"""A child process that is monitored: it gets its start data, begins when it is ready, and is shut down gracefully.

owner's thread            threads of the child process               the process (core/process/spawned.py)
send, end, kill   --->    writer: "begin", "go", messages, "end"  --->   `execute_messages`
on_message, on_end  <---  listener: "ready", messages, prints     <---   the target function
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from queue import SimpleQueue
from typing import Any, TypeAlias

from snr_sim.core.process.spawn import SpawnedProcess, describe_exit
from snr_sim.prelude.errors import ValueEncodingError

Message: TypeAlias = tuple[Any, ...]


class MonitoredProcess:
    """A child process and the two threads that exchange messages with it.

    Args:
        name: for messages, such as "loop 'eye'".
        target: "module:function"; see `SpawnedProcess`.
        order: its start data: plain values.
        on_message: gets the kind and values of each message, on the listener's thread; and on the writer's thread
            "unsendable" with the error and a message that cannot be sent.
        on_end: gets the exit status, and what `on_message` raised or None, on the listener's thread.
        descriptors: that it inherits.
        out, err: get the lines that it prints; see `SpawnedProcess`.

    Raises:
        ConfigError: processes cannot be started here.
    """

    def __init__(
        self,
        name: str,
        target: str,
        order: Mapping[str, Any],
        on_message: Callable[..., None],
        on_end: Callable[[int, Exception | None], None],
        descriptors: list[int],
        out: Callable[[str], None] | None = None,
        err: Callable[[str], None] | None = None,
    ) -> None:
        self.name: str = name
        self.is_killed: bool = False  # killed by this process: too late, or before it had begun
        self._on_message, self._on_end = on_message, on_end
        self._process = SpawnedProcess(target, descriptors, out, err)
        self._process.line.user = f"{name[0].upper()}{name[1:]}"
        self._outbox: SimpleQueue[Message | Callable[[], Message] | None] = SimpleQueue()
        self._outbox.put(("begin", order))
        self.listener: threading.Thread = threading.Thread(target=self._listen, name=f"{name} listener", daemon=True)
        self._writer = threading.Thread(target=self._write, name=f"{name} writer", daemon=True)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def last_lines(self) -> list[str]:
        """Its last lines on stderr."""
        return list(self._process.last)

    def start(self) -> None:
        """Start the threads; messages sent before are not lost."""
        self._writer.start()
        self.listener.start()

    def send(self, message: Message | Callable[[], Message]) -> None:
        """Queue a message, or a function that returns it at the time of sending; never waits. From any thread."""
        self._outbox.put(message)

    def end(self, how: str = "") -> None:
        """Request a graceful shutdown; a process that has not begun needs none and is killed."""
        self._outbox.put(("end", how))

    def kill(self) -> None:
        """Kill it."""
        self.is_killed = True
        self._process.kill()

    def exit_message(self, status: int, when: str, otherwise: str) -> str:
        """Return a message on how the process ended, for one that did not report it itself.

        Args:
            status: its exit status.
            when: text after the status.
            otherwise: text to use if it had printed nothing.
        """
        lines = "".join(f"\n    {line}" for line in self.last_lines)
        last_lines = f"Its last lines:{lines}" if lines else otherwise
        return f"The process of {self.name} {describe_exit(status)}{when}. {last_lines}"

    # The writer's thread is the only one that sends, so the listener never waits for a process that does not read.

    def _write(self) -> None:
        has_begun = False
        while (message := self._outbox.get()) is not None:
            if callable(message):
                message = message()
            if message[0] == "go":
                has_begun = not self.is_killed
            elif message[0] == "end" and not has_begun:
                self.kill()
            if self.is_killed:
                continue
            try:
                self._process.line.send(*message)
            except ValueEncodingError as error:
                self._on_message("unsendable", error, message)

    def _listen(self) -> None:
        failure = None
        try:
            status = self._process.receive_loop(self._receive)
        except Exception as error:
            failure = error
            self.kill()
            status = self._process.receive_loop(lambda raw: None)
        self._outbox.put(None)
        self._writer.join()
        self._on_end(status, failure)

    def _receive(self, raw: bytes) -> None:
        kind, *values = self._process.line.decode(raw)
        if kind == "ready":
            self._outbox.put(("go",))
        else:
            self._on_message(kind, *values)
