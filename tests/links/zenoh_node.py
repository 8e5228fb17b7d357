"""Program for test_zenoh_link.py: one node in its own process. Reads commands and prints the pages it stores, as lines
of JSON.
"""

from __future__ import annotations

import json
import sys
import threading
from typing import Any

from snr_sim import Config, Node, Task, TaskType, Tls, ZenohNet, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory


def main() -> None:
    role, net, link = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
    tls = Tls(**net.pop("tls")) if "tls" in net else None

    def print_page(task: Task, task_id: Any) -> None:
        page = task.val_list[0]
        print(json.dumps([page.key, page.data, page.origin]), flush=True)

    factories = [
        ZenohNet(tls=tls, **net).link(**link),
        FunctionEndpointFactory({TaskType.store_page: print_page}, "print_page"),
    ]
    node = Node(role, Config(factories={role: factories}))

    def read_commands() -> None:
        for line in sys.stdin:
            key, values = json.loads(line)
            for value in values:
                node.store_data(key, value)
        node.enqueue_input(tasks.terminate("end of input"), "test")

    threading.Thread(target=read_commands, daemon=True).start()
    node.loop()


if __name__ == "__main__":
    main()
