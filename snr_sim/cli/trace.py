"""`snr trace RUN`: prints records, one a line, for people or, with --json, as they stand in the file."""

from __future__ import annotations

import sys
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from snr_sim.recording.records import Record

KINDS = ("begin", "input", "task", "page", "truth", "error", "said", "end")


def trace(
    run: Annotated[
        Path | None, typer.Argument(help="A run folder, or its trace; the newest in runs/ if not given.")
    ] = None,
    node: Annotated[str, typer.Option(help="Only this node's: a role, or its name with _node.")] = "",
    kind: Annotated[str, typer.Option(help=f"Only this kind: {', '.join(KINDS)}.")] = "",
    name: Annotated[str, typer.Option(help="Only tasks and pages of this name; * and ? as in file names.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the lines of the file.")] = False,
) -> None:
    """Print the records of a run."""
    from snr_sim.cli.newest import run_or_newest
    from snr_sim.prelude.errors import UnknownName, nearest
    from snr_sim.recording.folder import remarks, trace_path
    from snr_sim.recording.reader import read_trace
    from snr_sim.recording.records import encode_record

    if kind and kind not in KINDS:
        raise UnknownName(f"There are no records of kind '{kind}'.", fix=nearest(kind, KINDS))
    recorded = read_trace(trace_path(run_or_newest(run)))
    for remark in remarks(recorded):
        print(f"note: {remark}", file=sys.stderr)
    nodes = recorded.header.nodes
    if node and node not in nodes and f"{node}_node" not in nodes:
        raise UnknownName(f"This run has no node '{node}'.", fix=nearest(node, nodes))
    for record in recorded.records:
        config: Any = record.__struct_config__
        if kind and config.tag != kind:
            continue
        if node and getattr(record, "node", "") not in (node, f"{node}_node"):
            continue
        if name and not fnmatchcase(getattr(record, "name", ""), name):
            continue
        print(encode_record(record).decode() if as_json else _line(record, config.tag))


def _line(record: Record, kind: str) -> str:
    from snr_sim.recording.records import BeginRecord, EndRecord, ErrorRecord, InputRecord, SaidRecord, TruthRecord

    head = f"{record.seq:>7} {record.t:>10.4f} {kind:<6}"
    if isinstance(record, TruthRecord):
        return f"{head} " + " ".join(f"{key}={value:.6g}" for key, value in record.values.items())
    if isinstance(record, ErrorRecord):
        return f"{head} {record.node} {record.component}: {record.message}"
    if isinstance(record, SaidRecord):
        return f"{head} {record.node} {record.component} {record.level}: {record.text}"
    if isinstance(record, EndRecord):
        return f"{head} {record.node} {record.reason} {record.summary}"
    if isinstance(record, BeginRecord):
        return f"{head} {record.node} {record.by} {_returned(record.returned)}"
    values = bytes(record.values).decode()
    if isinstance(record, InputRecord):
        return f"{head} {record.node} {record.source} -> {record.type} {record.name} {values}"
    by = "; ".join(f"{one.by}.{one.handler} -> {_returned(one.returned)}" for one in record.handled) or "nobody"
    return f"{head} {record.node} {record.type} {record.name} {values} (from {record.cause}) {by}"


def _returned(returned: Any) -> str:
    return ", ".join(f"{one.type} {one.name}" for one in returned) or "-"
