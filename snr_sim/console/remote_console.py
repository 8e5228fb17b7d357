"""RemoteConsole: commands from a user or a script to a node in another process or on another machine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from snr_sim.console.client import ConsoleClient
from snr_sim.console.parsing import CommandResult
from snr_sim.prelude.errors import LinkError
from snr_sim.prelude.text import visible

WAIT_S = 5.0  # a node may only just be starting


class RemoteConsole:
    """Sends commands to a node: given ones, or those that a user types, with history and completion.

    Args:
        server_tuple: host and port of the node's CommandReceiver.
        commands: lines to execute, in order; a user is prompted if None.
        token: that of the node, if it has one.
        retry_wait_s: delay between two attempts to connect.
        wait_s: how long `commands` wait for a node that does not answer.

    Raises:
        ConfigError: the token is too short.

    Example:
        answers = RemoteConsole(("127.0.0.1", 54321), ["task start", "dump depth_m"]).run()
    """

    def __init__(
        self,
        server_tuple: tuple[str, int],
        commands: Iterable[str] | None = None,
        token: str | bytes | None = None,
        retry_wait_s: float = 0.5,
        wait_s: float = WAIT_S,
    ) -> None:
        self.commands = commands
        self.client: ConsoleClient = ConsoleClient(server_tuple, token, retry_wait_s, self.show, self.print_line)
        self._wait_s = wait_s

    def run(self) -> Sequence[CommandResult]:
        """Return the answers to `commands`, or prompt the user until they leave; raise LinkError if no node answers."""
        with self.client:
            if self.commands is None:
                self._prompt_user()
                return []
            self.client.wait_until_up(self._wait_s)
            return [self.client.ask(line) for line in self.commands if line.strip()]

    def show(self, answer: CommandResult) -> None:
        """Print an answer; those of watched pages arrive without a command."""
        print(visible(answer.text), flush=True)

    def print_line(self, sentence: str) -> None:
        """Print the state of the connection for a user; a script gets an error instead."""
        if self.commands is None:
            print(visible(f"-- {sentence}"), flush=True)

    def _prompt_user(self) -> None:
        from snr_sim.console.prompt import typed_lines  # takes 0.1 s to import, and only users need it

        with typed_lines(self.client) as lines:
            for line in lines:
                try:
                    self.show(self.client.ask(line))
                except LinkError as error:
                    self.print_line(str(error))
                if self.client.was_refused:
                    raise LinkError(f"The node at {self.client.host}:{self.client.port}: {self.client.reason}")
