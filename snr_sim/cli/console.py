"""`snr console HOST:PORT`: commands for a running node."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson, address_of
from snr_sim.cli.output import print_encoded, print_text
from snr_sim.console.client import ConsoleClient
from snr_sim.console.parsing import CommandResult
from snr_sim.console.remote_console import RemoteConsole
from snr_sim.core.standard_streams import print_line
from snr_sim.links.security import secret_from_env, secret_from_file
from snr_sim.prelude.values import encode_value

_TOKEN_VARIABLE = "SNR_TOKEN"


def console(
    address: Annotated[str, typer.Argument(metavar="HOST:PORT", help="Of the node's CommandReceiver; or a port here.")],
    command: Annotated[
        list[str] | None, typer.Argument(metavar="[COMMAND...]", help="One command; asks for them if not given.")
    ] = None,
    token_file: Annotated[Path | None, typer.Option(help=f"Holds the token; or {_TOKEN_VARIABLE} does.")] = None,
    wait: Annotated[float, typer.Option(help="Seconds to wait for a node that is not there.")] = 5.0,
    as_json: AsJson = False,
) -> None:
    """Give commands to a running node.

    The one given, those on stdin, or what you type, with history and completion.

    `snr console 54321 help` lists them. A watch continues until Ctrl-C.

    Exit status: 0 all were carried out, 1 one was refused, 2 no node answered or the request was wrong.
    """
    server, token = address_of(address, "a console address"), _token(token_file)
    if not command and not as_json and sys.stdin.isatty():
        RemoteConsole(server, token=token).run()
        return
    lines: Iterable[str] = [" ".join(command)] if command else sys.stdin
    is_watching = (command or [""])[0] == "watch" and not as_json
    # The output of a script has only the replies to its commands.
    on_change = _print if is_watching else lambda answer: None
    with ConsoleClient(server, token, on_change=on_change) as client:
        client.wait_until_up(wait)
        answers = _carried_out(client, lines, as_json)
        if is_watching and not answers[-1].is_error:
            client.wait_until_lost()
    sys.exit(1 if any(answer.is_error for answer in answers) else 0)


def _print(answer: CommandResult) -> None:
    if answer.is_error:
        print_line(sys.stderr, answer.text)
    else:
        print_text(answer.text, flush=True)


def _carried_out(client: ConsoleClient, lines: Iterable[str], is_json: bool) -> list[CommandResult]:
    answers = []
    for line in filter(None, map(str.strip, lines)):
        answers.append(client.ask(line))
        if not is_json:
            _print(answers[-1])
    if is_json:
        shown = [{"text": one.text, "data": one.data, "is_error": one.is_error} for one in answers]
        print_encoded(encode_value({"answers": shown}).decode())
    return answers


def _token(path: Path | None) -> bytes | None:
    """Return the token from a source that other users of this machine cannot read: not the command line."""
    if path is not None:
        return secret_from_file(path)
    return secret_from_env(_TOKEN_VARIABLE) if os.environ.get(_TOKEN_VARIABLE) else None
