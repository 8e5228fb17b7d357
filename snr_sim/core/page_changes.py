"""Note on a handler that changes the page that it reads: other components that handle it get the changed data.

Only pages that several components handle are compared, so others cost nothing; `scenario/controller_source.py` finds
assignments to any page in the source.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from snr_sim.core.source_location import location_of
from snr_sim.prelude.task import SomeTasks, Task, TaskHandler, TaskId, snapshot

COPY_FIX = "change a copy: {0} = dict({0}), or list({0})."


def watch_page(label: tuple[str, str], handler: TaskHandler, add_note: Callable[[str, str], None]) -> TaskHandler:
    """Return a wrapper of a handler of `process_data` that notes when it has changed the page's data.

    Args:
        label: names of component and handler.
        handler: the handler.
        add_note: adds a note, with the student's lines that it is about.
    """

    @wraps(handler)
    def call(task: Task, task_id: TaskId) -> SomeTasks:
        page = task.page
        if page is None or type(page.data) not in (dict, list):
            return handler(task, task_id)
        before = snapshot(page.data, [])
        returned = handler(task, task_id)
        if _is_changed(before, page.data):
            location = location_of(handler)
            add_note(
                f"{label[1]}() of '{label[0]}' changes the page '{page.key}' that it reads: other components get what "
                f"it has made of it.\n  Try: {COPY_FIX.format(page.key)}",
                "" if location is None else f"{location}\n  ",
            )
        return returned

    return call


def _is_changed(before: Any, data: Any) -> bool:
    try:
        return bool(before != data)
    except Exception:  # of arrays, and of objects with an __eq__ of their own: not known
        return False
