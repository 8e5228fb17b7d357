"""Messages between a program and a process of its own that serves it, and the port that carries them.

Each message is JSON, never a pickle; neither end accepts more than `MAX_BYTES`.
"""

from __future__ import annotations

import select
import subprocess
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

import msgspec

from snr_sim.core.process.spawn import describe_exit, start_process
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.task import ensure_type_info
from snr_sim.prelude.values import JSON_ERRORS

MAX_BYTES = 8192  # far less than the pipe's buffer
END_S = 5.0

MessageT = TypeVar("MessageT", bound=msgspec.Struct)


class MessageCodec(Generic[MessageT]):
    """Messages as bytes.

    Args:
        types: union of their structs, which have tags.
        peer: what they are exchanged with, for errors.
    """

    def __init__(self, types: Any, peer: str) -> None:
        self._encoder, self._peer = msgspec.json.Encoder(), peer
        self._decoder: msgspec.json.Decoder[MessageT] = msgspec.json.Decoder(ensure_type_info(types))

    def encode(self, message: MessageT) -> bytes:
        """Return a message as bytes; raise a DeviceError if they are too many."""
        body = self._encoder.encode(message)
        if len(body) > MAX_BYTES:
            raise DeviceError(f"A message of {len(body)} bytes to the {self._peer}; at most {MAX_BYTES}.")
        return body

    def decode(self, body: bytes) -> MessageT:
        """Return the message that `encode` wrote; other bytes raise a DeviceError."""
        try:
            return self._decoder.decode(body)
        except JSON_ERRORS as error:
            raise DeviceError(f"{body[:60]!r} is not a {self._peer} message: {error}.") from error

    def receive(self, line: Connection) -> MessageT:
        """Return the next message, as `decode` does.

        EOFError and OSError mean that the other process has ended, or sent more than `MAX_BYTES`.
        """
        return self.decode(line.recv_bytes(MAX_BYTES))


class ProcessPort(Generic[MessageT]):
    """A new Python process, as its program sees it. Only `wait` and `close` block.

    It has its own process group, so that Ctrl-C at a terminal does not reach it. When this program ends in any way, its
    line closes.

    Args:
        target: "module:function" of snr_sim, which gets the other end of the line.
        codec: of the messages.
    """

    def __init__(self, target: str, codec: MessageCodec[MessageT]) -> None:
        self._codec = codec
        self._process, self._line = start_process(target)
        self.pid: int = self._process.pid

    @property
    def has_room(self) -> bool:
        """Whether a message can be written now."""
        return bool(select.select([], [self._line], [], 0)[1])

    def write(self, message: MessageT) -> None:
        """Send a message; raise a DeviceError if the process has ended or does not read."""
        if not self.has_room:
            raise DeviceError(f"The process {self.pid} does not read its input: it hangs.", fix=f"kill -9 {self.pid}")
        try:
            self._line.send_bytes(self._codec.encode(message))
        except OSError as error:
            raise self._ended() from error

    def read(self) -> list[MessageT]:
        """Return the messages that have arrived; raise a DeviceError if the process has ended."""
        messages: list[MessageT] = []
        try:
            while self._line.poll():
                messages.append(self._codec.receive(self._line))
        except (EOFError, OSError) as error:
            if not messages:
                raise self._ended() from error
        return messages

    def wait(self, seconds: float) -> bool:
        """Return whether a message, or the end of the process, has arrived."""
        return self._line.poll(seconds)

    def close(self) -> None:
        """Close its line, which ends the process."""
        self._line.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _ended(self) -> DeviceError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_S)
        status = self._process.returncode
        how = "ended its line" if status is None else describe_exit(status)
        return DeviceError(
            f"The process {self.pid} {how}.", fix="read its output above; `dmesg | tail` shows whether memory ran out."
        )
