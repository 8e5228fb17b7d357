"""What a program in LRP is, read without running it. Sent to the student's process, which parses the text there."""

from __future__ import annotations

from typing import Any

from snr_sim.behaviors import ProgramError, parse
from snr_sim.behaviors.explore import explore
from snr_sim.behaviors.imports import files_named


def read_program(text: bytes) -> dict[str, Any]:
    """Return what a text says: the first mistake, the files it needs, its first machine, and what a search finds.

    {"mistake": "line 3: ..." or "", "files": [names], "machine": name, "findings": ["line 5: ...", ...]}

    The parts of the robot are not known here: a wrong name of one shows when the program runs.
    """
    try:
        source = text.decode()
        files = [name for names in files_named(source) for name in names]
        program = parse(source)
    except UnicodeDecodeError:
        return {"mistake": "this is not text", "files": [], "machine": "", "findings": []}
    except ProgramError as error:
        first = error.problems[0]
        return {"mistake": f"line {first.place.line}: {first.message}", "files": files, "machine": "", "findings": []}
    found = [f"line {one.place.line}: {one.message}" for one in explore(program).findings if one.kind != "only_time"]
    machine = program.spawns[0].machine.name if program.spawns else ""
    return {"mistake": "", "files": files, "machine": machine, "findings": found}
