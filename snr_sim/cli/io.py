"""`snr io`: a live table of every channel and reading of a robot's devices, and one thruster moved for the bench."""

from __future__ import annotations

import signal
import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any

import typer

from snr_sim.cli.arguments import Io
from snr_sim.cli.confirmation import confirm_motion
from snr_sim.cli.output import print_json, print_text
from snr_sim.cli.plain_console import plain_console
from snr_sim.devices.pwm.motor_test import WHOLE_S, top_us
from snr_sim.devices.terminal_keys import TerminalKeys
from snr_sim.prelude.errors import ParameterError
from snr_sim.scenario.device_bench import TICK_S, Bench, OpenDevice, bench_of, devices_of, fields_of

if TYPE_CHECKING:
    from rich.console import RenderableType

_TERMINAL_PERIOD_S = 0.2
_PIPE_PERIOD_S = 1.0  # in a pipe


def io(
    scenario: Annotated[str, typer.Argument(help="Whose robot's devices; `snr list scenarios`.")] = "urov_depth_hold",
    io: Io = "sim",
    move: Annotated[
        str,
        typer.Option(
            metavar="CHANNEL", help="Move one channel, such as pwm4 or 4, by 5 %, for 2 s, after you have confirmed it."
        ),
    ] = "",
    identify: Annotated[
        bool, typer.Option("--identify", help="Turn one motor after the other, and ask which it is; --io ports:FILE.")
    ] = False,
    check_timeout: Annotated[
        bool, typer.Option("--check-timeout", help="Turn each motor, and measure when it stops; --io ports:FILE.")
    ] = False,
    once: Annotated[bool, typer.Option("--once", help="Print it once.")] = False,
    seconds: Annotated[float, typer.Option(help="End by itself after so long.")] = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="With --once: print one JSON object.")] = False,
) -> None:
    """Show every channel and reading.

    With --identify or --check-timeout, turn motors at real ports instead, once you have confirmed it.

    The devices are opened as in a run, but the robot's program is not there: outputs stay neutral, and are armed only
    with --move.

    Exit status: 0 all devices answer, 1 one does not, 2 the request was wrong.
    """
    # Also if the parent ignores Ctrl-C, such as a script in the background: a program that moves a thruster must stop.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if as_json and not once:
        raise ParameterError("--json prints one object, so it needs --once.", fix="snr io --once --json.")
    if move and (once or not sys.stdin.isatty()):
        raise ParameterError(
            "--move asks for confirmation, so it needs a terminal and does not work with --once.",
            fix="call it from a terminal, without --once.",
        )
    if identify or check_timeout:
        from snr_sim.cli.io_motors import check_motors

        sys.exit(check_motors(scenario, io, identify, check_timeout))
    with bench_of(devices_of(scenario, io)) as bench:
        if move:
            move = bench.name_of(move)
            confirm_motion(
                f"'{move}' of {io} will be armed and moved to {top_us():g} us for {WHOLE_S:g} s. Take the propellers "
                "off, hold the battery switch.\nAny key stops it.",
                f"{move} props off",
            )
        if once:
            bench.settle()
            _print_once(bench, io, scenario, as_json)
        else:
            with TerminalKeys() as keys:
                _watch(bench, keys, move, seconds)
        is_ok = all(one.is_ok for one in [*bench.sensors, *bench.outputs])
    sys.exit(0 if is_ok else 1)


def _print_once(bench: Bench, io: str, scenario: str, as_json: bool) -> None:
    if not as_json:
        console = plain_console(width_in_a_pipe=120)
        shown(bench)  # the first call imports for a while, so it runs before the readings are checked
        bench.tick()
        console.print(shown(bench))
        return
    now_s = bench.now_s()
    outputs, sensors = ([fields_of(one, now_s) for one in devices] for devices in (bench.outputs, bench.sensors))
    print_json({"io": io, "scenario": scenario, "outputs": outputs, "sensors": sensors})


def _watch(bench: Bench, keys: TerminalKeys, move: str, seconds: float) -> None:
    """Show everything until Ctrl-C, or until the move is done."""
    begun_s = shown_s = time.monotonic()
    period_s = _TERMINAL_PERIOD_S if sys.stdout.isatty() else _PIPE_PERIOD_S
    with ExitStack() as stack:
        show = _shower(stack)
        bench.tick()
        show(bench)
        if move:
            bench.arm(move)
        while not seconds or time.monotonic() < begun_s + seconds:
            is_pressed = keys.wait(TICK_S)
            if move and is_pressed:
                bench.stop("a key was pressed")
            bench.tick()
            if time.monotonic() >= shown_s + period_s:
                shown_s = time.monotonic()
                show(bench)
            if move and not bench.is_moving:
                break
    if move:
        print_text(
            f"{move} is at neutral again; the longest pulse that its outputs reported was {bench.max_pulse_us:g} us."
        )


def _shower(stack: Any) -> Any:
    """Return the display of a bench: a table that is updated in place on a terminal, lines in a pipe."""
    if not sys.stdout.isatty():
        return lambda bench: print_text("\n".join(lines(bench)), flush=True)
    from rich.live import Live

    live = stack.enter_context(Live(console=plain_console(), auto_refresh=False))
    return lambda bench: live.update(shown(bench), refresh=True)


def lines(bench: Bench) -> list[str]:
    """Return one line for each device, for pipes."""
    now_s = bench.now_s()
    texts = {one.key: "; ".join(filter(None, _texts_of(one, now_s))) for one in _all(bench)}
    return [f"{now_s:.2f} s  {key}: {' '.join(words.split())}" for key, words in texts.items()]


def shown(bench: Bench) -> RenderableType:
    """Return the table."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for heading in ("device", "state", "reading, or pulses [us]", "age [ms]", "why, counts"):
        table.add_column(heading, overflow="fold")
    now_s = bench.now_s()
    for one in _all(bench):
        state, values, age, reason, counts = _texts_of(one, now_s)
        style = "" if one.is_ok else "red"
        table.add_row(
            one.key, state, values, age.removesuffix(" ms old"), "\n".join(filter(None, (reason, counts))), style=style
        )
    return table


def _all(bench: Bench) -> list[OpenDevice]:
    return [*bench.outputs, *bench.sensors]


def _texts_of(one: OpenDevice, now_s: float) -> tuple[str, str, str, str, str]:
    """Return state, values, age, reason and count as text."""
    fields = fields_of(one, now_s)
    counted = fields["counts"] if any(fields["counts"].values()) else {}
    counts = ", ".join(f"{name} {count}" for name, count in counted.items())
    if "pulses_us" in fields:
        pulses = fields["pulses_us"] or []
        values = " ".join(f"{name}:{pulse:g}" for name, pulse in zip(one.channels, pulses, strict=False))
        reasons = [] if one.trouble or fields["state"] == "error" else fields["reasons"]  # the error is more specific
        return fields["state"], values, "", "; ".join(filter(None, [fields["reason"], ", ".join(reasons)])), counts
    reading = fields.get("reading") or {}
    values = " ".join(f"{key}={_short(item)}" for key, item in reading.items() if key != "stamp_s")
    age_s = fields.get("age_s")
    age = "" if age_s is None else f"{1000.0 * age_s:.0f} ms old"
    return fields["state"], values, age, fields.get("stale") or fields["reason"], counts


def _short(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_short, value[:4]))}{', ...' if len(value) > 4 else ''}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
