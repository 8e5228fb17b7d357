"""`snr machine`: what can be done with a state machine without running the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from snr_sim.prelude.errors import UnknownNameError, suggest

if TYPE_CHECKING:
    from snr_sim.behaviors.program import Program

_WHAT = ("draw",)
_FORMATS = ("mermaid", "dot", "scxml", "text")


def machine(
    what: Annotated[str, typer.Argument(help="draw.")],
    file: Annotated[str, typer.Argument(help="A Python file in which machine(...) is called.")],
    name: Annotated[str, typer.Option(help="Which machine, if the file has several.")] = "",
    to: Annotated[str, typer.Option("--as", help="mermaid, dot, scxml or text.")] = "mermaid",
) -> None:
    """Draw the state machines of a Python file.

    Prints it in a format that other programs draw: mermaid in an editor or on a web page, dot with Graphviz; scxml is
    W3C's format of state machines, and text a listing.
    """
    from snr_sim.behaviors.export import draw

    if what not in _WHAT:
        raise UnknownNameError(f"snr machine cannot '{what}'.", fix=suggest(what, _WHAT))
    if to not in _FORMATS:
        raise UnknownNameError(f"There is no format '{to}'.", fix=suggest(to, _FORMATS))
    print(draw(_program_in(file, name), to), end="")  # type: ignore[arg-type]


def _program_in(file: str, name: str) -> Program:
    """Return the machine of a file, or the one of a name."""
    from snr_sim.behaviors.program import Program
    from snr_sim.scenario.library import load_program

    module = load_program(file, fix="name the Python file of the machine: snr machine draw mission.py.")
    found = {key: value for key, value in vars(module).items() if isinstance(value, Program)}
    if not found:
        raise UnknownNameError(f"{file} has no machine.", fix='MISSION = machine("mission", ...), outside functions.')
    if name and name not in found:
        raise UnknownNameError(f"{file} has no machine '{name}'.", fix=suggest(name, found))
    inner = {id(spawn.machine) for one in found.values() for path, spawn in one.walk() if "/" in path}
    outer = [key for key, value in found.items() if id(value.spawns[0].machine) not in inner]
    if not name and len(outer) != 1:
        raise UnknownNameError(f"{file} has several machines.", fix=f"--name, {suggest('', outer or found)}")
    return found[name or outer[0]]
