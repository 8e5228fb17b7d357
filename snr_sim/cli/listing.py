"""`snr list`: robots, scenarios and assignments that can be run."""

from __future__ import annotations

import ast
from itertools import chain
from typing import Annotated, Any

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.output import print_json, print_text
from snr_sim.core.source_location import short_path
from snr_sim.prelude.errors import UnknownNameError, suggest
from snr_sim.scenario.library import FoundItem, controller_file, controllers, list_available
from snr_sim.scenario.options import written_options

_WHAT = ("robots", "scenarios", "assignments")


def listing(
    what: Annotated[str, typer.Argument(help="robots, scenarios or assignments; all if not given.")] = "",
    as_json: AsJson = False,
) -> None:
    """List what there is to run.

    Robots with their controllers and options, scenarios with the engines they run on, and assignments, and where each
    was found.
    """
    if what and what not in _WHAT:
        raise UnknownNameError(f"There are no '{what}' to list.", fix=suggest(what, _WHAT))
    rows = {kind: [_row(found) for found in list_available(kind)] for kind in ([what] if what else _WHAT)}  # type: ignore[arg-type]
    if as_json:
        print_json({"found": list(chain(*rows.values()))})
        return
    for kind, of_kind in rows.items():
        if of_kind:
            print_text(f"{kind}:")
        elif what:
            print_text(f"no {kind} found")
        width = max((len(row["name"]) for row in of_kind), default=0)
        for row in of_kind:
            print_text(f"  {row['name']:<{width}} {row['about']}  [{row['place']}: {row['path']}]")
            for more in ("controllers", "engines"):
                if row.get(more):
                    print_text(f"  {'':<{width}} {more}: {row[more]}")
            for key, text in row.get("options", {}).items():
                print_text(f"  {'':<{width}} --option {key}=...  {text}")


def _row(found: FoundItem) -> dict[str, Any]:
    path = short_path(str(found.path))
    row: dict[str, Any] = {
        "kind": found.kind,
        "name": found.name,
        "about": _about(found),
        "place": found.place,
        "path": path,
    }
    if found.kind == "robots":
        names = controllers(found)
        row["controllers"] = ", ".join(names)
        files = [found.path / "robot.py", *(controller_file(found, one) for one in names)]
        row["options"] = {key: text for file in files for key, text in written_options(file).items()}
    if found.kind == "scenarios":
        row["engines"] = ", ".join(_engines(found))
    return row


def _about(found: FoundItem) -> str:
    """Return the first paragraph of the file's docstring, without running the file."""
    if found.kind == "assignments":
        return (found.path / "README.md").read_text(errors="replace").partition("\n")[0].lstrip("# ")
    source = _parsed(found)
    if source is None:
        return "(does not parse)"
    return " ".join((ast.get_docstring(source) or "").partition("\n\n")[0].split())


def _engines(scenario: FoundItem) -> list[str]:
    """Return the engines that a scenario's file lists, the default first; empty if it defines them otherwise."""
    source = _parsed(scenario)
    for node in source.body if source is not None else ():
        match node:
            case ast.Assign(targets=[ast.Name(id="ENGINES")], value=ast.Tuple(elts=names)):
                return [str(name.value) for name in names if isinstance(name, ast.Constant)]
    return []


def _parsed(found: FoundItem) -> ast.Module | None:
    path = found.path / "robot.py" if found.kind == "robots" else found.path
    try:
        return ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return None
