"""`snr compare RUN RUN`: differences of two runs of one robot, for example in simulation and on hardware."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from snr_sim.cli.arguments import AsJson, finite_number
from snr_sim.cli.newest import trace_of, two_runs
from snr_sim.cli.output import print_json, print_text, print_warnings
from snr_sim.cli.plain_console import plain_console
from snr_sim.prelude.errors import MissingExtraError, ParameterError, TraceError

if TYPE_CHECKING:
    from snr_sim.recording.compare_runs import Comparison, SignalComparison
    from snr_sim.recording.reader import Trace

_LEGEND = (
    "noise: standard deviation from one page to the next. step: all values are multiples of it apart. "
    "age: how old what a page holds was when it was stored. later: how much later the second one moves."
)


def compare(
    first: Annotated[
        Path | None, typer.Argument(help="A run folder, or its trace; the newest in runs/ but one if not given.")
    ] = None,
    second: Annotated[
        Path | None, typer.Argument(help="Another one of the same robot; the newest in runs/ if not given.")
    ] = None,
    node: Annotated[str, typer.Option(help="Whose pages; the node that drives something if not given.")] = "",
    signal: Annotated[list[str], typer.Option(help="PAGE.FIELD, or PAGE.FIELD[2], to draw; may be repeated.")] = [],  # noqa: B006
    shift: Annotated[
        str, typer.Option(help="Seconds that the second run began later; 'auto': when its commands first changed.")
    ] = "0",
    begin_s: Annotated[float, typer.Option("--from", help="Only from this time on [s].")] = 0.0,
    end_s: Annotated[float, typer.Option("--until", help="And only until this one.")] = math.inf,
    png: Annotated[str, typer.Option(help="Draw both into this file.")] = "",
    rrd: Annotated[str, typer.Option(help="Write both on one timeline into this file, for snr view.")] = "",
    as_json: AsJson = False,
) -> None:
    """Compare two runs of one robot.

    Rate, age, noise, resolution and dead band of every number in the pages of both, and how far they are apart.

    Exit status: 0 they were compared, 2 they cannot be.
    """
    try:
        from snr_sim.recording.compare_runs import compare_runs
        from snr_sim.view.compare_picture import select_signals
    except ImportError as error:
        raise MissingExtraError("numpy", "sim") from error
    first, second = two_runs(first, second)
    traces = [trace_of(run) for run in (first, second)]
    for trace in traces:
        print_warnings(trace, before=f"{trace.path.parent}: ")
    shift_s = _shift_s(shift, traces)
    comparison = compare_runs(traces[0], traces[1], node, shift_s, (begin_s, end_s))
    select_signals(comparison, signal)  # raises for an unknown name before anything is written
    if png:
        _draw(comparison, traces[0], png, signal)
    if rrd:
        _write_rrd(traces, rrd, shift_s)
    if as_json:
        files = {name: file for name, file in (("png", png), ("rrd", rrd)) if file}
        print_json({**_fields(comparison), "shift_s": shift_s, "runs": [str(first), str(second)], **files})
        return
    _print(comparison)
    for file in filter(None, (png, rrd)):
        print_text(file)


def _shift_s(shift: str, traces: list[Trace]) -> float:
    from snr_sim.recording.compare_runs import shift_by_commands_s

    if shift == "auto":
        return shift_by_commands_s(traces[0], traces[1])
    seconds = finite_number(shift)
    if seconds is None:
        what = f"--shift must be a number of seconds or 'auto', not '{shift}'."
        raise ParameterError(what, fix="--shift 2.5, or --shift auto.")
    return seconds


def _draw(comparison: Comparison, trace: Trace, png: str, names: list[str]) -> None:
    from snr_sim.view.compare_picture import draw_comparison

    try:
        draw_comparison(comparison, trace.header, png, names)
    except OSError as error:
        raise TraceError(f"The picture {png} cannot be written: {error.strerror}.", fix="name another file.") from error


def _write_rrd(traces: list[Trace], rrd: str, shift_s: float) -> None:
    """Write both runs, the second one shifted in time, under /first and /second."""
    from msgspec.structs import replace

    from snr_sim.view.view import write_comparison

    first, second = traces
    moved = [replace(record, t=record.t - shift_s) for record in second.records] if shift_s else second.records
    trace_bytes = sum(trace.path.stat().st_size for trace in traces)
    roots = ("first", "second")
    write_comparison(first.header, first.records, moved, [], Path(rrd), trace_bytes, roots, second.header)


def _fields(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON fields of a comparison; the values themselves are in the traces."""
    command = comparison.commands_differ
    return {
        "labels": list(comparison.labels),
        "node": comparison.node,
        "identical": comparison.is_identical,
        "commands_first_differ_s": None if command is None else command.first_differs_s,
        "signals": {one.name: _signal_fields(one) for one in comparison.signals},
        "only_first": comparison.only_first,
        "only_second": comparison.only_second,
    }


