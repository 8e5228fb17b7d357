"""Printer: prints tasks as they are handled."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TextIO

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Page, SomeTasks, Task, TaskId, TaskType


class PrinterEndpointFactory(EndpointFactory):
    """Factory of an endpoint that prints a line for each task with one of some ids.

    Args:
        task_ids: ids of the tasks: `[(TaskType.process_data, "depth"), TaskType.event]`.
        stream: to print to; by default the value of sys.stdout at the time of printing.
    """

    def __init__(self, task_ids: Sequence[TaskId], stream: TextIO | None = None, name: str = "printer") -> None:
        super().__init__()
        self.task_ids: list[TaskId] = list(task_ids)
        self.stream: TextIO | None = stream
        self.name: str = name

    def get(self, parent: NodeApi) -> PrinterEndpoint:
        """Return the endpoint."""
        return PrinterEndpoint(self, parent, self.name)


class PrinterEndpoint(Endpoint):
    """Prints node, time, task, and the task's data."""

    factory: PrinterEndpointFactory

    def __init__(self, factory: PrinterEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = dict.fromkeys(factory.task_ids, self.print_task)

    def print_task(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Print one line."""
        line = f"{self.parent.name} {self.get_time_s():10.4f} s  {task.type.value} '{task.name}'  {self._about(task)}"
        print_line(self.factory.stream or sys.stdout, line.rstrip())
        return None

    def _about(self, task: Task) -> str:
        """Return the page's data for tasks about a page; else the values that the task carries."""
        if task.type is TaskType.process_data:
            return repr(self.get_data(task.name))
        values = [value.data if isinstance(value, Page) else value for value in task.val_list]
        return ", ".join(repr(value) for value in values)
