"""`snr run --live`: a page in the browser for the state machines of a run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from snr_sim.cli.output import print_note
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import ParameterError

if TYPE_CHECKING:
    from snr_sim.core.config import Config
    from snr_sim.web.live import LiveLoopFactory

LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class LivePage:
    """A live page that was asked for.

    Args:
        port: 0 takes a free one.
        host: address of this computer on which it is served.
        token_file: has the token of the page; a new token is made if it is None.
    """

    port: int = 0
    host: str = LOOPBACK
    token_file: Path | None = None

    @staticmethod
    def of_options(is_asked: bool, port: int, host: str, token_file: Path | None) -> LivePage | None:
        """Return what the options of `snr run` ask for, or None; raise ParameterError for one without `--live`."""
        if is_asked:
            return LivePage(port, host, token_file)
        if (port, host, token_file) != (0, LOOPBACK, None):
            raise ParameterError("--live-port, --live-host and --live-token-file are of --live.", fix="add --live.")
        return None


def add_live_page(config: Config, roles: Sequence[str], page: LivePage, title: str) -> LiveLoopFactory:
    """Add the page to the first of the roles that run which has a state machine; return its factory.

    Raises:
        ParameterError: no role has a state machine.
        ConfigError: the address or the token cannot be used.
        MissingExtraError: what serves pages is not installed.
    """
    from snr_sim.behaviors.endpoint import MachineFactory  # here: runs without a page do not need them
    from snr_sim.links.security import secret_from_file
    from snr_sim.scenario.machine_controller import FIX_WITHOUT_MACHINE
    from snr_sim.web.live import LiveLoopFactory

    found = [role for role in roles if any(isinstance(one, MachineFactory) for one in config.get(role))]
    if not found:
        raise ParameterError("--live shows state machines, and this run has none.", fix=FIX_WITHOUT_MACHINE)
    token = None if page.token_file is None else secret_from_file(page.token_file)
    live = LiveLoopFactory(page.port, page.host, token, title)
    if found[1:]:
        print_note(f"The live page shows the machines of role '{found[0]}' only, not those of {', '.join(found[1:])}.")
    config.get(found[0]).insert(0, live)  # first, so that it sees the machines begin
    return live


def print_address(live: LiveLoopFactory) -> None:
    """Print where the page is, and who can reach it."""
    if live.is_loopback:
        reach = "Only this computer can reach it"
    else:
        reach = (
            "Every computer in that network can reach it, and any client that reads its traffic can take the token and "
            "steer the robot"
        )
    print_line(sys.stderr, f"Open {live.access.url}\n  {reach}, as long as the run lasts.")
    print_line(sys.stderr, f"  To look and not to touch: {live.access.read_url}")
