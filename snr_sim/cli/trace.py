"""`snr trace RUN`: prints records, one per line, formatted as text or, with --json, as in the file."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Annotated, Any

import typer

from snr_sim.cli.arguments import RecordedRun
from snr_sim.cli.newest import trace_of
from snr_sim.cli.output import print_encoded, print_text, print_warnings
from snr_sim.prelude.errors import UnknownNameError, suggest
from snr_sim.recording import records

_KINDS = ("begin", "input", "task", "page", "truth", "error", "said", "end")


def trace(
    run: RecordedRun = None,
    node: Annotated[str, typer.Option(help="Only this node's: a role, or its name with _node.")] = "",
    kind: Annotated[str, typer.Option(help=f"Only this kind: {', '.join(_KINDS)}.")] = "",
    name: Annotated[str, typer.Option(help="Only tasks and pages of this name; * and ? as in file names.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the lines of the file.")] = False,
) -> None:
    """Print the records of a run."""
    if kind and kind not in _KINDS:
        raise UnknownNameError(f"There are no records of kind '{kind}'.", fix=suggest(kind, _KINDS))
    recorded = trace_of(run)
    print_warnings(recorded)
    nodes = recorded.header.nodes
    if node and node not in nodes and f"{node}_node" not in nodes:
        raise UnknownNameError(f"This run has no node '{node}'.", fix=suggest(node, nodes))
    names = {str(one) for record in recorded.records if (one := getattr(record, "name", ""))}
    if name and not any(fnmatchcase(one, name) for one in names):
        raise UnknownNameError(f"This run has no tasks or pages '{name}'.", fix=suggest(name, names))
    for record in recorded.records:
        config: Any = record.__struct_config__
        is_kind = kind in ("", config.tag)
        is_of_node = not node or getattr(record, "node", "") in (node, f"{node}_node")
        if is_kind and is_of_node and (not name or fnmatchcase(getattr(record, "name", ""), name)):
            if as_json:
                print_encoded(records.encode_record(record).decode())
            else:
                print_text(_line(record, config.tag))


def _line(record: records.Record, kind: str) -> str:
    head = f"{record.seq:>7} {record.t:>10.4f} {kind:<6}"
    if isinstance(record, records.TruthRecord):
        return f"{head} " + " ".join(f"{key}={value:.6g}" for key, value in record.values.items())
    if isinstance(record, records.ErrorRecord):
        return f"{head} {record.node} {record.component}: {record.message}"
    if isinstance(record, records.LogLineRecord):
        return f"{head} {record.node} {record.component} {record.level}: {record.text}"
    if isinstance(record, records.EndRecord):
        return f"{head} {record.node} {record.reason} {record.summary}"
    if isinstance(record, records.BeginRecord):
        return f"{head} {record.node} {record.component} {_returned(record.returned)}"
    values = bytes(record.values).decode()
    if isinstance(record, records.InputRecord):
        return f"{head} {record.node} {record.source} -> {record.type} {record.name} {values}"
    by = "; ".join(f"{one.component}.{one.handler} -> {_returned(one.returned)}" for one in record.handled) or "nobody"
    return f"{head} {record.node} {record.type} {record.name} {values} (from {record.cause}) {by}"


def _returned(returned: Any) -> str:
    return ", ".join(f"{one.type} {one.name}" for one in returned) or "-"
