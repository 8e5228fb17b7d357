"""`snr`: the way in from a terminal."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from snr_sim import __version__
from snr_sim.cli import bench, doctor, listing, new, replay, resim, run, trace, view

app = typer.Typer(
    name="snr",
    help="Robots as SNR nodes, in lock step with simulated plants; every run recorded and replayable.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # plain help text: rich costs 0.3 s to import
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _say_version(is_wanted: bool) -> None:
    if is_wanted:
        print(f"snr_sim {__version__}")
        raise typer.Exit()


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Version.")] = False,
) -> None:
    pass


app.command("run")(run.run)
app.command("replay")(replay.replay)
app.command("resim")(resim.resim)
app.command("trace")(trace.trace)
app.command("view")(view.view)
app.command("list")(listing.listing)
app.command("new")(new.new)
app.command("doctor")(doctor.doctor)
app.command("bench")(bench.bench)


def main() -> None:
    """Runs the command line; an error of ours is a sentence, not a traceback."""
    try:
        app(prog_name="snr")
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:  # `snr trace RUN | head`
        sys.stderr.close()
        sys.exit(0)
    except Exception as error:
        from snr_sim.prelude.errors import SnrError  # after the fact: `snr --help` does not need it

        if not isinstance(error, SnrError):
            raise
        fail(str(error))


def fail(message: str) -> None:
    """Says what was wrong with the request and exits with status 2; with --json also as JSON."""
    import json

    print(message, file=sys.stderr)
    if "--json" in sys.argv:
        print(json.dumps({"error": message}))
    sys.exit(2)
