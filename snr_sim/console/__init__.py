"""Console: commands to a running node, typed by a user or sent by a program."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.console.client import ConsoleClient as ConsoleClient
    from snr_sim.console.command_receiver import CommandReceiver as CommandReceiver
    from snr_sim.console.command_receiver import CommandReceiverFactory as CommandReceiverFactory
    from snr_sim.console.local_console import LocalConsole as LocalConsole
    from snr_sim.console.local_console import LocalConsoleFactory as LocalConsoleFactory
    from snr_sim.console.remote_console import RemoteConsole as RemoteConsole
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
