"""Reloads of code during a run: the sources that each read, and how a replay of the current code differs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePosixPath
from typing import Any

from snr_sim.prelude.page import KINDS, Page
from snr_sim.prelude.task import TaskType
from snr_sim.prelude.tasks import ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import PageRecord, Record

# The text that describes the reloaded code does not count as a difference in behaviour. Nor does the text of a failure:
# it names a file relative to the folder in which the run was started, and Python's messages differ between versions.
UNCOMPARED: tuple[str, ...] = (
    f"{TaskType.reload}.sources*=ignore",
    *(f"{key}.message=ignore" for key in (TaskType.reload, ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME)),
)


def reload_sources(trace: Trace) -> dict[int, dict[str, str]]:
    """Return the sha256 of each file that a reload read, by its name and its folder's, by the seq of the reload."""
    return {record.cause: dict(data["sources"]) for record, data in _reloads(trace.records)}


def describe_reloads(trace: Trace, replayed: Sequence[Record]) -> list[str]:
    """Return a sentence for each reload known to have read other code than that at the start of the run.

    Args:
        trace: of the run.
        replayed: records of its replay, with the seqs of the corresponding recorded ones.
    """
    at_first = {PurePosixPath(label).name: sha256 for label, sha256 in trace.header.sources.items()}
    now = {record.seq: data["sources"] for record, data in _reloads(replayed)}
    sentences = []
    for record, data in _reloads(trace.records):
        then = data["sources"]
        other = [file for file, sha256 in then.items() if at_first.get(PurePosixPath(file).name) != sha256]
        if other:
            since = " They have changed again since." if now.get(record.seq, then) != then else ""
            sentences.append(
                f"seq {record.seq}, t = {record.t:.3f} s: '{data['component']}' was reloaded with other "
                f"code than the run began with ({', '.join(other)}). This replay ran the current contents of the files "
                f"from the beginning.{since}"
            )
    return sentences


def _reloads(records: Sequence[Record]) -> Iterator[tuple[PageRecord, dict[str, Any]]]:
    """Yield the pages about reloads, and their data; a student's own page may have that key, too."""
    for record in records:
        if isinstance(record, PageRecord) and record.name == TaskType.reload:
            page = decode_value(bytes(record.values), KINDS)[0]
            if isinstance(page, Page) and isinstance(page.data, dict) and "sources" in page.data:
                yield record, page.data
