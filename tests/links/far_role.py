"""A role for another process: echoes what it receives, until it is ended. Started by test_processes.py."""

from __future__ import annotations

import os
import sys
from multiprocessing.connection import Connection
from typing import Any

from snr_sim import Config, Node, PipeLoopFactory, SocketsPair, Task, TaskType, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory


def main() -> None:
    """Run the remote role; its arguments name the medium: tcp PORT, or pipe DESCRIPTOR."""
    kind, number = sys.argv[1], int(sys.argv[2])
    link: Any
    if kind == "tcp":
        link = SocketsPair(("127.0.0.1", number), name="t").client("answer")
    else:
        link = PipeLoopFactory(Connection(os.dup(number)), "answer", name="t", is_first=False)

    def answer(task: Task, task_id: Any) -> Task:
        return node.store_data_task("answer", task.val_list[0].data)

    handlers: dict[Any, Any] = {
        (TaskType.store_page, "question"): answer,
        (TaskType.store_page, "end"): lambda task, task_id: tasks.terminate("as requested"),
    }
    node = Node("far", Config(factories={"far": [link, FunctionEndpointFactory(handlers)]}))
    node.loop()


if __name__ == "__main__":
    main()
