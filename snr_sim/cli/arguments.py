"""Arguments and options that several verbs share, and their parsers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from snr_sim.prelude.errors import ParameterError

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Io = Annotated[str, typer.Option(help="Where devices are: sim, emulated, mcu:PORT, pi, ...", envvar="SNR_SIM_IO")]
Out = Annotated[Path, typer.Option(help="Folder that run folders go into.")]
RecordedRun = Annotated[
    Path | None, typer.Argument(help="A run folder, or its trace; the newest in runs/ if not given.")
]
Shown = Literal["", "window", "browser"]  # where a run is shown
WithRrd = Annotated[bool, typer.Option("--rrd/--no-rrd", help="Write view.rrd at once, not at snr view.")]


def finite_number(text: str) -> float | None:
    """Return the number in a text, or None if it is not a finite number.

    >>> finite_number("2.5"), finite_number("inf"), finite_number("soon")
    (2.5, None, None)
    """
    try:
        number = float(text)
    except ValueError:
        return None
    return number if abs(number) < float("inf") else None


def address_of(text: str, what: str) -> tuple[str, int]:
    """Return host and port of a text; raise ParameterError if it is not `what`.

    >>> address_of("54321", "an address"), address_of("[::1]:9130", "an address")
    (('127.0.0.1', 54321), ('::1', 9130))
    """
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise ParameterError(f"'{text}' is not {what}.", fix="use HOST:PORT, such as 127.0.0.1:54321.")
    return host.strip("[]") or "127.0.0.1", int(port)


def pace_of(speed: str) -> float | None:
    """Return virtual seconds per wall second, or None for as fast as possible; raise ParameterError for other texts.

    >>> pace_of("real"), pace_of("4"), pace_of("fast")
    (1.0, 4.0, None)
    """
    if speed in ("fast", "real"):
        return None if speed == "fast" else 1.0
    pace = finite_number(speed)
    if pace is None or pace <= 0:
        raise ParameterError(
            f"--speed must be 'fast', 'real' or a number greater than 0, not '{speed}'.",
            fix="--speed fast, --speed real, or a multiple of real time such as --speed 4.",
        )
    return pace


def options_of(pairs: list[str]) -> dict[str, str]:
    """Return the options given as `--option KEY=VALUE`; raise ParameterError for another form, or a key given twice."""
    options: dict[str, str] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not (key and equals):
            raise ParameterError(
                f"--option {pair} is not KEY=VALUE.",
                fix="--option pilot=manual, for a robot that has it: snr list robots.",
            )
        if key in options:
            raise ParameterError(
                f"--option {key}={options[key]} and {key}={value}: it was given twice.", fix="leave one of them out."
            )
        options[key] = value
    return options
