"""RemoteConsole: a person, or a script, gives commands to a node that runs somewhere else."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from snr_sim.console.client import ConsoleClient
from snr_sim.console.table import Answer
from snr_sim.prelude.errors import LinkError

WAIT_S = 5.0  # for a node that is only just starting


class RemoteConsole:
    """Commands for a node: those given, or what a person types, with history and completion.

    Args:
        server_tuple: host and port of the node's CommandReceiver.
        commands: lines to carry out, one after another; a person is asked if None.
        token: the one the node was given, if any.
        retry_wait_s: between two calls, when the node is not there.
        wait_s: how long `commands` wait for a node that is not there.

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
        self.client = ConsoleClient(server_tuple, token, retry_wait_s, self.show, self.tell)
        self._wait_s = wait_s

    def run(self) -> Sequence[Answer]:
        """Return the answers to `commands`; without them, talks to a person until they leave.

        Raises:
            LinkError: nobody answers there, or the line was lost before an answer came.
        """
        with self.client:
            if self.commands is None:
                self._talk()
                return []
            self.client.wait_until_up(self._wait_s)
            return [self.client.ask(line) for line in self.commands if line.strip()]

    def show(self, answer: Answer) -> None:
        """Print an answer; a watched page's come by themselves."""
        print(answer.text, flush=True)

    def tell(self, sentence: str) -> None:
        """Tell a person how the line is; a script hears of it by an error."""
        if self.commands is None:
            print(f"-- {sentence}", flush=True)

    def _talk(self) -> None:
        from snr_sim.console.prompt import Prompt  # one tenth of a second, and only people need it

        with Prompt(self.client) as lines:
            for line in lines:
                try:
                    self.show(self.client.ask(line))
                except LinkError as error:
                    self.tell(str(error))
                if self.client.was_refused:
                    raise LinkError(f"The node at {self.client.host}:{self.client.port}: {self.client.reason}")
