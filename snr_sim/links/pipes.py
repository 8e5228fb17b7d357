"""Links over a `multiprocessing.Pipe()`: between processes of one machine, without an address. Frames, no pickles."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing import Pipe
from typing import TYPE_CHECKING

from snr_sim.core.clocks import SimClock
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.options import LinkOptions, as_keys
from snr_sim.links.session import Terms
from snr_sim.links.simulated import Meeting, SimulatedLink
from snr_sim.links.streams import StreamLink
from snr_sim.prelude.errors import LinkError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


class PipePort:
    """One end of a two-way pipe as a port.

    Args:
        conn: the end; the port closes it.

    Raises:
        LinkError: it is one-way, or this system's pipes cannot be waited for together with others.
    """

    is_shareable = True

    def __init__(self, conn: Connection) -> None:
        if os.name == "nt":
            raise LinkError("Links over pipes need a POSIX system.", fix="SocketsPair(('127.0.0.1', 0)).")
        if not (conn.readable and conn.writable):
            raise LinkError("A link over a pipe that goes one way only.", fix="multiprocessing.Pipe(), without False.")
        self._conn = conn
        os.set_blocking(conn.fileno(), False)

    def fileno(self) -> int:
        """Returns the pipe's descriptor."""
        return self._conn.fileno()

    def read(self, most: int) -> bytes:
        """Returns what has come; see Port."""
        return os.read(self._conn.fileno(), most)

    def has_more(self) -> bool:
        """Return False: `select` shows all that has come; see Port."""
        return False

    def write(self, data: bytes | memoryview) -> int:
        """Sends what fits; see Port."""
        return os.write(self._conn.fileno(), data)

    def end_writing(self) -> None:
        """Does nothing: a pipe ends when it is closed, and the goodbye has been said."""

    def close(self) -> None:
        """Closes the pipe."""
        self._conn.close()


class PipeLoopFactory(LoopFactory):
    """Makes a link over one end of a pipe.

    Args:
        conn: one end of `multiprocessing.Pipe()`; the other is for the other process.
        data_keys: pages of these go out.
        accept: pages of these may come in; any if None.
        name: the link is component and page `link_<name>`.
        is_first: whether this is the end that greets first; nothing depends on which of them does.
        meeting: where both ends meet under a SimClock; without it such a link is down.
        options: all else.
    """

    def __init__(
        self,
        conn: Connection,
        data_keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
        *,
        name: str = "pipe",
        is_first: bool = True,
        meeting: Meeting | None = None,
        options: LinkOptions | None = None,
    ) -> None:
        super().__init__()
        self.conn = conn
        self.is_first = is_first
        self.meeting = meeting or Meeting()
        wanted = None if accept is None else frozenset(as_keys(accept))
        self.options = replace(options or LinkOptions(name), keys=as_keys(data_keys), accept=wanted)

    def claim(self) -> None:
        """Does nothing: a pipe is open from the start; see PortFactory."""

    def release(self) -> None:
        """Closes this end; see PortFactory."""
        self.conn.close()

    def get(self, parent: NodeApi) -> Loop:
        """Returns the link."""
        options = self.options
        terms = Terms(
            parent.name,
            is_server=not self.is_first,
            max_frame_bytes=options.max_frame_bytes,
            keep_alive_s=options.keep_alive_s,
            timeout_s=options.timeout_s,
            greeting_s=float("inf"),  # the other process may take its time to start, and a pipe is made only once
        )
        if isinstance(parent.clock, SimClock):
            return SimulatedLink(self, parent, options, terms, self.meeting)
        return PipeLink(self, parent, options, terms)


class PipesPair:
    """A pipe and the links at its two ends, named as those of a SocketsPair.

    Args:
        options: of both; keys are given to `client` and `server`.
    """

    def __init__(self, options: LinkOptions | None = None) -> None:
        self.options = options or LinkOptions("pipe")
        self.client_conn, self.server_conn = Pipe()
        self.meeting = Meeting()

    def client(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> PipeLoopFactory:
        """Returns the factory of one end; see `SocketsPair.client`."""
        return PipeLoopFactory(
            self.client_conn, keys, accept, is_first=True, meeting=self.meeting, options=self.options
        )

    def server(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> PipeLoopFactory:
        """Returns the factory of the other end."""
        return PipeLoopFactory(
            self.server_conn, keys, accept, is_first=False, meeting=self.meeting, options=self.options
        )


class PipeLink(StreamLink):
    """One stream, from begin to end: a pipe that is closed does not come back."""

    factory: PipeLoopFactory

    def _open_ports(self, ports: ExitStack) -> None:
        super()._open_ports(ports)
        if not self.is_shut:  # else the link's failure has closed the pipe, and it stays down
            self._add_stream(PipePort(self.factory.conn), "pipe")
