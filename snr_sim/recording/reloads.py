"""Reloads of code during a run: the sources that each read, and how a replay of the current code differs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath

from snr_sim.prelude.page import KINDS, Page
from snr_sim.prelude.task import TaskType
from snr_sim.prelude.tasks import ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import PageRecord, Record

# The text that describes the reloaded code does not count as a difference in behaviour. Nor does the text of a failure:
# it names a file relative to the folder in which the run was started, and Python's messages differ between versions.
UNCOMPARED = (
    f"{TaskType.reload}.sources*=ignore",
    *(f"{key}.message=ignore" for key in (TaskType.reload, ADD_COMPONENT_TASK_NAME, REMOVE_COMPONENT_TASK_NAME)),
)


def reload_sources(trace: Trace) -> dict[int, dict[str, str]]:
    """Return the sha256 of each file that a reload read, by its name and its folder's, by the seq of the reload."""
    pages = [record for record in trace.records if isinstance(record, PageRecord) and _is_reload(record)]
    return {page.cause: _sources(page) for page in pages}


def describe_reloads(trace: Trace, replayed: Sequence[Record]) -> list[str]:
    """Return a sentence for each reload known to have read other code than that at the start of the run.

    Args:
        trace: of the run.
        replayed: records of its replay, with the seqs of the corresponding recorded ones.
    """
    at_first = {PurePosixPath(label).name: sha256 for label, sha256 in trace.header.sources.items()}
    now = {record.seq: _sources(record) for record in replayed if _is_reload(record)}
    sentences = []
    for record in trace.records:
        if not (isinstance(record, PageRecord) and _is_reload(record)):
            continue
        then = _sources(record)
        other = [file for file, sha256 in then.items() if at_first.get(PurePosixPath(file).name) != sha256]
        if other:
            since = " They have changed again since." if now.get(record.seq, then) != then else ""
            sentences.append(
                f"seq {record.seq}, t = {record.t:.3f} s: '{_page(record).data['component']}' was reloaded with other "
                f"code than the run began with ({', '.join(other)}). This replay ran the current contents of the files "
                f"from the beginning.{since}"
            )
    return sentences


def _is_reload(record: Record) -> bool:
    if not (isinstance(record, PageRecord) and record.name == TaskType.reload):
        return False
    data = _page(record).data
    return isinstance(data, dict) and "sources" in data  # a student's own page may have that key, too


def _page(record: Record) -> Page:
    assert isinstance(record, PageRecord)
    page = decode_value(bytes(record.values), KINDS)[0]
    assert isinstance(page, Page)
    return page


def _sources(record: Record) -> dict[str, str]:
    return dict(_page(record).data["sources"])