def _signal_fields(one: SignalComparison) -> dict[str, Any]:
    return {
        "channels": one.first.values.shape[1],
        "is_command": one.is_command,
        "first": asdict(one.of_first),
        "second": asdict(one.of_second),
        "rms_difference": one.rms,
        "largest_difference": one.largest,
        "largest_at_s": one.largest_at_s,
        "largest_channel": one.largest_channel,
        "first_differs_s": one.first_differs_s,
        "delay_s": one.delay_s,
    }


def _print(comparison: Comparison) -> None:
    """Print a table with the statistics of each signal in both runs, with one value where they agree."""
    from rich.table import Table

    console = plain_console(width_in_a_pipe=120)
    if comparison.is_identical:
        console.print("The traces are the same, byte for byte.")
    table = Table(title=f"{comparison.node}: {' | '.join(comparison.labels)}", box=None, title_justify="left")
    table.add_column("page, field", overflow="fold")
    for heading in ("noise", "step", "rms diff.", "largest", "later [ms]"):
        table.add_column(heading, justify="right", overflow="fold")
    shown = [one for one in comparison.signals if not _is_idle(one)]
    for number, signal in enumerate(shown):
        if number == 0 or shown[number - 1].first.key != signal.first.key:
            table.add_row(_of_page(signal), style="bold")
        table.add_row(*_row(signal))
    console.print(table)
    console.print(_LEGEND, style="dim")
    idle = len(comparison.signals) - len(shown)
    if idle:
        console.print(f"Not shown: {idle} numbers that never change and are the same, or belong to links (--json).")
    for place, only in enumerate((comparison.only_first, comparison.only_second)):
        if only:
            console.print(f"only in {comparison.labels[place]}: {', '.join(only)}")
    console.print(_of_commands(comparison))


def _is_idle(signal: SignalComparison) -> bool:
    a, b = signal.of_first, signal.of_second
    return signal.first.key.startswith("link_") or (a.lowest == a.highest == b.lowest == b.highest)


def _of_page(signal: SignalComparison) -> str:
    a, b = signal.of_first, signal.of_second
    text = f"{signal.first.key}: {_both(a.rate_hz, b.rate_hz)} Hz"
    if not a.age_s is b.age_s is None:
        text += f", {_both(_ms(a.age_s), _ms(b.age_s))} ms old"
    if not a.command_delay_s is b.command_delay_s is None:
        text += f", {_both(_ms(a.command_delay_s), _ms(b.command_delay_s))} ms after the command"
    return text


def _row(signal: SignalComparison) -> list[str]:
    a, b = signal.of_first, signal.of_second
    channels = signal.first.values.shape[1]
    many = f"[{channels}]" if channels > 1 else ""
    band = f", none within {_both(_band(a.dead_band), _band(b.dead_band))}" if a.dead_band or b.dead_band else ""
    at = f" [{signal.largest_channel}]" if many and signal.largest else ""
    return [
        f"  {signal.first.field or signal.first.key}{many}{band}",
        _both(a.noise, b.noise),
        _both(a.step, b.step),
        _number(signal.rms),
        f"{_number(signal.largest)}{at}",
        _number(_ms(signal.delay_s)),
    ]


def _of_commands(comparison: Comparison) -> str:
    command = comparison.commands_differ
    if command is None:
        return "The commands are the same." if any(one.is_command for one in comparison.signals) else ""
    return f"The commands first differ at t = {command.first_differs_s:.3f} s, in {command.name}."


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else 1000.0 * seconds


def _band(band: tuple[float, float] | None) -> str | None:
    return None if band is None else f"{band[0]:+.3g}..{band[1]:+.3g}"


def _both(one: float | str | None, other: float | str | None) -> str:
    """Return one value where both runs agree, and both where they do not."""
    left, right = _number(one), _number(other)
    return left if left == right else f"{left} | {right}"


def _number(value: float | str | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
