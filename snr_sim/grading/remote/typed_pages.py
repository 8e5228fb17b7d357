"""Pages that hold a dataclass or a Struct: they leave the student's process as its fields, and come back as they were.

In `snr run` such a page is the same object for all who read it in the node. Here the node is the grader's, which knows
no class of the student's. Devices and checks read the fields; the student's own components find the object again.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import msgspec

from snr_sim.prelude.page import Page
from snr_sim.prelude.task import Task, TaskType

_OBJECT = b'{"$":"object"'
_KEPT = 64  # pages of a key: a step may make some, which wait to be processed


class TypedPages:
    """Knows the newest ones of each key."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[tuple[bytes, Page]]] = {}

    def encode_task(self, task: Task) -> msgspec.Raw:
        """Return a task as it is sent to the grader."""
        raw = task.serialize()
        if _OBJECT in raw and task.type is TaskType.store_page and len(task.val_list) == 1:
            (page,) = task.val_list
            try:
                fields = msgspec.structs.replace(page, data=msgspec.to_builtins(page.data))
            except (TypeError, ValueError, RecursionError):
                return msgspec.Raw(raw)  # the grader reports what of it cannot be sent
            self._kept.setdefault(page.key, deque(maxlen=_KEPT)).append((fields.serialize(), page))
            raw = Task.store_page(fields).serialize()
        return msgspec.Raw(raw)

    def decode_page(self, raw: bytes) -> Page:
        """Return a page from the grader, with its original object if it was made here."""
        page = Page.deserialize(raw)
        kept: Any = self._kept.get(page.key, ())
        return next((made for fields, made in reversed(kept) if fields == raw), page)
