"""Base of the loops that serve WebSockets to browsers and tools: addresses, tokens, and the packages that it takes."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec

from snr_sim.links.security import is_loopback
from snr_sim.links.server_loop import ServerLoop, ServerLoopFactory
from snr_sim.prelude.errors import ConfigError, MissingExtraError
from snr_sim.web.access import Access


class WebLoopFactory(ServerLoopFactory):
    """Factory of a loop that serves at one address of this machine; arguments as of `LiveLoopFactory`.

    Args:
        is_for_programs: whether programs other than browsers may connect, with the token in the address.

    Raises:
        ConfigError: the address or the token cannot be used.
        MissingExtraError: the packages of the extra 'web' are not installed.
    """

    def __init__(
        self,
        port: int,
        host: str,
        token: str | bytes | None,
        name: str,
        *,
        who: str,
        token_fix: str,
        is_for_programs: bool = False,
    ) -> None:
        super().__init__(port, host, token, name, who=who, token_fix=token_fix)
        if host in ("0.0.0.0", "::", ""):
            raise ConfigError(
                f"{who} cannot be on all addresses ({host!r}): requests are accepted for one name only.",
                fix="one address of this computer: `ip address` shows them.",
            )
        check_packages()
        tokens = {} if self.token is None else {"token": self.token.decode("ascii", "replace")}
        self._access = Access(host, port, **tokens, is_for_programs=is_for_programs)

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach it."""
        return is_loopback(self.host)

    @property
    def access(self) -> Access:
        """Its address and tokens."""
        return replace(self._access, port=self.port)  # which is known once it listens


def check_packages() -> None:
    """Check that what serves pages is installed.

    Raises:
        MissingExtraError: it is not.
    """
    for package in ("starlette", "uvicorn", "websockets"):
        if find_spec(package) is None:
            raise MissingExtraError(package, "web")


class WebLoop(ServerLoop):
    """Loop that serves WebSockets."""

    factory: WebLoopFactory

    def begin(self) -> None:
        """Listen, and start the thread.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        import_module("snr_sim.web.server")  # takes 0.2 s, in which the robot's thread would wait for it later
        super().begin()
