"""The link between a vehicle and its surface, configured by `--option` host, port, secret and allow.

It leaves this process only where a role runs by itself. Otherwise both ends are connected in memory, and a secret is
neither needed nor read; so a run that had one can be replayed without it.
"""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Mapping
from typing import Any

from snr_sim.links.faults import LinkFaults
from snr_sim.links.security import as_networks, is_loopback, secret_from_env, secret_from_file
from snr_sim.links.sockets import SocketsPair
from snr_sim.prelude.errors import ConfigError, ParameterError
from snr_sim.prelude.scenario import RobotContext

LOCALHOST = "127.0.0.1"
SECRET_VARIABLE = "SNR_SECRET"  # the name of a variable, not a secret
MAKE_SECRET_COMMAND = 'python3 -c "import secrets; print(secrets.token_hex(16))" > secret.txt'
SECRET_HELP = ("secret", "--option secret=FILE at both ends, with the same text in it, or the same SNR_SECRET in both")
# After this silence either end counts as gone, also one that is connected but hangs: shown within a second.
KEEP_ALIVE_S, GONE_S = 0.2, 0.6


def surface_link(context: RobotContext, vehicle: str, name: str, port: int, faults: LinkFaults) -> SocketsPair:
    """Return the link with the address in the options.

    Args:
        vehicle: the role that listens.
        port: the default.

    Raises:
        ParameterError: an option is not an address or a port.
        ConfigError: the secret cannot be read, or any user in the network could steer the vehicle.
    """
    options = context.robot.options
    address, allow = address_of(options, port), _allowed(options)
    more: dict[str, Any] = {}
    if context.standalone_role:
        more = {"secret": _secret(options), "allow": allow}
        if context.standalone_role == vehicle:
            _check_listen_address(address[0], is_guarded=any(more.values()))
    return SocketsPair(
        address if context.standalone_role else (LOCALHOST, address[1]),
        name=name,
        faults=faults,
        keep_alive_s=KEEP_ALIVE_S,
        timeout_s=GONE_S,
        secret_is=SECRET_HELP,
        **more,
    )


def address_of(options: Mapping[str, str], port: int) -> tuple[str, int]:
    """Return the address where the vehicle listens: `--option host=...` and `--option port=...`, same for both roles.

    Raises:
        ParameterError: an option is not an address or a port.
    """
    text = options.get("port", str(port))
    given = int(text) if text.isascii() and text.isdecimal() and len(text) < 6 else 0
    if not 0 < given < 1 << 16:
        raise ParameterError(
            f"--option port={text} is not a valid port.",
            fix=f"a number from 1 to 65535, the same at both ends: port={port}.",
        )
    host = options.get("host", LOCALHOST)
    start, _, end = host.rpartition(":")
    if end.isdecimal() and not _is_address(host):
        raise ParameterError(
            f"--option host={host} has a port in it, which has an option of its own.",
            fix=f"--option host={start.strip('[]') or LOCALHOST} --option port={end}",
        )
    if not host or not host.isascii() or any(one.isspace() or one == "/" for one in host):
        raise ParameterError(
            f"--option host={host} is not a valid host name or address.",
            fix="the vehicle's address or its name, the same at both ends: host=192.168.2.2.",
        )
    return host, given


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _allowed(options: Mapping[str, str]) -> tuple[str, ...]:
    """Return the addresses that `--option allow=...` names."""
    allow = tuple(one.strip() for one in options["allow"].split(",")) if "allow" in options else ()
    try:
        as_networks(allow)
    except ConfigError as error:
        raise ParameterError(
            f"--option allow={options['allow']}: {error.message}",
            fix="the surface's address, or several with commas: allow=192.168.2.1,192.168.2.7.",
        ) from error
    return allow


def _secret(options: Mapping[str, str]) -> bytes | None:
    """Return the shared secret of both ends, or None."""
    if "secret" in options:
        return secret_from_file(options["secret"])
    return secret_from_env(SECRET_VARIABLE) if SECRET_VARIABLE in os.environ else None


def _check_listen_address(host: str, is_guarded: bool) -> None:
    """Check that a vehicle that listens at this address does not accept commands from every user."""
    if is_loopback(host) or is_guarded:
        return
    raise ConfigError(
        f"A vehicle that listens on {host} accepts commands from any host in that network.",
        fix=f"{MAKE_SECRET_COMMAND}, copy that file to the other computer, and add --option secret=secret.txt at both "
        f"ends (or {SECRET_VARIABLE}=..., the text itself, in both environments); in a network that is yours alone, "
        "--option allow=ADDRESS of the surface's computer, at the vehicle.",
    )
