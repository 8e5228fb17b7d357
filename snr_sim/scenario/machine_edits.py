"""The edits of a run as files, and the same run with them once more.

    trace --> edits_of --> Edits --> write --> FOLDER/0.lrp, 1.lrp, ... and edits.toml --> run again --> same changes?

A trace of five minutes has 20 MB, and its reader does not know whether a run has written it. The edits have some kB,
and with the same scenario, seed and edits the run can be repeated, to the last bit.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.values import decode_value
from snr_sim.recording.compare import Tolerance
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import Executed, InputRecord, LogLineRecord, Record
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

TABLE = "edits.toml"
EDITS = (".edit", ".edit_file")  # ends of the names of events that replace a program
# Lines of a program move with the text around them, which changes nothing that it does.
LINES = (Tolerance.parse("*.transition*.line=ignore"), Tolerance.parse("*.last.line=ignore"))
_EDIT, _TRANSITION = ".edit", ".transition"
_SAME = ("t_ns", "machine", "kind", "source", "target")  # of a change; its line and name are of the text
# What changes a machine from outside and is not written.
_OTHERS = (".edit_file", ".set", ".pause", ".go")


@dataclass(frozen=True)
class Edits:
    """The programs of a run.

    Args:
        scenario, seed, options: of the run.
        name: of the component.
        texts: the first program, and that of each edit, also if it was refused.
        at_s: time of each edit.
        changes: digest of the changes of state, see `digest_of_changes`.
    """

    scenario: str
    seed: int
    options: dict[str, str]
    name: str
    texts: list[str]
    at_s: list[float]
    changes: str = ""
    others: list[str] = field(default_factory=list)


def edits_of(trace: Trace) -> Edits:
    """Return the edits of a recorded run.

    Raises:
        ParameterError: it has no machine in LRP, or several that were edited.
    """
    header = trace.header
    inputs = [one for one in trace.records if isinstance(one, InputRecord) and one.type == "event"]
    edits = [one for one in inputs if one.name.endswith(_EDIT)]
    programs = [one for one in trace.records if isinstance(one, LogLineRecord) and one.level == "PROGRAM"]
    names = list(dict.fromkeys(one.name.removesuffix(_EDIT) for one in edits))
    names = names or list(dict.fromkeys(one.component for one in programs))[:1]
    if len(names) != 1:
        what = f"edits of several machines: {', '.join(names)}" if names else "no machine in LRP"
        raise ParameterError(f"This run has {what}.", fix="name a run of one LRP program: --controller mine.lrp.")
    first = "\n".join(one.text for one in programs if one.component == names[0])
    texts = [str(next(iter(decode_value(bytes(one.values))), "")) for one in edits]
    return Edits(
        trace.trace_info.scenario,
        header.seed,
        dict(header.options),
        names[0],
        [f"{first}\n", *texts],
        [one.t for one in edits],
        digest_of_changes(trace.records),
        [one.name for one in inputs if one.name.endswith(_OTHERS)],
    )


def digest_of_changes(records: list[Record]) -> str:
    """Return the digest of all changes of state in a run: when, in which machine, from where to where."""
    digest = hashlib.blake2b(digest_size=16)
    for change in changes_of(records):
        digest.update(json.dumps(key_of_change(change)).encode() + b"\n")
    return digest.hexdigest()


def key_of_change(change: dict[str, Any]) -> list[Any]:
    """Return what is the same in two runs if a change is: when, in which machine, from where to where."""
    return [change.get(name) for name in _SAME]  # a flow has no kind


def changes_of(records: Iterable[Record]) -> Iterator[dict[str, Any]]:
    """Yield all changes of machines' states in a run, as their events "<name>.transition" have them; none of flows."""
    for record in records:
        if isinstance(record, Executed) and record.type == "event" and record.name.endswith(_TRANSITION):
            (change,) = decode_value(bytes(record.values))
            if isinstance(change, dict) and "kind" in change:
                yield change


def without_edits(trace: Trace) -> tuple[Trace, str]:
    """Return a trace without the inputs that edit a machine, and a note on them; an empty one if there are none."""
    kept = [one for one in trace.records if not (isinstance(one, InputRecord) and one.name.endswith(EDITS))]
    count = len(trace.records) - len(kept)
    note = (
        f"{count} edit{'s' if count > 1 else ''} of the run {'are' if count > 1 else 'is'} left out." if count else ""
    )
    return replace(trace, records=kept), note


def write(edits: Edits, folder: Path) -> None:
    """Write the programs and the table of edits into a folder, which is created if it does not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, text in enumerate(edits.texts):
        (folder / f"{number}.lrp").write_text(text, encoding="utf-8")
    rows: dict[str, Any] = {"scenario": edits.scenario, "seed": edits.seed, "changes": edits.changes}
    lines = [f"{name} = {json.dumps(value)}" for name, value in rows.items()]
    lines += [f"at_s = {json.dumps(edits.at_s)}  # when 1.lrp came, 2.lrp, ..."]
    lines += ["", "[options]", *(f"{json.dumps(key)} = {json.dumps(value)}" for key, value in edits.options.items())]
    head = "# The edits of a run, written by `snr machine edits`. `changes` is the digest of its changes of state."
    (folder / TABLE).write_text("\n".join([head, *lines, ""]), encoding="utf-8")


def changes_again(edits: Edits, controller: Path) -> str:
    """Run the scenario again with the edits; return the digest of its changes of state.

    Args:
        edits: of a run.
        controller: file of the first program.
    """
    simulation = prepare(Request(edits.scenario, edits.seed, controller=str(controller), options=edits.options))
    event = f"{edits.name}{_EDIT}"
    inputs = [(at_s, tasks.event(event, [text])) for at_s, text in zip(edits.at_s, edits.texts[1:], strict=True)]
    with TemporaryDirectory(prefix="snr-edits-") as folder:
        run_recorded(simulation, Path(folder) / FILE_NAME, inputs)
        return digest_of_changes(read_trace(Path(folder) / FILE_NAME).records)
