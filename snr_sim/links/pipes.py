"""Links over a `multiprocessing.Pipe()`: between processes of one machine, without an address. Frames, not pickles."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterable
from contextlib import ExitStack
from multiprocessing import Pipe
from typing import TYPE_CHECKING

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.link import Link
from snr_sim.links.options import LinkOptions
from snr_sim.links.session import SessionConfig
from snr_sim.links.simulated import Rendezvous, SimulatedTransport
from snr_sim.links.socket_port import SocketPort
from snr_sim.links.streams import Streams
from snr_sim.prelude.errors import LinkError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


def port_of(conn: Connection) -> SocketPort:
    """Return one end of a two-way pipe as a port, which owns its descriptor: POSIX makes such a pipe of two sockets.

    Raises:
        LinkError: it is one-way, or this system does not make its pipes of sockets.
    """
    if os.name == "nt":
        raise LinkError("Links over pipes need a POSIX system.", fix="SocketsPair(('127.0.0.1', 0)).")
    if not (conn.readable and conn.writable):
        raise LinkError("A link needs a pipe for both directions.", fix="use multiprocessing.Pipe() without False.")
    port = SocketPort(socket.socket(fileno=os.dup(conn.fileno())))
    conn.close()
    return port


class PipeLoopFactory(LoopFactory):
    """Makes a link over one end of a pipe.

    Args:
        conn: one end of `multiprocessing.Pipe()`; the other process gets the other.
        data_keys: pages of these keys are sent.
        accept: keys of the pages to accept; any if None.
        name: the link is component and page `link_<name>`.
        is_first: whether this end greets first; it does not matter which of them does.
        rendezvous: where both ends meet under a SimClock; without it, the link is down there.
        options: all other options.
    """

    def __init__(
        self,
        conn: Connection,
        data_keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
        *,
        name: str = "pipe",
        is_first: bool = True,
        rendezvous: Rendezvous[SimulatedTransport] | None = None,
        options: LinkOptions | None = None,
    ) -> None:
        super().__init__()
        self.conn: Connection = conn
        self.is_first: bool = is_first
        self.rendezvous: Rendezvous[SimulatedTransport] = rendezvous or Rendezvous()
        self.options: LinkOptions = (options or LinkOptions(name)).for_end(data_keys, accept)

    def claim(self) -> None:
        """Do nothing: a pipe is open from the start; see PortFactory."""

    def release(self) -> None:
        """Close this end; see PortFactory."""
        self.conn.close()

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        config = SessionConfig(
            parent.name,
            is_server=not self.is_first,
            max_frame_bytes=self.options.max_frame_bytes,
            keep_alive_s=self.options.keep_alive_s,
            timeout_s=self.options.timeout_s,
            greeting_s=float("inf"),  # the other process may start late, and a pipe is made only once
        )
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: PipeEnd(link, config, self.conn),
            simulated=lambda link: SimulatedTransport(link, config, self.rendezvous),
        )


class PipesPair:
    """A pipe and the links at its two ends, with the method names of SocketsPair; `options` are of both."""

    client_conn: Connection
    server_conn: Connection

    def __init__(self, options: LinkOptions | None = None) -> None:
        self.options: LinkOptions = options or LinkOptions("pipe")
        self.client_conn, self.server_conn = Pipe()
        self.rendezvous: Rendezvous[SimulatedTransport] = Rendezvous()

    def client(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> PipeLoopFactory:
        """Return the factory of one end; see `SocketsPair.client`."""
        return PipeLoopFactory(
            self.client_conn, keys, accept, is_first=True, rendezvous=self.rendezvous, options=self.options
        )

    def server(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> PipeLoopFactory:
        """Return the factory of the other end."""
        return PipeLoopFactory(
            self.server_conn, keys, accept, is_first=False, rendezvous=self.rendezvous, options=self.options
        )


class PipeEnd(Streams):
    """One stream, from begin to end: a pipe that is closed cannot be opened again."""

    def __init__(self, link: Link, config: SessionConfig, conn: Connection) -> None:
        super().__init__(link, config)
        self._conn = conn

    def open(self, ports: ExitStack) -> None:
        """Begin the session; see Transport."""
        super().open(ports)
        if not self.link.is_shut:  # after a failure the pipe is closed and stays down
            self._add_stream(port_of(self._conn), "pipe")
