"""`snr`: the command of the terminal."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, NoReturn

import typer

from snr_sim import __version__
from snr_sim.cli import stopping
from snr_sim.cli.verbs import VERBS, VerbGroup
from snr_sim.core.standard_streams import print_line

app: typer.Typer = typer.Typer(
    name="snr",
    help="Robots as SNR nodes, in lock step with simulated plants; every run recorded and replayable.",
    no_args_is_help=True,
    cls=VerbGroup,
    rich_markup_mode=None,  # plain help text: rich costs 0.3 s to import
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(is_requested: bool) -> None:
    if is_requested:
        print(f"snr_sim {__version__}")  # noqa: T201
        raise typer.Exit()


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Version.")
    ] = False,
) -> None:
    pass


@cache
def _command() -> Callable[..., Any]:
    """Return the command; a verb's module is imported when it is used."""
    return typer.main.get_command(app)


# typer before 0.28 uses another word for an integer.
_NUMBERS = {"valid int": "a whole number", "valid number": "a number", "valid float": "a number"}
_TYPER_STOPPED = 130  # typer's status when it catches a KeyboardInterrupt itself


def main() -> None:
    """Run the command line; print an `SnrError` as a sentence, not a traceback.

    Signals interrupt it, if `entry.py` has set that up: then every verb cleans up.
    """
    try:
        status = _run()
    except KeyboardInterrupt:
        status = _TYPER_STOPPED
    except (Exception, SystemExit) as error:
        _exit_with_message(error)
        raise
    if status == _TYPER_STOPPED:
        fail("Stopped.", stopping.status())
    sys.exit(status if isinstance(status, int) else 0)


def _run() -> Any:
    try:
        return _command()(prog_name="snr", standalone_mode=False)
    finally:
        sys.stdout.flush()  # here, where a closed pipe can still be handled


def _exit_with_message(error: BaseException) -> None:
    """End the program with the message of an error; return if it is an internal error."""
    if isinstance(error, SystemExit):
        if isinstance(error.__context__, BrokenPipeError):  # typer has caught it first
            _handle_broken_pipe()
        return
    if isinstance(error, BrokenPipeError):  # `snr trace RUN | head`
        _handle_broken_pipe()
    if isinstance(error, OSError):
        if error.filename is None:
            fail(f"The answer could not be written: {error.strerror}. A run that was made is in its folder.", 1)
        return
    from snr_sim.prelude.errors import SnrError  # imported late: `snr --help` does not need it

    if isinstance(error, SnrError):
        fail(str(error))
    if hasattr(error, "format_message"):  # typer's errors about the command line have it
        message = _number_message(error, error.format_message())
        has_fix = message.startswith("Usage:") or "Try:" in message
        fail(message if has_fix else f"{message}\n  Try: snr {_verb()}--help says what there is.")


def _number_message(error: Any, message: str) -> str:
    """Return snr_sim's message for an invalid number or a file without its option; for other errors, typer's."""
    extra = re.search(r"extra argument.* \((\S+\.py)\)", message)
    if extra is not None and _verb() in ("run ", "resim "):
        return f"{message}\n  Try: --controller ./{extra[1].removeprefix('./')}"
    if "Missing argument 'scenario'" in message:
        fix = "name it first: snr run lander_vertical (all: snr list scenarios; options: snr run --help)."
        return f"{message}\n  Try: {fix}"
    parameter = getattr(error, "param", None)
    expected = next((ours for theirs, ours in _NUMBERS.items() if theirs in message), None)
    for before, word in zip(sys.argv, [*sys.argv[1:], ""], strict=True):
        name, equals, value = before.partition("=")
        if expected is not None and parameter is not None and name in parameter.opts:
            return f"{name} {value if equals else word}: it takes {expected}.\n  Try: {name} 3"
    return message


def _verb() -> str:
    return next((f"{word} " for word in sys.argv[1:2] if word in VERBS), "")


def _handle_broken_pipe() -> NoReturn:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(0)


def fail(message: str, status: int = 2) -> NoReturn:
    """Print what is wrong with the request, with --json also as JSON, and end with an exit status."""
    import json

    print_line(sys.stderr, message)
    if "--json" in sys.argv:
        print_line(sys.stdout, json.dumps({"error": message}))
    sys.exit(status)
