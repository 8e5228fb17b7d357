"""`snr machine view RUN`: the live page over a run that has been recorded, or is being recorded."""

from __future__ import annotations

import asyncio
from contextlib import closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from snr_sim.cli.output import print_text
from snr_sim.cli.stopping import signals_call
from snr_sim.prelude.errors import SnrError

if TYPE_CHECKING:
    from snr_sim.behaviors.bridge import Bridge

LOOPBACK = "127.0.0.1"


def view(run: Path, name: str, port: int, *, is_trusted: bool) -> None:
    """Serve the page until Ctrl-C.

    Args:
        run: its folder, or its trace.
        name: of the machine; empty if there is one only.
        port: 0 takes a free one.
        is_trusted: whether the run's files may be executed to explain it, also those of another user.
    """
    from snr_sim.links.socket_port import listen
    from snr_sim.recording.folder import trace_path
    from snr_sim.web.access import Access
    from snr_sim.web.recorded_machine import RecordedMachine
    from snr_sim.web.session import MachinePage
    from snr_sim.web.timeline import header_of
    from snr_sim.web.web_loop import check_packages

    check_packages()
    from snr_sim.web.server import serve

    path = trace_path(run)
    header = header_of(path)
    title = f"{header.scenario or path.parent.name}, seed {header.seed}"
    machine = RecordedMachine(path.parent, name, title, _bridge_of(header.robot), is_trusted=is_trusted)
    with closing(machine), closing(listen(LOOPBACK, port, "The page")) as sock:
        access = Access(LOOPBACK, sock.getsockname()[1])
        print_text(f"Open {access.url}\nOnly this computer can reach it. Ctrl-C ends it.", flush=True)
        ending = asyncio.Event()
        with suppress(KeyboardInterrupt), asyncio.Runner() as runner:
            loop = runner.get_loop()
            with signals_call(lambda: loop.call_soon_threadsafe(ending.set)):
                runner.run(serve([MachinePage(machine)], access, sock, ending))


def _bridge_of(robot: str) -> Bridge | None:
    """Return the parts of a robot that is installed here; None if it is not, or if it has none."""
    from snr_sim.scenario.library import bridge_of_robot

    if not robot or Path(robot).name != robot:  # a trace may be of another user: it names a robot, and no file
        return None
    with suppress(SnrError):
        return bridge_of_robot(robot)
    return None
