"""The verbs of `snr`, each with a line of help and examples. A verb's module is imported when the verb is used."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from functools import cache
from typing import Any

import typer
from typer.core import TyperGroup


@dataclass(frozen=True)
class Verb:
    """A command in the module of its name, or of `module`.

    Args:
        about: its line in `snr --help`, which is also the first line of its own help.
        examples: below its help.
        takes_dashes: whether words that look like options may be arguments, as in `store x -1`.
    """

    about: str
    examples: tuple[str, ...]
    module: str = ""
    takes_dashes: bool = False


VERBS = {
    "run": Verb(
        "Run a scenario and record it.",
        ("snr run lander_pad --seed 3", "snr run lander_vertical --controller ./mine.py --speed real --web-view"),
    ),
    "replay": Verb(
        "Replay a run and compare.", ("snr replay --check", "snr replay runs/lander_pad-3-... --with ./mine.py")
    ),
    "resim": Verb("Simulate a run again, plant and all.", ("snr resim runs/lander_pad-3-... --with ./mine.py",)),
    "trace": Verb("Print the records of a run.", ("snr trace --kind page --name engine", "snr trace --kind said")),
    "view": Verb("Show a run in rerun.", ("snr view --web", "snr view runs/lander_pad-3-... --png landing.png")),
    "compare": Verb("Compare two runs of one robot.", ("snr compare", "snr compare runs/sim runs/real --shift auto")),
    "list": Verb("List what there is to run.", ("snr list scenarios",), module="listing"),
    "new": Verb(
        "Begin a controller, machine, robot, scenario, lab or service of your own.",
        (
            "snr new controller mine --scenario lander_vertical",
            "snr new machine mine --robot dora",
            "snr new lab depth_hold",
            "snr new robot mine --from lander",
        ),
    ),
    "check": Verb("Try the visible checks of a lab on your files.", ("snr check depth_hold depth_hold",)),
    "grade": Verb(
        "Grade submissions, with hidden cases, each program in a sandbox.",
        ("snr grade depth_hold submissions/* --out results",),
    ),
    "machine": Verb(
        "Draw or check the state machines of a file, or explain those of a run.",
        ("snr machine check landing.lrp --robot lander", "snr machine view runs/dora_room-0-..."),
    ),
    "processes": Verb(
        "Run RoverProcesses: each in a process, or all in one lock step.",
        ("snr processes rover.py", "snr processes modules Drive Gps --sim 60"),
    ),
    "io": Verb("Show every channel and reading.", ("snr io --io mcu:/dev/ttyUSB0 --move pwm4",)),
    "doctor": Verb("Check this machine.", ("snr doctor --io mcu:/dev/ttyUSB0",)),
    "bench": Verb(
        "Measure speed on this machine and compare it with the targets.", ("snr bench dispatch lander --quick",)
    ),
    "health": Verb("Print what each supervised process of a robot does.", ("snr health runs/rover",)),
    "console": Verb(
        "Give commands to a running node.",
        ("snr console 54321", "snr console 54321 store engine '{\"throttle\": 0.3}'"),
        takes_dashes=True,
    ),
}


class VerbGroup(TyperGroup):
    """The command `snr`. It reads a verb's signature when the verb is used: reading all of them takes 40 ms."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{**options, "commands": dict.fromkeys(VERBS)})

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a verb's command, or None if there is no such verb."""
        return command_of(cmd_name, VERBS[cmd_name]) if cmd_name in VERBS else None

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of verbs without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, verb.about) for name, verb in VERBS.items()])


@cache  # to read a signature takes 3 ms
def command_of(name: str, verb: Verb) -> Any:
    """Import the module of the verb `name` and return its command."""
    word = verb.module or name
    function = getattr(importlib.import_module(f"snr_sim.cli.{word}"), word)
    alone = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    listed = "\n".join(("For example:", *(f"  {example}" for example in verb.examples)))
    settings = {"ignore_unknown_options": True} if verb.takes_dashes else None
    alone.command(name, epilog=f"\b\n{listed}", context_settings=settings)(function)
    return typer.main.get_command(alone)
